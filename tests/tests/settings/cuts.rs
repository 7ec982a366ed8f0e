//! Cuts: a camera that is reset recalls nothing.

use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, Technique};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::stage::{SMALL, Stage};

const SIZE: UVec2 = UVec2::new(64, 36);
const GLOSSY: RadianceCacheSettings = RadianceCacheSettings { glossy: true, ..RadianceCacheSettings::DEFAULT };

fn settings(radiance_cache: RadianceCacheSettings) -> GiSettings {
    GiSettings { history: 8, radiance_cache, ..SMALL }
}

/// The room as it is seen from somewhere.
fn look(at: Vec3) -> Transform {
    Transform::from_translation(at).looking_at(Vec3::new(-0.5, 1.0, -1.0), Vec3::Y)
}

fn stage(light: &GlobalIllumination, place: Transform) -> Stage {
    let mut run = bevy_bounce_tests::stage::run(SIZE, Some(light.clone()));
    run.exposure = Some(7.0);
    Stage::with_run(run, |app| {
        let place = move |mut cameras: Query<&mut Transform, With<Camera3d>>| {
            cameras.iter_mut().for_each(|mut camera| *camera = place);
        };
        app.add_plugins(CornellPlugin).add_systems(PostStartup, place);
    })
}

/// After a cut with a reset, the frame of a fresh start; without it, another one. Nothing has to be set back.
#[test]
fn a_reset_is_a_fresh_start() {
    for (technique, radiance_cache) in [
        (Technique::InstantRadiosity, RadianceCacheSettings::DEFAULT),
        (Technique::InstantRadiosity, GLOSSY),
        (Technique::RadianceCache, RadianceCacheSettings::DEFAULT),
    ] {
        let light = GlobalIllumination { technique, quality: Quality::Custom(settings(radiance_cache)), ..default() };
        let (from, to) = (look(Vec3::new(0.0, 2.0, 6.5)), look(Vec3::new(1.5, 2.5, 4.0)));
        let without_history = Quality::Custom(GiSettings { history: 0, ..settings(radiance_cache) });
        let fresh = stage(&GlobalIllumination { quality: without_history, ..light.clone() }, to).picture();
        let mut stage = stage(&light, from);
        let camera = stage.only::<Camera3d>();
        let mut cut = |reset: bool| {
            for step in 0..4 {
                let creeping = from.translation + Vec3::X * (0.01 * step as f32);
                stage.world().entity_mut(camera).insert(from.with_translation(creeping));
                stage.frame(Duration::ZERO);
            }
            stage.world().entity_mut(camera).insert(to);
            if let Some(mut light) = stage.world().get_mut::<GlobalIllumination>(camera) {
                light.reset = reset;
            }
            let picture = stage.picture();
            assert_eq!(stage.world().get::<GlobalIllumination>(camera), Some(&light), "is set back");
            picture
        };
        assert!(cut(false) != fresh, "{technique:?}: nothing is recalled");
        assert!(cut(true) == fresh, "{technique:?}, {radiance_cache:?}: something is recalled");
        assert!(stage.picture() == fresh, "{technique:?}: the frame after");
    }
}

/// History is there again in the frame after.
#[test]
fn a_reset_lasts_for_a_frame() {
    let light = GlobalIllumination {
        quality: Quality::Custom(settings(RadianceCacheSettings::DEFAULT)),
        reset: true,
        ..default()
    };
    let (from, to) = (look(Vec3::new(0.0, 2.0, 6.5)), look(Vec3::new(0.02, 2.0, 6.5)));
    let alone = stage(&light, to).picture();
    let mut stage = stage(&light, from);
    stage.light_by(light);
    stage.frame(Duration::ZERO);
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(to);
    assert!(stage.picture() != alone, "there is no history");
}
