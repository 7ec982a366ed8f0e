//! A budget spreads the bounces between texels over frames.

use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::cssm::times_lit;
use bevy_bounce::{CssmReceivers, CssmSettings, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_tests::baked::small_cornell_box;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const SIZE: UVec2 = UVec2::new(48, 27);
const BOUNCES: u32 = 6;
/// Between texels; the pixels gather the last one.
const BETWEEN: u64 = BOUNCES as u64 - 1;

/// A budget that leaves everything.
fn radiosity(budget: Option<f32>) -> GlobalIllumination {
    received(CssmReceivers::Pixels, BOUNCES, budget)
}

fn received(receivers: CssmReceivers, bounces: u32, budget: Option<f32>) -> GlobalIllumination {
    let cssm = CssmSettings { error: 8.0, receivers, ..CssmSettings::DEFAULT };
    let settings = GiSettings { bounces, cssm, history: 1, ..SMALL };
    GlobalIllumination {
        technique: Technique::SurfaceRadiosity,
        quality: Quality::Custom(settings),
        budget,
        ..default()
    }
}

fn stage(budget: Option<f32>) -> Stage {
    let run = run(SIZE, Some(radiosity(budget)));
    let mut stage = Stage::of_asset("cornell_box.glb", run, true, Some(small_cornell_box().clone()));
    stage.settled_picture();
    for _ in 0..2 * BETWEEN {
        stage.frame(Duration::ZERO);
    }
    stage
}

/// Makes the lamp so many times as bright.
fn dim(stage: &mut Stage, factor: f32) {
    let lamp = stage.only::<SpotLight>();
    if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
        light.intensity *= factor;
    }
}

fn next(stage: &mut Stage) -> Picture {
    stage.frame(Duration::ZERO);
    stage.captured()
}

#[test]
fn bounces_follow_each_other() {
    let (mut at_once, mut spread) = (stage(None), stage(Some(1e6)));
    let bright = at_once.picture();
    assert!(spread.picture() == bright, "at rest it is the same light");
    let times = times_lit(spread.render_world());
    spread.frame(Duration::ZERO);
    assert_eq!(times_lit(spread.render_world()), times, "light at rest is computed again");

    // What pixels gather is there at once, what bounces before that when all of it has.
    for factor in [0.125, 8.0] {
        dim(&mut at_once, factor);
        dim(&mut spread, factor);
        let (before, after) = (spread.captured().mean_luminance(), next(&mut at_once));
        let frames: Vec<Picture> = (0..BETWEEN).map(|_| next(&mut spread)).collect();
        let shares = frames.iter().map(|frame| (frame.mean_luminance() - before) / (after.mean_luminance() - before));
        let shares: Vec<f64> = shares.collect();
        println!("{shares:.3?}");
        let (last, early) = frames.split_last().expect("several bounces");
        assert!(
            shares[..early.len()].iter().all(|share| (0.4..0.9).contains(share)),
            "the first frames have {shares:?}"
        );
        assert!(*last == after, "the light is another than computed at once");
        assert!(next(&mut spread) == after, "it does not rest");
    }
}

/// A light that never rests still bounces on, and a budget that is taken away has all of it computed at once.
#[test]
fn light_that_changes_bounces_on() {
    let (mut at_once, mut spread) = (stage(None), stage(Some(1e6)));
    for frame in 0..4 * BETWEEN {
        for stage in [&mut at_once, &mut spread] {
            dim(stage, 0.97);
        }
        let (found, expected) = (next(&mut spread).mean_luminance(), next(&mut at_once).mean_luminance());
        assert!((found / expected - 1.0).abs() < 0.1, "frame {frame}: {found} for {expected}");
    }
    dim(&mut at_once, 0.5);
    dim(&mut spread, 0.5);
    spread.light_by(radiosity(None));
    assert!(next(&mut spread) == next(&mut at_once), "light without a budget waits");
}

/// However long a light changes, it bounces as often as asked, also where texels receive the last bounce.
#[test]
fn bounces_do_not_pile_up() {
    for receivers in [CssmReceivers::Pixels, CssmReceivers::Texels] {
        let mut stage = stage(None);
        stage.light_by(received(receivers, 3, None));
        let expected = stage.settled_picture().mean_luminance();
        stage.light_by(received(receivers, 4, None));
        let more = stage.settled_picture().mean_luminance();
        assert!(more > 1.02 * expected, "a further bounce would not be seen: {more} of {expected}");
        stage.light_by(received(receivers, 3, Some(1e6)));
        stage.settled_picture();
        for frame in 0..8 {
            dim(&mut stage, 1.0001);
            let found = next(&mut stage).mean_luminance();
            assert!((found / expected - 1.0).abs() < 0.01, "{receivers:?}, frame {frame}: {found} for {expected}");
        }
    }
}
