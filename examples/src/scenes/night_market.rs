//! A market in an alley at night: stalls with bulbs, candles and signs, strings of paper lanterns that sway overhead.
//!
//! Bulbs are spot and point lights, without shadow maps but for the lamps at the corners. Lanterns, candles, signs and
//! windows are emissive, and light what is around them by bounced light alone.

use std::f32::consts::{PI, TAU};

use bevy::camera::Exposure;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_bounce::{GlobalIllumination, VoxelizedMesh};

use super::Builder;
use super::chance::Chance;

/// The alley: 20 stalls with three bulbs each, and some 300 things that glow.
pub struct NightMarketPlugin;

/// Stalls on each side, metres from one to the next, and from the middle of the alley to their counters.
const STALLS: u32 = 10;
const PITCH: f32 = 3.0;
const AISLE: f32 = 2.0;
/// From the middle of the alley to the houses, and their height, metres.
const HOUSES: f32 = 4.2;
const ROOFS: f32 = 6.5;
/// Lanterns on a string, and strings over each stall.
const LANTERNS: u32 = 9;
const STRINGS: u32 = 2;
const LENGTH: f32 = STALLS as f32 * PITCH;

/// A string of lanterns that sways about the line between its ends.
#[derive(Component)]
struct Sways {
    phase: f32,
}

impl Plugin for NightMarketPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, sway);
    }
}

/// What stalls and strings are made of.
struct Stock {
    wood: Handle<StandardMaterial>,
    cloths: [Handle<StandardMaterial>; 4],
    goods: [Handle<StandardMaterial>; 6],
    glows: [Handle<StandardMaterial>; 5],
    flame: Handle<StandardMaterial>,
    ball: Handle<Mesh>,
    cube: Handle<Mesh>,
    chance: Chance,
}

/// Paint that emits; 1 is white on the display, whatever the exposure.
fn glow(build: &mut Builder, color: [f32; 3]) -> Handle<StandardMaterial> {
    build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        emissive: LinearRgba::rgb(color[0], color[1], color[2]),
        ..default()
    })
}

impl Stock {
    fn new(build: &mut Builder) -> Self {
        let cloth = |build: &mut Builder, albedo: [f32; 3]| {
            build.materials.add(StandardMaterial {
                base_color: Color::linear_rgb(albedo[0], albedo[1], albedo[2]),
                perceptual_roughness: 1.0,
                double_sided: true,
                cull_mode: None,
                ..default()
            })
        };
        Self {
            wood: build.paint([0.32, 0.2, 0.11]),
            cloths: [[0.62, 0.08, 0.06], [0.08, 0.26, 0.5], [0.68, 0.5, 0.12], [0.7, 0.68, 0.62]]
                .map(|albedo| cloth(build, albedo)),
            goods: [
                [0.65, 0.25, 0.04],
                [0.5, 0.04, 0.05],
                [0.14, 0.38, 0.06],
                [0.6, 0.55, 0.15],
                [0.3, 0.1, 0.35],
                [0.6, 0.56, 0.5],
            ]
            .map(|albedo| build.paint(albedo)),
            glows: [[7.0, 1.6, 0.5], [7.0, 3.6, 0.9], [1.4, 4.5, 2.6], [1.2, 2.6, 7.0], [6.0, 1.2, 4.0]]
                .map(|color| glow(build, color)),
            flame: glow(build, [24.0, 11.0, 3.0]),
            ball: build.meshes.add(Sphere::new(1.0).mesh().uv(12, 8)),
            cube: build.meshes.add(Cuboid::from_length(1.0)),
            chance: Chance(0x2c1b_3c6d),
        }
    }

    fn one<const N: usize>(chance: &mut Chance, of: &[Handle<StandardMaterial>; N]) -> Handle<StandardMaterial> {
        of[(chance.next() * N as f32) as usize].clone()
    }
}

fn spawn(mut build: Builder) {
    let mut stock = Stock::new(&mut build);
    alley(&mut build, &mut stock);
    for stall in 0..STALLS {
        let z = -PITCH * (stall as f32 + 0.5);
        for side in [-1.0, 1.0] {
            spawn_stall(&mut build, &mut stock, side, z);
        }
        for string in 0..STRINGS {
            spawn_string(&mut build, &mut stock, z + PITCH * string as f32 / STRINGS as f32);
        }
    }
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 4.5 },
        Projection::Perspective(PerspectiveProjection { fov: 0.95, ..default() }),
        Transform::from_xyz(0.5, 1.9, 2.2).looking_at(Vec3::new(-0.4, 1.5, -8.0), Vec3::Y),
    ));
}

/// Paving, houses with lit windows on both sides and at both ends, a lamp at each corner.
fn alley(build: &mut Builder, stock: &mut Stock) {
    let paving = build.paint([0.2, 0.19, 0.18]);
    let walls = [[0.45, 0.3, 0.22], [0.5, 0.45, 0.38]].map(|albedo| build.paint(albedo));
    let window = glow(build, [3.0, 2.2, 1.1]);
    let middle = Vec3::new(0.0, 0.0, 2.0 - 0.5 * LENGTH);
    let depth = LENGTH + 8.0;
    build.block(middle - Vec3::Y * 0.2, Vec3::new(2.0 * HOUSES, 0.2, depth), 0.0, &paving);
    for (side, wall) in [-1.0, 1.0].into_iter().zip(&walls) {
        build.block(middle + Vec3::X * side * (HOUSES + 0.2), Vec3::new(0.4, ROOFS, depth), 0.0, wall);
        build.block(middle + Vec3::Z * side * 0.5 * depth, Vec3::new(2.0 * HOUSES, ROOFS, 0.4), 0.0, wall);
        for place in 0..STALLS {
            if stock.chance.next() < 0.6 {
                let at = Vec3::new(side * HOUSES, 4.0, -PITCH * (place as f32 + 0.5));
                build.block(at, Vec3::new(0.04, 1.3, 0.9), 0.0, &window);
            }
        }
        for z in [1.5, -LENGTH] {
            let at = Vec3::new(side * (HOUSES - 0.3), 4.2, z);
            let lamp = SpotLight {
                color: Color::linear_rgb(0.8, 0.9, 1.0),
                intensity: 4_000.0,
                range: 15.0,
                inner_angle: 0.6,
                outer_angle: 0.9,
                shadow_maps_enabled: true,
                ..default()
            };
            build.commands.spawn((lamp, Transform::from_translation(at).looking_to(Vec3::NEG_Y, Vec3::Z)));
        }
    }
}

/// A counter with goods and candles under a cloth, bulbs below it, and a sign. It faces the middle of the alley.
fn spawn_stall(build: &mut Builder, stock: &mut Stock, side: f32, z: f32) {
    let at = |out: f32, y: f32, along: f32| Vec3::new(side * (AISLE + out), y, z + along);
    let wood = stock.wood.clone();
    build.block(at(0.35, 0.0, 0.0), Vec3::new(0.7, 0.85, 2.3), 0.0, &wood);
    build.block(at(1.9, 0.0, 0.0), Vec3::new(0.35, 1.7, 2.3), 0.0, &wood);
    for (out, along) in [(0.0, -1.2), (0.0, 1.2), (1.9, -1.2), (1.9, 1.2)] {
        build.block(at(out, 0.0, along), Vec3::new(0.06, 2.4, 0.06), 0.0, &wood);
    }
    let cloth = Stock::one(&mut stock.chance, &stock.cloths);
    let roof = Transform::from_translation(at(0.8, 2.5, 0.0)).with_rotation(Quat::from_rotation_z(side * 0.16));
    build.place(Cuboid::new(2.4, 0.03, 2.6), roof, &cloth);
    let glow = Stock::one(&mut stock.chance, &stock.glows);
    build.block(at(-0.35, 1.98, 0.0), Vec3::new(0.03, 0.22, 1.4), 0.0, &glow);
    goods(build, stock, side, z);
    for along in [-0.7, 0.7] {
        bulb(build, stock, at(0.5, 2.15, along));
    }
    let night_light = PointLight {
        color: Color::linear_rgb(1.0, 0.7, 0.4),
        intensity: 150.0,
        range: 2.5,
        shadow_maps_enabled: false,
        ..default()
    };
    build.commands.spawn((night_light, Transform::from_translation(at(1.4, 1.2, 0.0))));
}

/// In two rows on the counter, with a candle at each end.
fn goods(build: &mut Builder, stock: &mut Stock, side: f32, z: f32) {
    let put = |build: &mut Builder, mesh: &Handle<Mesh>, paint: Handle<StandardMaterial>, at: Vec3, size: Vec3| {
        let place = Transform::from_translation(at).with_scale(size);
        build.commands.spawn((Mesh3d(mesh.clone()), MeshMaterial3d(paint), place));
    };
    for row in 0..2 {
        let out = side * (AISLE + 0.2 + 0.3 * row as f32);
        for place in 0..6 {
            let at = Vec3::new(out, 0.85, z + 0.32 * (place as f32 - 2.5));
            let paint = Stock::one(&mut stock.chance, &stock.goods);
            if stock.chance.next() < 0.5 {
                let radius = stock.chance.between(0.07, 0.12);
                put(build, &stock.ball, paint, at + Vec3::Y * radius, Vec3::splat(radius));
            } else {
                let size = Vec3::new(0.2, stock.chance.between(0.08, 0.25), 0.22);
                put(build, &stock.cube, paint, at + Vec3::Y * 0.5 * size.y, size);
            }
        }
    }
    for along in [-1.05, 1.05] {
        let flame = stock.flame.clone();
        put(build, &stock.ball, flame, Vec3::new(side * (AISLE + 0.35), 0.95, z + along), Vec3::new(0.02, 0.05, 0.02));
    }
}

/// Shines down. What is seen of it stands for the light and neither blocks nor adds to it.
fn bulb(build: &mut Builder, stock: &Stock, at: Vec3) {
    let seen = (Mesh3d(stock.ball.clone()), MeshMaterial3d(stock.flame.clone()));
    let place = Transform::from_translation(at + Vec3::Y * 0.05).with_scale(Vec3::splat(0.04));
    build.commands.spawn((seen, place, NotShadowCaster, VoxelizedMesh::OFF));
    let light = SpotLight {
        color: Color::linear_rgb(1.0, 0.78, 0.5),
        intensity: 900.0,
        range: 5.0,
        inner_angle: 0.7,
        outer_angle: 1.1,
        shadow_maps_enabled: false,
        ..default()
    };
    build.commands.spawn((light, Transform::from_translation(at).looking_to(Vec3::NEG_Y, Vec3::Z)));
}

/// Across the alley, from house to house.
fn spawn_string(build: &mut Builder, stock: &mut Stock, z: f32) {
    let sag = stock.chance.between(0.5, 0.9);
    let phase = stock.chance.next() * TAU;
    let ends = Transform::from_xyz(0.0, 4.3, z);
    let lanterns: Vec<_> = (0..LANTERNS)
        .map(|lantern| {
            let along = 2.0 * (lantern as f32 + 0.5) / LANTERNS as f32 - 1.0;
            let at = Vec3::new(along * HOUSES, sag * (along * along - 1.0), 0.0);
            let size = stock.chance.between(0.07, 0.13) * Vec3::new(1.0, 1.25, 1.0);
            let glow = Stock::one(&mut stock.chance, &stock.glows);
            (Mesh3d(stock.ball.clone()), MeshMaterial3d(glow), Transform::from_translation(at).with_scale(size))
        })
        .collect();
    build.commands.spawn((Sways { phase }, ends, Visibility::default())).with_children(|string| {
        lanterns.into_iter().for_each(|lantern| {
            string.spawn(lantern);
        });
    });
}

fn sway(time: Res<Time>, mut strings: Query<(&Sways, &mut Transform)>) {
    let seconds = (time.elapsed_secs_f64() % 100.0) as f32;
    for (string, mut transform) in &mut strings {
        let angle = 0.12 * (0.6 * PI * seconds + string.phase).sin() + 0.05 * (1.1 * PI * seconds).sin();
        transform.rotation = Quat::from_rotation_x(angle);
    }
}
