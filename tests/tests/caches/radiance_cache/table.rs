//! The paper's figure 4 on this device.

use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::{GiSettings, RadianceCacheSettings};
use bevy_bounce_examples::scenes::ShowroomPlugin;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

use super::stage::cached;

/// Two million pixels.
const SIZE: UVec2 = UVec2::new(1742, 1145);
/// Milliseconds of the paper, on a GTX 670.
const STAGES: [(&str, &str, f64); 5] = [
    ("gbuffer", "G-Buf", 11.0),
    ("voxel_light", "Voxel Shade", 27.0),
    ("cache_distribution", "Cache Distribution", 31.0),
    ("cache_creation", "Cache Creation", 39.0),
    ("cache_evaluation", "Cache Evaluation", 33.5),
];

/// Ten directional lights in place of the scene's, voxels of 128^3, 4096 caches, one bounce: shares of the stages' sum.
#[test]
#[ignore = "prints a table; takes minutes on a software adapter"]
fn shares_beside_those_of_the_paper() {
    let caches = RadianceCacheSettings { further_bounces: false, ..default() };
    let settings = GiSettings { grid: 128, vpls: 16, sky: 0, radiance_cache: caches, ..SMALL };
    let mut stage = Stage::with_run(run(SIZE, Some(cached(settings))), |app| {
        app.add_plugins((ShowroomPlugin, bevy_bounce_examples::stage_clock::StageClockPlugin));
        app.add_systems(Startup, |mut commands: Commands| {
            for light in 0..10 {
                let (sin, cos) = (std::f32::consts::TAU * light as f32 / 10.0).sin_cos();
                let toward = Vec3::new(cos, -1.0, sin);
                commands.spawn((
                    DirectionalLight { illuminance: 1000.0, ..default() },
                    Transform::default().looking_to(toward, Vec3::Y),
                ));
            }
        });
    });
    let mut lamps = stage.world().query_filtered::<Entity, Or<(With<PointLight>, With<SpotLight>, With<RectLight>)>>();
    let lamps: Vec<Entity> = lamps.iter(stage.world()).collect();
    for lamp in lamps {
        stage.world().despawn(lamp);
    }
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    let times = stage.stage_times(3);
    let millis = |stage: &str| {
        let mut times = times.get(stage).cloned().unwrap_or_default();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let sum: f64 = STAGES.iter().map(|(stage, ..)| millis(stage)).sum();
    let of_paper: f64 = STAGES.iter().map(|(.., millis)| millis).sum();
    println!("{:?}", bevy_bounce::radiance_cache::cache_counts(stage.render_world_mut()));
    println!("| stage | paper's name | paper, ms | its share | share here | here, ms |");
    println!("|---|---|---|---|---|---|");
    for (stage, name, paper) in STAGES {
        let (own, ms) = (100.0 * millis(stage) / sum, millis(stage));
        println!("| `{stage}` | {name} | {paper} | {:.0} % | {own:.1} % | {ms:.0} |", 100.0 * paper / of_paper);
        assert!(own > 0.0, "{stage} was not measured");
    }
    println!("{times:?}");
}
