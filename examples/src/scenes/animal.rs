//! An elephant that walks round a Cornell box, after the test scene of Bashford-Rogers et al. 2012.
//!
//! Skinned: the voxel grid must follow deformed vertices. Its pose depends on the time alone, however that was reached.

use std::f32::consts::{PI, TAU};

use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;

use super::animal_mesh::{self, JOINTS, joint, skeleton};
use super::{Builder, CornellBox};

/// The box without its blocks, and the animal.
pub struct AnimalPlugin;

/// Seconds a stride.
const STRIDE: f64 = 1.5;
/// Part of a stride that a foot is on the ground.
const STANCE: f32 = 0.65;
/// How far a leg swings to either side, radians.
const SWING: f32 = 0.3;
/// Radius of its round, metres.
const ROUND: f32 = 0.8;
/// Forward speed, m/s: feet on the ground stay where they are.
const SPEED: f64 = 0.48;
/// When each leg lifts, in strides: the lateral sequence in which elephants walk.
const LIFTS: [f32; 4] = [0.25, 0.75, 0.0, 0.5];

#[derive(Component)]
struct Animal;

#[derive(Component)]
struct JointIndex(usize);

impl Plugin for AnimalPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, walk);
    }
}

fn spawn(mut build: Builder, mut bindposes: ResMut<Assets<SkinnedMeshInverseBindposes>>) {
    CornellBox::spawn_walls(&mut build);
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
    let hide = build.paint([0.4, 0.37, 0.35]);
    let ivory = build.paint([0.75, 0.68, 0.52]);
    let black = build.paint([0.02, 0.02, 0.02]);
    let (skin, tusks) = animal_mesh::meshes();
    let joints = skeleton();
    let inverse = bindposes.add(joints.map(|joint| Mat4::from_translation(-joint.rest)).to_vec());
    let root = build.commands.spawn((Animal, Transform::default(), Visibility::default(), Name::new("elephant"))).id();
    let mut entities = Vec::with_capacity(JOINTS);
    for (index, joint) in joints.iter().enumerate() {
        let parent = joint.parent.map_or(root, |parent| entities[parent]);
        let transform = Transform::from_translation(rest(&joints, index));
        entities.push(build.commands.spawn((JointIndex(index), transform, ChildOf(parent))).id());
    }
    for (mesh, paint) in [(skin, &hide), (tusks, &ivory)] {
        let skinned = SkinnedMesh { inverse_bindposes: inverse.clone(), joints: entities.clone() };
        build.place(mesh, Transform::default(), paint).insert((skinned, NoFrustumCulling, ChildOf(root)));
    }
    for side in [1.0, -1.0] {
        let eye = Transform::from_xyz(0.2 * side, 0.13, 0.28);
        build.place(Sphere::new(0.03).mesh().uv(16, 10), eye, &black).insert(ChildOf(entities[joint::HEAD]));
    }
}

/// Where a joint is relative to its parent.
fn rest(joints: &[animal_mesh::Joint; JOINTS], index: usize) -> Vec3 {
    let joint = joints[index];
    joint.rest - joint.parent.map_or(Vec3::ZERO, |parent| joints[parent].rest)
}

fn walk(
    time: Res<Time>,
    mut animals: Query<&mut Transform, With<Animal>>,
    mut parts: Query<(&JointIndex, &mut Transform), Without<Animal>>,
) {
    let seconds = time.elapsed_secs_f64();
    let turn = ((seconds * SPEED / f64::from(ROUND)) % f64::from(TAU)) as f32;
    for mut transform in &mut animals {
        transform.translation = ROUND * Vec3::new(turn.sin(), 0.0, turn.cos());
        transform.rotation = Quat::from_rotation_y(turn + 0.5 * PI);
    }
    let strides = (seconds / STRIDE % 64.0) as f32;
    let joints = skeleton();
    for (index, mut transform) in &mut parts {
        let rest = rest(&joints, index.0);
        let bob = if index.0 == joint::SPINE { 0.012 * (2.0 * TAU * strides).cos() } else { 0.0 };
        transform.translation = rest + Vec3::Y * bob;
        transform.rotation = pose(index.0, strides);
    }
}

/// Rotation of a joint after so many strides.
fn pose(index: usize, strides: f32) -> Quat {
    let wave = |rate: f32, shift: f32| (TAU * (rate * strides + shift)).sin();
    match index {
        joint::SPINE => Quat::from_rotation_z(0.025 * wave(1.0, 0.0)) * Quat::from_rotation_x(0.012 * wave(2.0, 0.2)),
        joint::HEAD => Quat::from_rotation_x(0.06 * wave(2.0, 0.0)) * Quat::from_rotation_y(0.12 * wave(0.25, 0.1)),
        joint::TRUNK..joint::EARS => {
            let along = (index - joint::TRUNK) as f32;
            Quat::from_rotation_x(-0.12 + 0.2 * wave(0.5, -0.12 * along))
                * Quat::from_rotation_z(0.14 * wave(1.0, -0.15 * along))
        }
        joint::EARS..joint::TAIL => {
            let side = if index == joint::EARS { 1.0 } else { -1.0 };
            Quat::from_rotation_y(side * (0.15 + 0.3 * wave(0.5, 0.0)))
        }
        joint::TAIL => Quat::from_rotation_z(0.3 * wave(1.0, 0.3)) * Quat::from_rotation_x(0.1 * wave(0.5, 0.0)),
        _ => {
            let leg = (index - joint::LEGS) / 2;
            let (swing, bend) = step(strides - LIFTS[leg]);
            let upper = (index - joint::LEGS).is_multiple_of(2);
            Quat::from_rotation_x(if upper { -SWING * swing } else { 0.75 * bend })
        }
    }
}

/// Swing of a leg, 1 forward to -1 back, and bend of its knee, 0 to 1. A stride begins as the foot lifts.
fn step(strides: f32) -> (f32, f32) {
    let phase = strides.rem_euclid(1.0);
    if phase < 1.0 - STANCE {
        let lifted = phase / (1.0 - STANCE);
        (-(PI * lifted).cos(), (PI * lifted).sin())
    } else {
        (1.0 - 2.0 * (phase - (1.0 - STANCE)) / STANCE, 0.0)
    }
}
