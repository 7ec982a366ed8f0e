//! A plaza at noon with a herd of elephants, some grown, some small, each with a skeleton and a stride of its own.
//!
//! What the sun reaches sends its colour into the shade: under the arcade and between the animals all light has bounced.

use std::f32::consts::TAU;

use bevy::camera::Exposure;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::mesh::skinning::SkinnedMeshInverseBindposes;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::animal::{Herd, Walk, WalkPlugin};
use super::animal_mesh::Detail;
use super::chance::Chance;
use super::{Builder, Walls};

/// The plaza and 44 animals on rounds about its middle.
pub struct CrowdPlugin;

/// From the middle of the plaza to its walls, metres.
const HALF: f32 = 11.0;
const HEIGHT: f32 = 5.0;
/// Radius of each round, metres, and how many walk on it. Next to each other they walk in opposite directions.
const ROUNDS: [(f32, u32); 4] = [(2.2, 5), (4.0, 9), (5.8, 13), (7.6, 17)];

impl Plugin for CrowdPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(WalkPlugin).add_systems(Startup, spawn);
    }
}

fn spawn(mut build: Builder, mut bindposes: ResMut<Assets<SkinnedMeshInverseBindposes>>) {
    plaza(&mut build);
    herd(&mut build, &mut bindposes);
    build.commands.spawn((
        DirectionalLight { illuminance: 40_000.0, shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { maximum_distance: 40.0, ..default() }.build(),
        Transform::from_xyz(0.9, 1.1, -0.25).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    build.commands.spawn((
        Camera3d::default(),
        Camera { clear_color: ClearColorConfig::Custom(Color::srgb(0.45, 0.62, 0.85)), ..default() },
        GlobalIllumination::default(),
        Exposure { ev100: 12.5 },
        Projection::Perspective(PerspectiveProjection { fov: 0.9, ..default() }),
        Transform::from_xyz(7.5, 3.4, 9.5).looking_at(Vec3::new(-1.5, 0.8, -1.5), Vec3::Y),
    ));
}

/// Walls round a floor, an arcade along the far one, a ball on a plinth in the middle.
fn plaza(build: &mut Builder) {
    let stone = build.paint([0.55, 0.52, 0.47]);
    let plaster = build.paint([0.75, 0.73, 0.7]);
    let (near, far) = (Vec3::new(-HALF, 0.0, -HALF), Vec3::new(HALF, HEIGHT, HALF));
    let walls = Walls {
        floor: build.paint([0.5, 0.46, 0.4]),
        ceiling: plaster.clone(),
        back: build.paint([0.75, 0.5, 0.15]),
        front: plaster.clone(),
        left: build.paint([0.62, 0.13, 0.07]),
        right: build.paint([0.1, 0.28, 0.5]),
    };
    build.panel(near, Vec3::Z * 2.0 * HALF, Vec3::X * 2.0 * HALF, &walls.floor);
    let wall = |x: f32, z: f32, length: Vec3| (Vec3::new(x, 0.0, z), length + Vec3::Y * HEIGHT);
    let (along_x, along_z) = (Vec3::new(2.0 * HALF + 0.8, 0.0, 0.4), Vec3::new(0.4, 0.0, 2.0 * HALF));
    for ((base, size), paint) in [
        (wall(0.0, near.z - 0.2, along_x), &walls.back),
        (wall(0.0, far.z + 0.2, along_x), &walls.front),
        (wall(near.x - 0.2, 0.0, along_z), &walls.left),
        (wall(far.x + 0.2, 0.0, along_z), &walls.right),
    ] {
        build.block(base, size, 0.0, paint);
    }
    build.block(Vec3::new(0.0, 3.2, near.z + 1.1), Vec3::new(2.0 * HALF, 0.35, 2.2), 0.0, &stone);
    for column in -4..=4 {
        let at = Vec3::new(2.6 * column as f32, 1.6, near.z + 2.0);
        build.place(Cylinder::new(0.22, 3.2).mesh().resolution(16), Transform::from_translation(at), &stone);
    }
    build.block(Vec3::ZERO, Vec3::new(1.4, 0.9, 1.4), 0.0, &stone);
    build.place(Sphere::new(0.75).mesh().uv(32, 16), Transform::from_xyz(0.0, 1.6, 0.0), &plaster);
}

fn herd(build: &mut Builder, bindposes: &mut Assets<SkinnedMeshInverseBindposes>) {
    let hides = [
        [0.4, 0.37, 0.35],
        [0.28, 0.22, 0.18],
        [0.6, 0.57, 0.54],
        [0.7, 0.38, 0.06],
        [0.55, 0.06, 0.1],
        [0.06, 0.4, 0.38],
    ]
    .map(|albedo| build.paint(albedo));
    let herd = Herd::new(build, bindposes, Detail::COARSE);
    let mut chance = Chance(0x51f1_5e7d);
    for (round, (radius, count)) in ROUNDS.into_iter().enumerate() {
        for place in 0..count {
            let start = TAU * (place as f32 + chance.between(-0.1, 0.1)) / count as f32;
            let size = chance.between(0.5, 0.95);
            let hide = &hides[(chance.next() * hides.len() as f32) as usize];
            herd.spawn(build, Walk { radius, start, reversed: round % 2 == 1, size }, hide);
        }
    }
}
