//! Each kind of lamp in a closed room, against the closed form of what bounces there: of a flux that falls onto walls of albedo a,
//! their irradiance by bounced light has a / (1 - a) in all; and against a fresh start, once it was switched off and on.

use std::f32::consts::PI;
use std::time::Duration;

use bevy::camera::{Exposure, ScalingMode};
use bevy::light::RectLight;
use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, Resolution, Technique};
use bevy_bounce_examples::scenes::{Builder, Walls};
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::Stage;

const ROOM: Vec3 = Vec3::new(4.0, 3.0, 3.5);
const ALBEDO: f32 = 0.5;
const PIXELS: UVec2 = UVec2::new(32, 32);
/// Of each lamp but the spot, which has the part of them in its cone, and the sun.
const LUMENS: f32 = 1000.0;
/// Between the spot's axis and its sharp edge, radians.
const CONE: f32 = 0.7;
/// Illuminance by the sun, lux.
const SUN: f32 = 100.0;
/// Of a room with many lamps.
const LAMPS: usize = 300;
const NEXT_DOOR: usize = 5;
const PIXELS_OF_MANY: UVec2 = UVec2::new(320, 192);
/// Of panels, metres.
const PANEL: Vec2 = Vec2::new(0.8, 0.5);
/// Without an end of their reach, which Bevy's closed form is; metres.
const RANGE: f32 = 1e4;

#[derive(Component)]
struct Lamp;

#[derive(Clone, Copy, Debug)]
enum Kind {
    Point,
    Spot,
    Sun,
    Rect,
    Emission,
}

impl Kind {
    fn place(self) -> Transform {
        let at = Transform::from_xyz(1.5, 2.4, 1.6);
        let down = Vec3::new(0.2, -1.0, 0.1);
        match self {
            Kind::Point => at,
            Kind::Sun => at.looking_to(Vec3::NEG_Y, Vec3::Z),
            Kind::Spot | Kind::Rect => at.looking_to(down, Vec3::Z),
            // A mesh that faces its +z.
            Kind::Emission => at.looking_to(-down, Vec3::Z),
        }
    }

    /// Flux of what bounces of it onto the walls, lumens.
    fn bounced(self) -> f32 {
        let reflected = ALBEDO / (1.0 - ALBEDO);
        match self {
            Kind::Point | Kind::Rect => LUMENS * reflected,
            // As Bevy has it.
            Kind::Spot => LUMENS * 0.5 * (1.0 - CONE.cos()) * reflected,
            // Through the back of the ceiling, which lets light pass as in Bevy's shadow maps.
            Kind::Sun => SUN * ROOM.x * ROOM.z * reflected,
            // Bevy does not light by emission: what falls onto the walls at first is bounced light, too.
            Kind::Emission => LUMENS * (1.0 + reflected),
        }
    }

    fn put(self, lamp: &mut EntityWorldMut) {
        let (intensity, range, angle) = (LUMENS, RANGE, CONE);
        match self {
            Kind::Point => lamp.insert(PointLight { intensity, range, ..default() }),
            Kind::Spot => {
                lamp.insert(SpotLight { intensity, range, inner_angle: angle, outer_angle: angle, ..default() })
            }
            Kind::Sun => lamp.insert(DirectionalLight { illuminance: SUN, ..default() }),
            Kind::Rect => lamp.insert(RectLight { intensity, range, width: PANEL.x, height: PANEL.y, ..default() }),
            Kind::Emission => {
                let radiance = LUMENS / (PI * PANEL.element_product());
                let emission = radiance * Exposure::default().exposure();
                let paint = StandardMaterial {
                    base_color: Color::linear_rgb(ALBEDO, ALBEDO, ALBEDO),
                    emissive: LinearRgba::rgb(emission, emission, emission),
                    ..default()
                };
                let mesh = lamp.resource_mut::<Assets<Mesh>>().add(Rectangle::from_size(PANEL));
                let paint = lamp.resource_mut::<Assets<StandardMaterial>>().add(paint);
                lamp.insert((Mesh3d(mesh), MeshMaterial3d(paint)))
            }
        };
    }
}

/// All over the room, 100 to 1000 lumens; and in a room next door, where the last [`NEXT_DOOR`] of them are.
fn many_lamps(mut build: Builder) {
    let next_door = Vec3::X * (ROOM.x + 1.0);
    let walls = walls(&mut build);
    build.room(next_door, next_door + ROOM, &walls);
    for i in 0..LAMPS {
        let place = i * 107 % LAMPS;
        let part = Vec3::new((place % 20) as f32 + 0.5, 0.5 * (place % 3) as f32 + 7.0, (place / 20) as f32 + 0.5);
        let room = if i + NEXT_DOOR < LAMPS { Vec3::ZERO } else { next_door };
        let intensity = 100.0 * 10.0_f32.powf((i * 37 % LAMPS) as f32 / LAMPS as f32);
        let place = Transform::from_translation(room + part * ROOM / Vec3::new(20.0, 10.0, 15.0));
        build.commands.spawn((Lamp, place, PointLight { intensity, range: RANGE, ..default() }));
    }
}

/// Another lamp, in the place of the one before.
fn replace_lamp(world: &mut World, kind: Option<Kind>) {
    let mut lamps = world.query_filtered::<Entity, With<Lamp>>();
    let lamps: Vec<Entity> = lamps.iter(world).collect();
    lamps.into_iter().for_each(|lamp| _ = world.despawn(lamp));
    if let Some(kind) = kind {
        kind.put(&mut world.spawn((Lamp, kind.place(), Visibility::default())));
    }
}

fn walls(build: &mut Builder) -> Walls {
    let paint = build.paint([ALBEDO; 3]);
    let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| paint.clone());
    Walls { floor, ceiling, back, front, left, right }
}

fn room(mut build: Builder) {
    let walls = walls(&mut build);
    build.room(Vec3::ZERO, ROOM, &walls);
    build.commands.spawn((Camera3d::default(), orthographic(1.0, 1.0)));
}

/// The room, from 0 to [`ROOM`], with a camera and a lamp.
fn stage(kind: Option<Kind>, technique: Technique) -> Stage {
    let medium = GiSettings { history: 0, probes: 0, ..Quality::Medium.settings() };
    // To light voxels takes seconds on a software adapter.
    let settings = match technique {
        Technique::RadianceCache => GiSettings { grid: 48, vpls: 512, ..medium },
        _ => medium,
    };
    let mut stage = Stage::new(PIXELS, settings, |app| {
        let lamp = move |world: &mut World| replace_lamp(world, kind);
        app.add_systems(Startup, (room, lamp).chain());
    });
    stage.light_by(GlobalIllumination { technique, quality: Quality::Custom(settings), ..default() });
    // What it needs is compiled in the first frames.
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    stage
}

fn orthographic(width: f32, height: f32) -> Projection {
    let scaling_mode = ScalingMode::Fixed { width, height };
    Projection::from(OrthographicProjection { scaling_mode, near: 0.0, ..OrthographicProjection::default_3d() })
}

/// A wall as it is seen from the one across, and its area in square metres.
fn wall(stage: &mut Stage, way: Vec3) -> (Picture, f32) {
    let camera = stage.only::<Camera3d>();
    let up = if way.y == 0.0 { Vec3::Y } else { Vec3::Z };
    let right = way.cross(up).abs();
    let (width, height) = (right.dot(ROOM), up.abs().dot(ROOM));
    let eye = ROOM * 0.5 - way * (0.5 * way.abs().dot(ROOM));
    let place = Transform::from_translation(eye).looking_to(way, up);
    stage.world().entity_mut(camera).insert((place, orthographic(width, height)));
    (stage.picture(), width * height)
}

/// Flux of bounced light onto all six walls, lumens.
fn bounced(stage: &mut Stage) -> f32 {
    let ways = [Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]);
    let flux = |way| {
        let (picture, area) = wall(stage, way);
        picture.mean_luminance() as f32 * PI / ALBEDO * area
    };
    ways.map(flux).sum()
}

/// Radiance caches stay where they are from frame to frame; so both start anew.
fn forget_places(stage: &mut Stage) {
    let camera = stage.only::<Camera3d>();
    if let Some(mut light) = stage.world().get_mut::<GlobalIllumination>(camera) {
        light.reset = true;
    }
}

fn check(stage: &mut Stage, name: &str, expected: f32, tolerance: f32) {
    let share = bounced(stage) / expected;
    println!("{name}: {share:.3} of what bounces");
    assert!((share - 1.0).abs() < tolerance, "{name}: {share} of what bounces");
}

/// Puts a lamp there, moves it, switches it off and on. What bounces may be off by so large a part.
fn try_lamp(stage: &mut Stage, kind: Kind, technique: Technique, tolerance: f32) {
    replace_lamp(stage.world(), Some(kind));
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    check(stage, &format!("{kind:?}, {technique:?}"), kind.bounced(), tolerance);
    let (lamp, place) = (stage.only::<Lamp>(), kind.place());
    stage.world().entity_mut(lamp).insert(place.with_translation(place.translation + Vec3::new(0.4, -0.3, 0.2)));
    check(stage, &format!("{kind:?}, moved"), kind.bounced(), tolerance);
    stage.world().entity_mut(lamp).insert((place, Visibility::Hidden));
    assert_eq!(stage.picture().mean_luminance(), 0.0, "{kind:?}: switched off, it bounces on");
    stage.world().entity_mut(lamp).insert(Visibility::Inherited);
    let [back, fresh] = [stage, &mut self::stage(Some(kind), technique)].map(|stage| {
        forget_places(stage);
        wall(stage, Vec3::NEG_Z).0
    });
    assert!(
        fresh.mean_luminance() > 0.0 && back == fresh,
        "{kind:?}: back, it bounces otherwise than at a fresh start"
    );
}

/// Mean luminances of blocks of 32 x 32 pixels, cd/m^2.
fn blocks(picture: &Picture) -> Vec<f64> {
    let blocks = PIXELS_OF_MANY / 32;
    let mean = |block: u32| {
        let first = (UVec2::new(block % blocks.x, block / blocks.x) * 32).as_usizevec2();
        luminance(picture.mean_of(first.x..first.x + 32, first.y..first.y + 32).map(|value| value as f32))
    };
    (0..blocks.element_product()).map(mean).collect()
}

/// One of many lamps comes and goes where nothing is seen of it.
#[test]
fn many_lamps_keep_their_light_when_one_goes() {
    let settings = GiSettings { history: 0, probes: 0, resolution: Resolution::Full, ..Quality::Medium.settings() };
    let mut stage = Stage::new(PIXELS_OF_MANY, settings, |app| {
        app.add_systems(Startup, (room, many_lamps));
    });
    let camera = stage.only::<Camera3d>();
    let place = Transform::from_xyz(0.2, 1.6, 0.2).looking_at(Vec3::new(4.0, 1.0, 3.5), Vec3::Y);
    let projection = Projection::from(PerspectiveProjection { fov: 1.2, ..default() });
    stage.world().entity_mut(camera).insert((place, projection));
    let mut lamps = stage.world().query_filtered::<(Entity, &Transform), With<Lamp>>();
    let next_door: Vec<Entity> =
        lamps.iter(stage.world()).filter(|(_, place)| place.translation.x > ROOM.x).map(|(lamp, _)| lamp).collect();
    assert_eq!(next_door.len(), NEXT_DOOR);
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    let all = blocks(&stage.picture());
    for lamp in next_door {
        stage.world().entity_mut(lamp).insert(Visibility::Hidden);
        let rest = blocks(&stage.picture());
        stage.world().entity_mut(lamp).insert(Visibility::Inherited);
        let changes = all.iter().zip(&rest).map(|(all, rest)| (rest / all - 1.0).abs());
        let (largest, mean) = (changes.clone().fold(0.0, f64::max), changes.sum::<f64>() / all.len() as f64);
        println!("{lamp}: {:.2} % in the worst block, {:.2} % in the mean", largest * 100.0, mean * 100.0);
        assert!(
            largest < 0.03 && mean < 0.006,
            "{lamp} changes {largest} of a block it does not light, {mean} in the mean"
        );
    }
}

#[test]
fn every_lamp_sends_all_of_its_light() {
    let mut stage = stage(None, Technique::InstantRadiosity);
    for kind in [Kind::Point, Kind::Spot, Kind::Sun, Kind::Emission, Kind::Rect] {
        try_lamp(&mut stage, kind, Technique::InstantRadiosity, 0.05);
    }
}

/// Caches show the light of voxels, which is as coarse as these.
#[test]
fn lamps_light_caches() {
    let mut stage = stage(None, Technique::RadianceCache);
    for kind in [Kind::Spot, Kind::Sun] {
        try_lamp(&mut stage, kind, Technique::RadianceCache, 0.15);
    }
}

#[test]
fn other_lamps_light_caches() {
    let mut stage = stage(None, Technique::RadianceCache);
    try_lamp(&mut stage, Kind::Point, Technique::RadianceCache, 0.15);
    replace_lamp(stage.world(), Some(Kind::Rect));
    stage.frame(Duration::ZERO);
    stage.frame(Duration::ZERO);
    check(&mut stage, "Rect, by caches", Kind::Rect.bounced(), 0.15);
}

#[test]
#[ignore = "not met: cones take a panel askew for larger than it is, by 1.18"]
fn an_emissive_panel_lights_caches() {
    let mut stage = stage(None, Technique::RadianceCache);
    try_lamp(&mut stage, Kind::Emission, Technique::RadianceCache, 0.15);
}
