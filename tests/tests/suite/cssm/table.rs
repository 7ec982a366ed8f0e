//! The paper's table 1 on this device.

use std::path::Path;
use std::time::Instant;

use bevy::prelude::*;
use bevy_bounce::{GiIsolate, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

use super::references::baked;
use super::views::{count_of, shown};

const SIZE: UVec2 = UVec2::new(640, 480);

fn radiosity(bounces: u32) -> GlobalIllumination {
    let settings = GiSettings { bounces, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// Seconds of the next frame, until the GPU is done.
fn seconds(stage: &mut Stage) -> f64 {
    let started = Instant::now();
    stage.picture();
    started.elapsed().as_secs_f64()
}

/// An atlas of 128, cube maps of 64, cuts as `Quality::Medium` has them: frames in which the pixels alone are lit, and frames in which the
/// lamp changes, so that the texels are, too.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn frames_beside_those_of_the_paper() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let bake = baked(&path);
    let of_size = |size| Stage::of_asset("cornell_box.glb", run(size, Some(radiosity(1))), true, Some(bake.clone()));
    // How long texels take, and how many nodes a pixel gathers from, does not depend on how many pixels there are.
    let (mut stage, mut small) = (of_size(SIZE), of_size(SIZE / 5));
    println!("| bounces | texels, s | pixels, s | nodes a pixel | visibility tests a second |");
    println!("|---|---|---|---|---|");
    for bounces in [1, 2] {
        stage.light_by(radiosity(bounces));
        stage.picture();
        let pixels = seconds(&mut stage);
        small.light_by(radiosity(bounces));
        small.picture();
        let few_pixels = seconds(&mut small);
        let lamp = small.only::<SpotLight>();
        if let Some(mut light) = small.world().get_mut::<SpotLight>(lamp) {
            light.intensity *= 1.001;
        }
        let texels = seconds(&mut small) - few_pixels;
        let cuts = shown(&mut small, GiIsolate::CutSize);
        let camera = small.only::<Camera3d>();
        small.world().entity_mut(camera).insert(GiIsolate::Indirect);
        let nodes = cuts.pixels.iter().map(|pixel| f64::from(count_of(*pixel))).sum::<f64>() / cuts.pixels.len() as f64;
        let tests = nodes * f64::from(SIZE.element_product()) / pixels;
        println!("| {bounces} | {texels:.2} | {pixels:.2} | {nodes:.0} | {tests:.2e} |");
        assert!(nodes > 0.0 && pixels > 0.0);
    }
}
