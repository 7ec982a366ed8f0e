use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_examples::scenes::{AnimalPlugin, CornellPlugin};
use bevy_bounce_tests::picture::{Picture, linear_to_srgb};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

fn lit(technique: Technique, settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique, quality: Quality::Custom(settings) }
}

#[test]
#[ignore]
fn measure_creep() {
    let size = UVec2::new(160, 90);
    for technique in [Technique::InstantRadiosity, Technique::RadianceCache] {
        let mut stage = Stage::with_run(run(size, Some(lit(technique, SMALL))), |app| {
            app.add_plugins(CornellPlugin);
        });
        let camera = stage.only::<Camera3d>();
        let place = *stage.world().get::<Transform>(camera).expect("has a place");
        let pixel = 10.4 * 2.0 * (0.65_f32 / 2.0).tan() / size.y as f32;
        let scale = 0.5 / stage.picture().mean_luminance() as f32;
        let shown = |picture: &Picture| -> Vec<f32> {
            picture.pixels.as_flattened().iter().map(|c| linear_to_srgb((c * scale).clamp(0.0, 1.0)) * 255.0).collect()
        };
        for history in [0, 2, 4, 8, 16, 32] {
            stage.light_by(lit(technique, GiSettings { history, ..SMALL }));
            stage.world().entity_mut(camera).insert(place);
            stage.settled_picture();
            let mut changes = Vec::new();
            let mut last = shown(&stage.picture());
            let begin = std::time::Instant::now();
            for frame in 1..=60 {
                let moved = place.translation + Vec3::X * (pixel * 0.05 * frame as f32);
                stage.world().entity_mut(camera).insert(place.with_translation(moved));
                stage.frame(Duration::ZERO);
                let next = shown(&stage.captured());
                changes.extend(next.iter().zip(&last).map(|(a, b)| (a - b).abs()));
                last = next;
            }
            let time = begin.elapsed().as_secs_f32() / 60.0;
            changes.sort_by(f32::total_cmp);
            let at = |q: f32| changes[((changes.len() - 1) as f32 * q) as usize];
            println!("{technique:?} {history}: p50 {:.3} p90 {:.3} p99 {:.3} p99.9 {:.2} max {:.1}, {time:.2} s a frame", at(0.5), at(0.9), at(0.99), at(0.999), at(1.0));
        }
    }
}

#[test]
#[ignore]
fn measure_animation() {
    let size = UVec2::new(160, 90);
    for (technique, settings) in [
        (Technique::InstantRadiosity, SMALL),
        (Technique::InstantRadiosity, Quality::Medium.settings()),
        (Technique::RadianceCache, SMALL),
    ] {
        let mut stage = Stage::with_run(run(size, Some(lit(technique, GiSettings { history: 0, ..settings }))), |app| {
            app.add_plugins(AnimalPlugin);
        });
        let scale = 0.15 / stage.picture().mean_luminance() as f32;
        for history in [0, 8] {
            stage.light_by(lit(technique, GiSettings { history, ..settings }));
            stage.settled_picture();
            let shown = |picture: &Picture| -> Vec<f32> {
                picture.pixels.as_flattened().iter().map(|c| linear_to_srgb((c * scale).clamp(0.0, 1.0)) * 255.0).collect()
            };
            let mut means = Vec::new();
            let mut changes = Vec::new();
            let mut last: Option<Vec<f32>> = None;
            for _ in 0..30 {
                stage.frame(Duration::from_secs_f64(1.0 / 30.0));
                let picture = stage.captured();
                if let Ok(folder) = std::env::var("FRAMES") {
                    let name = format!("{folder}/{technique:?}_{}_{history}_{:02}.png", settings.vpls, means.len());
                    picture.map(|p| p.map(|c| c * scale)).save(std::path::Path::new(&name)).unwrap();
                }
                means.push(picture.mean_luminance());
                let next = shown(&picture);
                if let Some(last) = &last {
                    changes.extend(next.iter().zip(last).map(|(a, b)| (a - b).abs()));
                }
                last = Some(next);
            }
            changes.sort_by(f32::total_cmp);
            let at = |q: f32| changes[((changes.len() - 1) as f32 * q) as usize];
            let jump = means.windows(2).map(|m| (m[1] / m[0] - 1.0).abs()).fold(0.0, f64::max);
            let alone = means.windows(3).map(|m| (m[1] / (0.5 * (m[0] + m[2])) - 1.0).abs()).fold(0.0, f64::max);
            println!("{technique:?} {} vpls {history}: largest jump of the mean {:.2} %, off its neighbours {:.2} %; p50 {:.2} p99 {:.2} max {:.1}", settings.vpls, 100.0 * jump, 100.0 * alone, at(0.5), at(0.99), at(1.0));
        }
    }
}
