//! A corridor without a lamp beside three lit rooms, whose doors swing open one after the other and shut again.

use std::f32::consts::PI;

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_bounce::{GlobalIllumination, VoxelizedMesh};

use super::{Builder, Walls};

/// Corridor, rooms, doors and a lamp in each room.
pub struct DoorsPlugin;

/// A leaf on its hinges: opens as its turn comes.
#[derive(Component, Clone, Copy, Debug)]
pub struct Door {
    /// 0 to 2, in the order in which they open.
    turn: u8,
}

/// All of it, 12 m by 6.6 m: rooms at -z, the corridor at +z of the wall at 0.
const MIN: Vec3 = Vec3::new(-6.0, 0.0, -4.2);
const MAX: Vec3 = Vec3::new(6.0, 2.7, 2.4);
/// Middle of the doors and of their rooms, metres along x.
const ROOMS: [f32; 3] = [-4.0, 0.0, 4.0];
/// Width and height of a door, thickness of its leaf and of the walls, metres.
const WIDTH: f32 = 1.0;
const LINTEL: f32 = 2.1;
const LEAF: f32 = 0.05;
const WALL: f32 = 0.2;
/// Walls and leaves are hardly thicker than voxels: what light ends up within them is not to shine out.
const SOLID: VoxelizedMesh = VoxelizedMesh { enabled: true, albedo: None, two_sided: Some(true) };
/// Seconds in which each door opens once; each is open for so many, one after the other.
const CYCLE: f32 = 16.0;
const OPEN: f32 = 6.0;
const NEXT: f32 = 4.0;
/// The first picture shows an open door.
const BEGIN: f32 = 3.0;

impl Door {
    /// How far it is open after that many seconds, radians.
    fn angle(self, seconds: f32) -> f32 {
        let since = (seconds + BEGIN).rem_euclid(CYCLE) - NEXT * f32::from(self.turn);
        1.75 * (1.2 * (PI * (since / OPEN).clamp(0.0, 1.0)).sin()).min(1.0)
    }
}

impl DoorsPlugin {
    /// After so many seconds all doors are shut.
    pub const SHUT: f32 = 0.5 * (CYCLE + 2.0 * NEXT + OPEN) - BEGIN;
    /// After so many seconds all begins anew.
    pub const CYCLE: f32 = CYCLE;
}

impl Plugin for DoorsPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, swing);
    }
}

fn spawn(mut build: Builder) {
    let white = build.paint([0.75, 0.74, 0.71]);
    let wood = build.paint([0.4, 0.24, 0.12]);
    let colors = [[0.65, 0.1, 0.06], [0.12, 0.45, 0.14], [0.1, 0.22, 0.6]].map(|albedo| build.paint(albedo));
    let walls = Walls {
        floor: build.paint([0.42, 0.36, 0.3]),
        ceiling: white.clone(),
        back: white.clone(),
        front: white.clone(),
        left: white.clone(),
        right: build.paint([0.7, 0.5, 0.2]),
    };
    build.room(MIN, MAX, &walls);
    for x in [-2.0, 2.0] {
        build
            .block(Vec3::new(x, 0.0, 0.5 * (MIN.z - WALL)), Vec3::new(WALL, MAX.y, -MIN.z - WALL), 0.0, &white)
            .insert(SOLID);
    }
    wall_with_doors(&mut build, &white);
    for ((turn, x), color) in (0..).zip(ROOMS).zip(&colors) {
        door(&mut build, x, Door { turn }, &wood);
        room(&mut build, x, color, &white);
    }
    build.block(Vec3::new(1.5, 0.0, 2.1), Vec3::new(1.8, 0.45, 0.45), 0.0, &wood);
    build.place(Sphere::new(0.3).mesh().uv(32, 16), Transform::from_xyz(-2.2, 0.3, 1.9), &white);
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 6.0 },
        Projection::Perspective(PerspectiveProjection { fov: 0.95, ..default() }),
        Transform::from_xyz(-5.7, 1.6, 2.0).looking_at(Vec3::new(0.0, 1.1, 0.4), Vec3::Y),
    ));
}

/// Between the corridor and the rooms: what stands between the doors, and what lies over them.
fn wall_with_doors(build: &mut Builder, paint: &Handle<StandardMaterial>) {
    let mut piece = |from: f32, to: f32, bottom: f32| {
        let base = Vec3::new(0.5 * (from + to), bottom, -0.5 * WALL);
        build.block(base, Vec3::new(to - from, MAX.y - bottom, WALL), 0.0, paint).insert(SOLID);
    };
    let mut from = MIN.x;
    for x in ROOMS {
        piece(from, x - 0.5 * WIDTH, 0.0);
        piece(x - 0.5 * WIDTH, x + 0.5 * WIDTH, LINTEL);
        from = x + 0.5 * WIDTH;
    }
    piece(from, MAX.x, 0.0);
}

/// A leaf that turns into the corridor about hinges at -x.
fn door(build: &mut Builder, x: f32, door: Door, paint: &Handle<StandardMaterial>) {
    let leaf = build.meshes.add(Cuboid::new(WIDTH, LINTEL, LEAF));
    let knob = build.meshes.add(Sphere::new(0.04).mesh().uv(12, 8));
    let hinge = Transform::from_xyz(x - 0.5 * WIDTH, 0.0, -0.5 * LEAF);
    build.commands.spawn((door, hinge, Visibility::default())).with_children(|hinge| {
        let at = Transform::from_xyz(0.5 * WIDTH, 0.5 * LINTEL, 0.0);
        hinge.spawn((Mesh3d(leaf), MeshMaterial3d(paint.clone()), at, SOLID));
        let at = Transform::from_xyz(0.92 * WIDTH, 1.05, LEAF);
        hinge.spawn((Mesh3d(knob), MeshMaterial3d(paint.clone()), at));
    });
}

/// A lamp, a wall and a carpet in the room's colour, a table.
fn room(build: &mut Builder, x: f32, color: &Handle<StandardMaterial>, white: &Handle<StandardMaterial>) {
    build.block(Vec3::new(x, 0.0, MIN.z + 0.05), Vec3::new(3.8, MAX.y, 0.1), 0.0, color);
    build.block(Vec3::new(x, 0.0, -1.6), Vec3::new(2.0, 0.02, 2.4), 0.0, color);
    build.block(Vec3::new(x + 1.0, 0.0, -3.2), Vec3::new(0.9, 0.75, 0.9), 0.3, white);
    build.commands.spawn((
        PointLight { intensity: 15_000.0, range: 20.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(x, 2.3, -2.0),
    ));
}

fn swing(time: Res<Time>, mut doors: Query<(&Door, &mut Transform)>) {
    for (door, mut hinge) in &mut doors {
        hinge.rotation = Quat::from_rotation_y(-door.angle(time.elapsed_secs()));
    }
}
