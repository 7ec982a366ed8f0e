//! Each kind of lamp in a closed room, against the closed form of what bounces there: of a flux that falls onto walls of albedo a,
//! their irradiance by bounced light has a / (1 - a) in all.

use std::f32::consts::PI;
use std::time::Duration;

use bevy::camera::ScalingMode;
use bevy::light::RectLight;
use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_examples::scenes::{Builder, Walls};
use bevy_bounce_tests::stage::Stage;

const ROOM: Vec3 = Vec3::new(4.0, 3.0, 3.5);
const ALBEDO: f32 = 0.5;
const PIXELS: UVec2 = UVec2::new(32, 32);

#[derive(Component)]
struct Lamp;

/// The room, from 0 to [`ROOM`], with a camera and an entity for a lamp.
fn stage() -> Stage {
    let settings = GiSettings { history: 0, probes: 0, ..Quality::Medium.settings() };
    Stage::new(PIXELS, settings, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let paint = build.paint([ALBEDO; 3]);
            let paints = Walls {
                floor: paint.clone(),
                ceiling: paint.clone(),
                back: paint.clone(),
                front: paint.clone(),
                left: paint.clone(),
                right: paint,
            };
            build.room(Vec3::ZERO, ROOM, &paints);
            build.commands.spawn((Lamp, Transform::default(), Visibility::default()));
            build.commands.spawn((Camera3d::default(), orthographic(1.0, 1.0)));
        });
    })
}

fn orthographic(width: f32, height: f32) -> Projection {
    let scaling_mode = ScalingMode::Fixed { width, height };
    Projection::from(OrthographicProjection { scaling_mode, near: 0.0, ..OrthographicProjection::default_3d() })
}

/// Flux of bounced light onto all six walls, lumens: each is looked at from the one across.
fn bounced(stage: &mut Stage) -> f32 {
    let camera = stage.only::<Camera3d>();
    let mut flux = 0.0;
    for way in [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]) {
        let up = if way.y == 0.0 { Vec3::Y } else { Vec3::Z };
        let right = way.cross(up).abs();
        let (width, height) = (right.dot(ROOM), up.abs().dot(ROOM));
        let eye = ROOM * 0.5 - way * (0.5 * way.abs().dot(ROOM));
        let place = Transform::from_translation(eye).looking_to(way, up);
        stage.world().entity_mut(camera).insert((place, orthographic(width, height)));
        let radiance = stage.picture().mean_luminance() as f32;
        flux += radiance * PI / ALBEDO * width * height;
    }
    flux
}

/// What bounces of lamps that send so many lumens.
fn expected(lumens: f32) -> f32 {
    lumens * ALBEDO / (1.0 - ALBEDO)
}

fn check(stage: &mut Stage, name: &str, lumens: f32) {
    let share = bounced(stage) / expected(lumens);
    println!("{name}: {share:.3} of what bounces");
    assert!((share - 1.0).abs() < 0.05, "{name}: {share} of what bounces");
}

/// Puts a lamp there, moves it, switches it off and on.
fn try_lamp(stage: &mut Stage, name: &str, lamp: impl Bundle + Clone, place: Transform, lumens: f32) {
    let entity = stage.only::<Lamp>();
    stage.world().entity_mut(entity).insert((lamp, place));
    // What it needs is compiled in the first frames.
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    check(stage, name, lumens);
    let first = stage.picture();
    stage.world().entity_mut(entity).insert(place.with_translation(place.translation + Vec3::new(0.4, -0.3, 0.2)));
    check(stage, &format!("{name}, moved"), lumens);
    stage.world().entity_mut(entity).insert((place, Visibility::Hidden));
    assert_eq!(stage.picture().mean_luminance(), 0.0, "{name}: switched off, it bounces on");
    stage.world().entity_mut(entity).insert(Visibility::Inherited);
    assert!(stage.picture() == first, "{name}: back, it bounces otherwise");
}

#[test]
fn every_lamp_sends_all_of_its_light() {
    let mut stage = stage();
    let at = Transform::from_xyz(1.5, 2.4, 1.6);
    let down = at.looking_to(Vec3::new(0.2, -1.0, 0.1), Vec3::Z);
    let lumens = 1000.0;
    let take = |stage: &mut Stage, remove: fn(&mut EntityWorldMut)| {
        let lamp = stage.only::<Lamp>();
        remove(&mut stage.world().entity_mut(lamp));
    };

    // Without an end of their reach, which Bevy's closed form is.
    let point = PointLight { intensity: lumens, range: 1e4, ..default() };
    try_lamp(&mut stage, "point", point, at, lumens);
    take(&mut stage, |lamp| {
        lamp.remove::<PointLight>();
    });

    // Of a cone with a sharp edge, its part of the sphere's lumens, as Bevy has it.
    let angle = 0.7_f32;
    let spot = SpotLight { intensity: lumens, range: 1e4, inner_angle: angle, outer_angle: angle, ..default() };
    try_lamp(&mut stage, "spot", spot, down, lumens * 0.5 * (1.0 - angle.cos()));
    take(&mut stage, |lamp| {
        lamp.remove::<SpotLight>();
    });

    // Through the back of the ceiling, which lets light pass as in Bevy's shadow maps.
    let sun = DirectionalLight { illuminance: 100.0, ..default() };
    try_lamp(&mut stage, "sun", sun, at.looking_to(Vec3::NEG_Y, Vec3::Z), 100.0 * ROOM.x * ROOM.z);
    take(&mut stage, |lamp| {
        lamp.remove::<DirectionalLight>();
    });

    let panel = RectLight { intensity: lumens, range: 1e4, width: 0.8, height: 0.5, ..default() };
    try_lamp(&mut stage, "panel", panel, down, lumens);

    // The light of voxels that a panel lights, which is what caches show.
    let quality = Quality::Custom(Quality::Medium.settings());
    stage.light_by(GlobalIllumination { technique: Technique::RadianceCache, quality, ..default() });
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    let share = bounced(&mut stage) / expected(lumens);
    println!("panel, by caches: {share:.3} of what bounces");
    assert!((share - 1.0).abs() < 0.15, "by caches, {share} of what bounces");
}
