//! The paper's table 1 on this device.

use std::path::Path;
use std::time::{Duration, Instant};

use bevy::prelude::*;
use bevy_bounce::cssm::texel_cuts;
use bevy_bounce::{CssmReceivers, CssmSettings, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_examples::scenes::{ChurchPlugin, HeadsPlugin};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

use super::references::baked;
use super::views::nodes_of_pixels;

const SIZE: UVec2 = UVec2::new(640, 480);
/// Receivers and bounces of the rows.
const ROWS: [(CssmReceivers, u32); 4] =
    [(CssmReceivers::Pixels, 1), (CssmReceivers::Pixels, 2), (CssmReceivers::Texels, 1), (CssmReceivers::Texels, 2)];

fn radiosity(receivers: CssmReceivers, bounces: u32, error: f32) -> GlobalIllumination {
    let cssm = CssmSettings { receivers, error, ..CssmSettings::DEFAULT };
    let settings = GiSettings { bounces, cssm, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// What a frame takes, until the GPU is done.
#[derive(Clone, Copy)]
struct Cost {
    seconds: f64,
    /// Of the processor, over all cores, where the system tells: a software adapter's frame among other programs is that of its own.
    processor: f64,
}

/// Seconds of the processor that this program has taken; Linux counts them in hundredths.
fn processor_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = stat.split(' ').skip(13).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / 100.0
}

/// Of the next frame.
fn cost(stage: &mut Stage) -> Cost {
    let (started, before) = (Instant::now(), processor_seconds());
    stage.picture();
    Cost { seconds: started.elapsed().as_secs_f64(), processor: processor_seconds() - before }
}

fn sum(cuts: &[f32]) -> f64 {
    cuts.iter().map(|nodes| f64::from(*nodes)).sum()
}

/// A scene's rows: all bounces are made in a frame in which the settings change, and none in the next, at rest. Tests
/// of pixels are those of a frame at rest, tests of texels those that only the other one makes.
fn print_rows(name: &str, error: f32, paper: [f64; 4], of_size: impl Fn(UVec2) -> Stage) {
    // How many nodes a pixel gathers from does not depend on how many pixels there are.
    let (mut stage, mut small) = (of_size(SIZE), of_size(SIZE / 5));
    stage.light_by(GlobalIllumination { technique: Technique::None, ..default() });
    stage.settled_picture();
    let direct = cost(&mut stage);
    println!(
        "{name}, error {error}; direct light takes {:.2} s, {:.2} of the processor",
        direct.seconds, direct.processor
    );
    println!(
        "| receivers | bounces | s | processor | at rest | processor | frames/s | the paper | nodes | tests a second |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for ((receivers, bounces), paper) in ROWS.into_iter().zip(paper) {
        // Pipelines are compiled in frames that take less.
        stage.light_by(radiosity(receivers, 1, 128.0));
        (0..2).for_each(|_| stage.frame(Duration::ZERO));
        stage.light_by(radiosity(receivers, bounces, error));
        let (changed, rest) = (cost(&mut stage), cost(&mut stage));
        let (nodes, tests) = if receivers == CssmReceivers::Pixels {
            small.light_by(radiosity(receivers, bounces, error));
            let nodes = nodes_of_pixels(&mut small);
            (nodes, nodes * f64::from(SIZE.element_product()) / (rest.seconds - direct.seconds))
        } else {
            let [sent, shown] = texel_cuts(stage.render_world()).expect("texels are lit");
            (sum(&shown) / shown.len() as f64, (sum(&sent) + sum(&shown)) / (changed.seconds - rest.seconds))
        };
        print!("| {receivers:?} | {bounces} ");
        [changed, rest].iter().for_each(|cost| print!("| {:.2} | {:.2} ", cost.seconds, cost.processor));
        println!("| {:.3} | {paper} | {nodes:.0} | {tests:.2e} |", 1.0 / changed.seconds);
        assert!(nodes > 0.0 && tests > 0.0);
    }
    let texels = texel_cuts(stage.render_world()).map_or(0, |[sent, _]| sent.len());
    println!("{texels} texels");
}

/// A scene of its own, as the examples show it.
fn example(size: UVec2, plugin: impl Plugin) -> Stage {
    Stage::with_run(run(size, Some(radiosity(CssmReceivers::Pixels, 1, 128.0))), |app| {
        app.add_plugins(plugin);
    })
}

/// An atlas of 128, cube maps of 64.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn frames_of_the_box_beside_those_of_the_paper() {
    let bake = baked(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb"));
    let first = radiosity(CssmReceivers::Pixels, 1, 128.0);
    print_rows("the box", 16.0, [5.2, 1.4, 35.7, 10.4], |size| {
        Stage::of_asset("cornell_box.glb", run(size, Some(first.clone())), true, Some(bake.clone()))
    });
}

/// Three objects.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn frames_of_the_heads_beside_those_of_the_paper() {
    print_rows("the heads", 64.0, [7.4, 1.3, 7.8, 4.0], |size| example(size, HeadsPlugin));
}

#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn frames_of_the_church_beside_those_of_the_paper() {
    print_rows("the church", 64.0, [4.1, 0.7, 11.9, 3.1], |size| example(size, ChurchPlugin));
}
