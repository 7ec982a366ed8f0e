//! Whole frames with a budget: it takes from its own camera's quality what it must, and from nothing else.

use std::time::Duration;

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_bounce::{GiBudget, GiIsolate, GiSettings, GlobalIllumination, Quality, SsbcSettings, gpu_memory, vpl_count};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::gpu::webgpu_limits;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(96, 54);
/// Less than any adapter takes.
const TIGHT: Option<f32> = Some(0.1);
const WIDE: Option<f32> = Some(100_000.0);
/// With compensation.
const STATED: GiSettings =
    GiSettings { vpls: 1024, ssbc: SsbcSettings { iterations: 1, ..SsbcSettings::OFF }, ..SMALL };

fn lit(budget: Option<f32>) -> GlobalIllumination {
    GlobalIllumination { budget, ..illumination(STATED) }
}

/// Whether this run is one whose devices take none; what is left then is a test of its own.
fn without_timestamps() -> bool {
    if webgpu_limits() {
        println!("skipped: WebGPU's default limits leave out timestamps, which a budget needs");
    }
    webgpu_limits()
}

/// With Bevy's measurements, and timestamps unless limits leave them out.
fn cornell(budget: Option<f32>, bare: bool) -> Stage {
    let mut run = run(SIZE, Some(GlobalIllumination { budget: WIDE, ..illumination(STATED) }));
    run.webgpu_limits |= bare;
    let mut stage = Stage::with_run(run, |app| {
        app.add_plugins(CornellPlugin);
    });
    stage.light_by(lit(budget));
    stage
}

fn left(stage: &mut Stage) -> Option<GiBudget> {
    let camera = stage.only::<Camera3d>();
    stage.world().get::<GiBudget>(camera).copied()
}

fn frames(stage: &mut Stage, count: u32) {
    (0..count).for_each(|_| stage.frame(Duration::ZERO));
}

/// How far it falls, and what of the picture is left; with the budget taken away, everything is back.
#[test]
fn a_tight_budget_lowers_the_quality_of_its_camera() {
    if without_timestamps() {
        return;
    }
    let mut stage = cornell(None, false);
    frames(&mut stage, 12);
    let stated = stage.settled_picture();
    let (all, held) = (vpl_count(stage.render_world_mut()), gpu_memory(stage.render_world_mut()));
    assert_eq!(left(&mut stage), None);

    stage.light_by(lit(TIGHT));
    let (mut last, mut count, mut turn) = (1.0, all, 0);
    while last >= 0.2 && turn < 8 {
        turn += 1;
        frames(&mut stage, 14);
        let budget = left(&mut stage).expect("a camera with a budget knows what it leaves");
        let lights = vpl_count(stage.render_world_mut());
        println!("{turn}: {}, {:?} ms, {lights:?} lights", budget.share, budget.spent);
        assert!(budget.share <= last && lights <= count, "{budget:?}, {lights:?} after {last}, {count:?}");
        assert!(budget.spent.is_none_or(|spent| spent > 0.1), "{budget:?}");
        (last, count) = (budget.share, lights);
    }
    assert!(last < 0.2 && count < all.map(|all| all / 4), "share {last}, {count:?} of {all:?} lights");
    let given = stage.picture();
    let energy = Metrics::new(&given, &stated).expect("sizes are equal").energy;
    println!("energy with {count:?} of {all:?} lights: {energy:.4}");
    assert!(given != stated && (energy - 1.0).abs() < 0.1, "energy {energy}");
    assert_eq!(gpu_memory(stage.render_world_mut()), held, "a budget allocates");

    stage.light_by(lit(None));
    assert!(stage.settled_picture() == stated, "a budget left something behind");
    assert_eq!((left(&mut stage), vpl_count(stage.render_world_mut())), (None, all));
}

/// What the budget never touches is the same to the bit.
#[test]
fn a_wide_budget_changes_nothing() {
    if without_timestamps() {
        return;
    }
    let mut stage = cornell(None, false);
    let without = stage.settled_picture();
    stage.light_by(lit(WIDE));
    frames(&mut stage, 20);
    let budget = left(&mut stage).expect("has a budget");
    assert!(budget.share == 1.0 && budget.spent.is_some_and(|spent| spent > 0.0), "{budget:?}");
    assert!(stage.picture() == without);
    // What makes no sense is no budget.
    for budget in [f32::NAN, 0.0, -1.0] {
        stage.light_by(lit(Some(budget)));
        frames(&mut stage, 2);
        assert_eq!(left(&mut stage), None, "{budget}");
    }
}

/// Without timestamps nothing is known, and quality stays.
#[test]
fn without_timestamps_quality_stays_as_stated() {
    let mut stage = cornell(None, true);
    let without = stage.settled_picture();
    stage.light_by(lit(TIGHT));
    frames(&mut stage, 15);
    let budget = left(&mut stage).expect("has a budget");
    assert_eq!((budget.share, budget.spent), (1.0, None));
    assert!(stage.picture() == without);
}

/// Beside a camera with a tight budget, one without has what it asks for.
#[test]
fn a_budget_is_its_cameras_own() {
    if without_timestamps() {
        return;
    }
    let mut stage = cornell(None, false);
    let tight = stage.only::<Camera3d>();
    let place = *stage.world().get::<Transform>(tight).expect("has a place");
    let second = (lit(None), GiIsolate::Indirect, place);
    let eye = Eye::open(&mut stage, SIZE, Exposure { ev100: 7.0 }, second);
    frames(&mut stage, 12);
    let alone: Picture = eye.picture(&stage);
    stage.world().entity_mut(tight).insert(lit(TIGHT));
    let share = |stage: &mut Stage| stage.world().get::<GiBudget>(tight).map_or(1.0, |budget| budget.share);
    for _ in 0..10 {
        if share(&mut stage) >= 0.5 {
            frames(&mut stage, 8);
        }
    }
    assert!(share(&mut stage) < 0.5, "{}", share(&mut stage));
    assert!(stage.world().get::<GiBudget>(eye.camera).is_none());
    assert!(eye.picture(&stage) == alone, "the budget of another camera shows");
}

/// A share that changes is no other light to history.
#[test]
fn history_goes_on_while_the_share_changes() {
    let mut stage = cornell(None, false);
    let lit_with =
        |history| GlobalIllumination { quality: Quality::Custom(GiSettings { history, ..STATED }), ..lit(WIDE) };
    stage.light_by(lit_with(8));
    frames(&mut stage, 12);
    let camera = stage.only::<Camera3d>();
    stage.world().get_mut::<GiBudget>(camera).expect("has a budget").share = 0.9;
    let with = stage.picture();
    stage.light_by(lit_with(0));
    let without = stage.settled_picture();
    assert_eq!(left(&mut stage).map(|budget| budget.share), Some(0.9));
    let energy = Metrics::new(&with, &without).expect("sizes are equal").energy;
    println!("energy of the frame with history, of that without: {energy:.4}");
    assert!(with != without, "history is forgotten");
    assert!((energy - 1.0).abs() < 0.024, "energy {energy}");
}

/// From frame to frame, by how many steps of the display 99 of 100 pixels change at most.
fn change(before: &[u8], after: &[u8]) -> u8 {
    let pixels = before.chunks_exact(4).zip(after.chunks_exact(4));
    let mut changes: Vec<u8> = pixels.map(|(a, b)| (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0)).collect();
    changes.sort_unstable();
    changes[changes.len() * 99 / 100]
}

/// Sets the share as the controller would at its fastest, step by step, and looks at each frame.
fn steps(stage: &mut Stage, camera: Entity, shares: impl Iterator<Item = f32>) -> u8 {
    let mut worst = 0;
    for share in shares {
        stage.world().get_mut::<GiBudget>(camera).expect("has a budget").share = share;
        for _ in 0..12 {
            let before = stage.display();
            stage.frame(Duration::ZERO);
            let change = change(&before, &stage.display());
            worst = worst.max(change);
        }
        let lights = vpl_count(stage.render_world_mut());
        println!("share {share:.3}, {lights:?} lights: up to {worst} steps so far");
    }
    worst
}

/// How much of a share that changes is seen, in the whole picture: from all of it down, then from so much up.
fn seen(down: impl Iterator<Item = f32>, from: f32, up: impl Iterator<Item = f32>) -> (u8, u8) {
    let settings = GiSettings { history: 8, grid: 48, ..STATED };
    let mut run = run(UVec2::new(160, 90), Some(GlobalIllumination { budget: WIDE, ..illumination(settings) }));
    run.isolate = GiIsolate::All;
    run.webgpu_limits = false;
    let mut stage = Stage::with_run(run, |app| {
        app.add_plugins(CornellPlugin);
    });
    let camera = stage.only::<Camera3d>();
    frames(&mut stage, 10);
    let down = steps(&mut stage, camera, down);
    stage.world().get_mut::<GiBudget>(camera).expect("has a budget").share = from;
    frames(&mut stage, 80);
    let up = steps(&mut stage, camera, up);
    let lamp = stage.only::<SpotLight>();
    stage.world().get_mut::<SpotLight>(lamp).expect("is a lamp").intensity = 0.0;
    assert_eq!(stage.picture().mean_luminance(), 0.0, "a lamp that is switched off fades");
    println!("down: {down} steps of the display, up: {up}");
    (down, up)
}

#[test]
fn steps_of_the_share_are_hardly_seen() {
    let (down, up) = seen((1..=5).map(|step| 0.7_f32.powi(step)), 0.7, std::iter::once(0.735));
    assert!(down.max(up) <= 3, "down: {down} steps of the display, up: {up}");
}

#[test]
fn steps_between_few_lights_are_hardly_seen() {
    let (down, up) = seen((1..=7).map(|step| 0.7_f32.powi(step)), 0.3, (1..=5).map(|step| 0.3 * 1.05_f32.powi(step)));
    assert!(down.max(up) <= 3, "down: {down} steps of the display, up: {up}");
}
