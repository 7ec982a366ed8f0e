//! What is told while a bake goes on.

use std::sync::Mutex;

use bevy_bounce_bake::{Progress, Step, bake};

use crate::scenes::{random, small};

#[derive(Default)]
struct Log(Mutex<Vec<(Step, usize, Option<usize>)>>);

impl Progress for Log {
    fn report(&self, step: Step, done: usize, total: Option<usize>) {
        self.0.lock().expect("nothing panics").push((step, done, total));
    }
}

#[test]
fn each_step_tells_how_far_it_is() {
    let (scene, log) = (random(2), Log::default());
    let (file, _) = bake(&scene, &small(), &log).expect("it can be baked");
    let reports = log.0.into_inner().expect("nothing panics");
    let triangles = scene.parts[0].triangles.len();
    for (step, all) in [
        (Step::Unwrapping, Some(triangles)),
        (Step::Packing, None),
        (Step::Casting, Some(file.meta.texels as usize)),
        (Step::Outside, Some((file.meta.csm_grid * file.meta.csm_grid) as usize)),
    ] {
        let of_step: Vec<_> = reports.iter().filter(|(other, ..)| *other == step).collect();
        assert!(!of_step.is_empty() && of_step.iter().all(|(_, _, total)| *total == all), "{step:?}: {of_step:?}");
        let most = of_step.iter().map(|(_, done, _)| *done).max();
        assert!(all.is_none() || most == all, "{step:?}: {of_step:?}");
    }
    let steps: Vec<Step> = reports.iter().map(|(step, ..)| *step).collect();
    let mut order = steps.clone();
    order.dedup();
    assert_eq!(order, [Step::Unwrapping, Step::Packing, Step::Casting, Step::Outside]);
}
