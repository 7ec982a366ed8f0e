//! An elephant that walks round a Cornell box, after the test scene of Bashford-Rogers et al. 2012.
//!
//! Skinned: the voxel grid must follow deformed vertices. Its pose depends on the time alone, however that was reached.

use std::f32::consts::{PI, TAU};

use bevy::camera::visibility::NoFrustumCulling;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;

use super::animal_mesh::{self, Detail, JOINTS, joint, skeleton};
use super::{Builder, CornellBox};

/// The box without its blocks, and the animal.
pub struct AnimalPlugin;

/// Lets animals of a [`Herd`] walk.
pub struct WalkPlugin;

/// What animals share.
pub struct Herd {
    skin: Handle<Mesh>,
    tusks: Handle<Mesh>,
    eye: Handle<Mesh>,
    ivory: Handle<StandardMaterial>,
    black: Handle<StandardMaterial>,
    inverse_bindposes: Handle<SkinnedMeshInverseBindposes>,
}

/// How an animal walks round the origin.
#[derive(Component, Clone, Copy, Debug)]
pub struct Walk {
    /// Radius of its round, metres.
    pub radius: f32,
    /// Where it starts, radians from +z on towards +x.
    pub start: f32,
    /// The other way round.
    pub reversed: bool,
    /// Its size; a grown one has 1. Small ones take more steps on the same way.
    pub size: f32,
}

/// Seconds a stride of a grown one.
const STRIDE: f64 = 1.5;
/// Part of a stride that a foot is on the ground.
const STANCE: f32 = 0.65;
/// How far a leg swings to either side, radians.
const SWING: f32 = 0.3;
/// Forward speed, m/s: feet on the ground stay where they are.
const SPEED: f64 = 0.48;
/// When each leg lifts, in strides: the lateral sequence in which elephants walk.
const LIFTS: [f32; 4] = [0.25, 0.75, 0.0, 0.5];

#[derive(Component)]
struct JointIndex(usize);

impl Plugin for AnimalPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(WalkPlugin).add_systems(Startup, spawn);
    }
}

impl Plugin for WalkPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Update, walk);
    }
}

fn spawn(mut build: Builder, mut bindposes: ResMut<Assets<SkinnedMeshInverseBindposes>>) {
    CornellBox::spawn_walls(&mut build);
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
    let hide = build.paint([0.4, 0.37, 0.35]);
    let herd = Herd::new(&mut build, &mut bindposes, Detail::FINE);
    herd.spawn(&mut build, Walk { radius: 0.8, start: 0.0, reversed: false, size: 1.0 }, &hide);
}

impl Herd {
    /// Nobody yet.
    pub fn new(build: &mut Builder, bindposes: &mut Assets<SkinnedMeshInverseBindposes>, detail: Detail) -> Self {
        let (skin, tusks) = animal_mesh::meshes(detail);
        let inverse = skeleton().map(|joint| Mat4::from_translation(-joint.rest));
        Self {
            skin: build.meshes.add(skin),
            tusks: build.meshes.add(tusks),
            eye: build.meshes.add(Sphere::new(0.03).mesh().uv(16, 10)),
            ivory: build.paint([0.75, 0.68, 0.52]),
            black: build.paint([0.02, 0.02, 0.02]),
            inverse_bindposes: bindposes.add(inverse.to_vec()),
        }
    }

    /// One more.
    pub fn spawn(&self, build: &mut Builder, walk: Walk, hide: &Handle<StandardMaterial>) {
        let joints = skeleton();
        let name = Name::new("elephant");
        let root = build.commands.spawn((walk, Transform::default(), Visibility::default(), name)).id();
        let mut entities = Vec::with_capacity(JOINTS);
        for (index, joint) in joints.iter().enumerate() {
            let parent = joint.parent.map_or(root, |parent| entities[parent]);
            let transform = Transform::from_translation(rest(&joints, index));
            let joint = (JointIndex(index), walk, transform, Visibility::default(), ChildOf(parent));
            entities.push(build.commands.spawn(joint).id());
        }
        for (mesh, paint) in [(&self.skin, hide), (&self.tusks, &self.ivory)] {
            let skinned = SkinnedMesh { inverse_bindposes: self.inverse_bindposes.clone(), joints: entities.clone() };
            let look = (Mesh3d(mesh.clone()), MeshMaterial3d(paint.clone()));
            build.commands.spawn((look, skinned, NoFrustumCulling, ChildOf(root)));
        }
        for side in [1.0, -1.0] {
            let look = (Mesh3d(self.eye.clone()), MeshMaterial3d(self.black.clone()));
            build.commands.spawn((look, Transform::from_xyz(0.2 * side, 0.13, 0.28), ChildOf(entities[joint::HEAD])));
        }
    }
}

/// Where a joint is relative to its parent.
fn rest(joints: &[animal_mesh::Joint; JOINTS], index: usize) -> Vec3 {
    let joint = joints[index];
    joint.rest - joint.parent.map_or(Vec3::ZERO, |parent| joints[parent].rest)
}

impl Walk {
    /// Where it is by then.
    fn place(&self, seconds: f64) -> Transform {
        let sense = if self.reversed { -1.0 } else { 1.0 };
        let turn = self.start + sense * ((seconds * SPEED / f64::from(self.radius)) % f64::from(TAU)) as f32;
        Transform::from_translation(self.radius * Vec3::new(turn.sin(), 0.0, turn.cos()))
            .with_rotation(Quat::from_rotation_y(turn + sense * 0.5 * PI))
            .with_scale(Vec3::splat(self.size))
    }

    /// Strides by then; who starts elsewhere is elsewhere in its stride.
    fn strides(&self, seconds: f64) -> f32 {
        self.start + (seconds / (STRIDE * f64::from(self.size)) % 64.0) as f32
    }
}

fn walk(
    time: Res<Time>,
    mut animals: Query<(&Walk, &mut Transform), Without<JointIndex>>,
    mut parts: Query<(&JointIndex, &Walk, &mut Transform)>,
) {
    let seconds = time.elapsed_secs_f64();
    for (walk, mut transform) in &mut animals {
        *transform = walk.place(seconds);
    }
    let joints = skeleton();
    for (index, walk, mut transform) in &mut parts {
        let strides = walk.strides(seconds);
        let bob = if index.0 == joint::SPINE { 0.012 * (2.0 * TAU * strides).cos() } else { 0.0 };
        transform.translation = rest(&joints, index.0) + Vec3::Y * bob;
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
