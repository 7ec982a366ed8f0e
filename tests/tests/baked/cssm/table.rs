//! The paper's table 1 on this device.

use std::path::Path;
use std::time::Instant;

use bevy::prelude::*;
use bevy_bounce::{CssmReceivers, CssmSettings, GiIsolate, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

use super::references::baked;
use super::views::{count_of, shown};

const SIZE: UVec2 = UVec2::new(640, 480);
/// Frames a second of the Cornell box on a GeForce 8800: receivers, bounces.
const PAPER: [(CssmReceivers, u32, f64); 4] = [
    (CssmReceivers::Pixels, 1, 5.2),
    (CssmReceivers::Pixels, 2, 1.4),
    (CssmReceivers::Texels, 1, 35.7),
    (CssmReceivers::Texels, 2, 10.4),
];

fn radiosity(receivers: CssmReceivers, bounces: u32) -> GlobalIllumination {
    let cssm = CssmSettings { receivers, ..CssmSettings::DEFAULT };
    let settings = GiSettings { bounces, cssm, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// Makes the lamp another one.
fn dim(stage: &mut Stage) {
    let lamp = stage.only::<SpotLight>();
    if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
        light.intensity *= 1.001;
    }
}

/// Seconds of the next frame, until the GPU is done.
fn seconds(stage: &mut Stage) -> f64 {
    let started = Instant::now();
    stage.picture();
    started.elapsed().as_secs_f64()
}

/// Nodes of a pixel's cut, in the mean.
fn nodes(stage: &mut Stage) -> f64 {
    let cuts = shown(stage, GiIsolate::CutSize);
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(GiIsolate::Indirect);
    cuts.pixels.iter().map(|pixel| f64::from(count_of(*pixel))).sum::<f64>() / cuts.pixels.len() as f64
}

/// An atlas of 128, cube maps of 64, cuts as `Quality::Medium` has them; the lamp changes in the frames that are timed, so that all bounces are made. What
/// pixels alone take is that of a frame in which it does not.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn frames_beside_those_of_the_paper() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let bake = baked(&path);
    let first = radiosity(CssmReceivers::Pixels, 1);
    let of_size = |size| Stage::of_asset("cornell_box.glb", run(size, Some(first.clone())), true, Some(bake.clone()));
    // How many nodes a pixel gathers from does not depend on how many pixels there are.
    let (mut stage, mut small) = (of_size(SIZE), of_size(SIZE / 5));
    stage.light_by(GlobalIllumination { technique: Technique::None, ..first.clone() });
    stage.settled_picture();
    let direct = seconds(&mut stage);
    println!("{} texels; a frame of direct light takes {direct:.2} s", bake.meta.texels);
    println!("| receivers | bounces | s | frames/s | the paper | nodes a pixel | the pixels' tests a second |");
    println!("|---|---|---|---|---|---|---|");
    for (receivers, bounces, paper) in PAPER {
        stage.light_by(radiosity(receivers, bounces));
        stage.settled_picture();
        let pixels = seconds(&mut stage) - direct;
        dim(&mut stage);
        let frame = seconds(&mut stage);
        print!("| {receivers:?} | {bounces} | {frame:.2} | {:.3} | {paper} |", 1.0 / frame);
        if receivers == CssmReceivers::Pixels {
            small.light_by(radiosity(receivers, bounces));
            let nodes = nodes(&mut small);
            let tests = nodes * f64::from(SIZE.element_product()) / pixels;
            println!(" {nodes:.0} | {tests:.2e} |");
            assert!(nodes > 0.0 && tests > 0.0);
        } else {
            println!(" | |");
        }
    }
}
