//! What is told while a bake goes on.

use std::sync::Mutex;

use bevy_bounce_bake::{LightmapSettings, Progress, Source, Step, bake, bake_lightmap};

use crate::scenes::{cornell_box, random, small};

#[derive(Default)]
struct Log(Mutex<Vec<(Step, usize, Option<usize>)>>);

impl Progress for Log {
    fn report(&self, step: Step, done: usize, total: Option<usize>) {
        self.0.lock().expect("nothing panics").push((step, done, total));
    }
}

impl Log {
    /// Each step was told of one after the other, out of so many where that is known, and went on to its end.
    fn check(self, steps: &[(Step, Option<usize>)]) {
        let reports = self.0.into_inner().expect("nothing panics");
        for &(step, all) in steps {
            let of_step: Vec<_> = reports.iter().filter(|(other, ..)| *other == step).collect();
            assert!(!of_step.is_empty() && of_step.iter().all(|(_, _, total)| *total == all), "{step:?}: {of_step:?}");
            let most = of_step.iter().map(|(_, done, _)| *done).max();
            assert!(all.is_none() || most == all, "{step:?}: {of_step:?}");
        }
        let mut order: Vec<Step> = reports.iter().map(|(step, ..)| *step).collect();
        order.dedup();
        assert_eq!(order, steps.iter().map(|(step, _)| *step).collect::<Vec<_>>());
    }
}

#[test]
fn each_step_tells_how_far_it_is() {
    let (scene, log) = (random(2), Log::default());
    let (file, _) = bake(&scene, &small(), &log).expect("it can be baked");
    log.check(&[
        (Step::Unwrapping, Some(scene.parts[0].triangles.len())),
        (Step::Packing, None),
        (Step::Casting, Some(file.meta.texels as usize)),
        (Step::Outside, Some((file.meta.csm_grid * file.meta.csm_grid) as usize)),
    ]);
}

#[test]
fn each_step_of_a_lightmap_tells_how_far_it_is() {
    let source = Source::open(&cornell_box()).expect("the repository has it");
    let settings = LightmapSettings { atlas: 32, rays: 16, probes: 2, unwrap: true, ..LightmapSettings::default() };
    let log = Log::default();
    let (_, report) = bake_lightmap(&source, "lit", &settings, &log).expect("it can be baked");
    let triangles = log.0.lock().expect("nothing panics").first().and_then(|(.., total)| *total);
    log.check(&[
        (Step::Unwrapping, triangles),
        (Step::Packing, None),
        (Step::Linking, Some(report.texels)),
        (Step::Bouncing, None),
        (Step::Gathering, Some(report.texels)),
        (Step::Probing, Some(report.probes.into_iter().product::<u32>() as usize)),
    ]);
}
