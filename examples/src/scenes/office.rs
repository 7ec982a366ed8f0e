//! A furnished office at night; its one lamp travels along the ceiling and swings.

use bevy::camera::Exposure;
use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_bounce::{GlobalIllumination, VoxelizedMesh};

use super::chance::Chance;
use super::{Builder, Walls};

/// The office, its furniture and its lamp.
pub struct OfficePlugin;

/// Room: 7 m wide, 3 m high, 5 m deep.
const MIN: Vec3 = Vec3::new(-3.5, 0.0, -2.5);
const MAX: Vec3 = Vec3::new(3.5, 3.0, 2.5);
/// How far below the ceiling the lamp hangs, metres.
const CORD: f32 = 0.9;

#[derive(Component)]
struct Lamp;

impl Plugin for OfficePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, swing);
    }
}

/// Linear albedos.
struct Paints {
    white: Handle<StandardMaterial>,
    wood: Handle<StandardMaterial>,
    dark: Handle<StandardMaterial>,
    steel: Handle<StandardMaterial>,
    red: Handle<StandardMaterial>,
    green: Handle<StandardMaterial>,
}

fn spawn(mut build: Builder) {
    let paints = Paints {
        white: build.paint([0.78, 0.77, 0.74]),
        wood: build.paint([0.42, 0.25, 0.12]),
        dark: build.paint([0.05, 0.05, 0.06]),
        steel: build.paint([0.35, 0.36, 0.38]),
        red: build.paint([0.55, 0.08, 0.06]),
        green: build.paint([0.1, 0.32, 0.12]),
    };
    let walls = Walls {
        floor: build.paint([0.38, 0.3, 0.22]),
        ceiling: paints.white.clone(),
        back: paints.white.clone(),
        front: paints.white.clone(),
        left: build.paint([0.16, 0.38, 0.45]),
        right: build.paint([0.7, 0.45, 0.14]),
    };
    build.room(MIN, MAX, &walls);
    build.block(Vec3::new(0.0, 0.0, 0.0), Vec3::new(3.2, 0.015, 2.2), 0.0, &paints.red);
    for (at, angle) in [(Vec3::new(-1.5, 0.0, -1.2), 0.05), (Vec3::new(1.1, 0.0, -1.4), -0.08)] {
        desk(&mut build, &paints, at, angle);
        chair(&mut build, &paints, at + Vec3::new(0.15, 0.0, 0.85), angle + 0.5);
    }
    chair(&mut build, &paints, Vec3::new(2.4, 0.0, 0.9), -2.2);
    shelf(&mut build, &paints, Vec3::new(-3.3, 0.0, 0.6));
    cabinet(&mut build, &paints, Vec3::new(3.1, 0.0, -1.6));
    plant(&mut build, &paints, Vec3::new(-2.9, 0.0, -2.0));
    picture(&mut build, &paints);
    lamp(&mut build, &paints);
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 5.5 },
        Projection::Perspective(PerspectiveProjection { fov: 0.95, ..default() }),
        Transform::from_xyz(1.4, 1.7, 2.4).looking_at(Vec3::new(-0.5, 0.9, -1.2), Vec3::Y),
    ));
}

/// A part of a piece of furniture that stands at `at`, turned by `angle`.
fn part(build: &mut Builder, at: Vec3, angle: f32, base: Vec3, size: Vec3, paint: &Handle<StandardMaterial>) {
    build.block(at + Quat::from_rotation_y(angle) * base, size, angle, paint);
}

fn desk(build: &mut Builder, paints: &Paints, at: Vec3, angle: f32) {
    let mut add = |base: [f32; 3], size: [f32; 3], paint| part(build, at, angle, base.into(), size.into(), paint);
    add([0.0, 0.71, 0.0], [1.6, 0.04, 0.8], &paints.wood);
    for (x, z) in [(-0.75, -0.35), (0.75, -0.35), (-0.75, 0.35), (0.75, 0.35)] {
        add([x, 0.0, z], [0.05, 0.71, 0.05], &paints.steel);
    }
    add([0.52, 0.2, 0.0], [0.4, 0.5, 0.7], &paints.white);
    add([0.0, 0.75, -0.2], [0.24, 0.02, 0.16], &paints.dark);
    add([0.0, 0.77, -0.22], [0.04, 0.12, 0.04], &paints.dark);
    add([0.0, 0.86, -0.2], [0.62, 0.36, 0.03], &paints.dark);
    add([0.0, 0.75, 0.12], [0.44, 0.02, 0.14], &paints.steel);
    add([-0.5, 0.75, 0.05], [0.21, 0.05, 0.3], &paints.white);
    add([-0.5, 0.8, 0.03], [0.18, 0.04, 0.25], &paints.red);
}

fn chair(build: &mut Builder, paints: &Paints, at: Vec3, angle: f32) {
    let mut add = |base: [f32; 3], size: [f32; 3], paint| part(build, at, angle, base.into(), size.into(), paint);
    add([0.0, 0.44, 0.0], [0.46, 0.06, 0.46], &paints.green);
    add([0.0, 0.62, 0.21], [0.44, 0.42, 0.05], &paints.green);
    for (x, z) in [(-0.19, -0.19), (0.19, -0.19), (-0.19, 0.19), (0.19, 0.19)] {
        add([x, 0.0, z], [0.04, 0.44, 0.04], &paints.steel);
    }
    for x in [-0.19, 0.19] {
        add([x, 0.5, 0.21], [0.03, 0.2, 0.03], &paints.steel);
    }
}

/// Boards against the left wall, with books of any colour and height.
fn shelf(build: &mut Builder, paints: &Paints, at: Vec3) {
    const WIDTH: f32 = 1.8;
    let covers: Vec<_> = [[0.5, 0.1, 0.08], [0.1, 0.2, 0.45], [0.6, 0.5, 0.2], [0.12, 0.35, 0.2], [0.65, 0.62, 0.55]]
        .map(|albedo| build.paint(albedo))
        .into();
    let mut chance = Chance(0x2545_f491);
    for side in [-0.5, 0.5] {
        build.block(at + Vec3::Z * WIDTH * side, Vec3::new(0.32, 2.1, 0.03), 0.0, &paints.wood);
    }
    for level in 0..6 {
        let base = at + Vec3::Y * (0.05 + 0.4 * level as f32);
        build.block(base, Vec3::new(0.32, 0.03, WIDTH), 0.0, &paints.wood);
        let mut z = -0.5 * WIDTH + 0.04;
        while level < 5 && z < 0.5 * WIDTH - 0.1 {
            let size =
                Vec3::new(0.17 + 0.06 * chance.next(), 0.2 + 0.13 * chance.next(), 0.025 + 0.035 * chance.next());
            let cover = (chance.next() * covers.len() as f32) as usize % covers.len();
            if chance.next() < 0.85 {
                build.block(base + Vec3::new(-0.03, 0.03, z + 0.5 * size.z), size, 0.0, &covers[cover]);
            }
            z += size.z + 0.004;
        }
    }
}

fn cabinet(build: &mut Builder, paints: &Paints, at: Vec3) {
    build.block(at, Vec3::new(0.7, 1.3, 1.1), 0.0, &paints.steel);
    for drawer in 0..4 {
        let base = at + Vec3::new(-0.36, 0.06 + 0.31 * drawer as f32, 0.0);
        build.block(base, Vec3::new(0.02, 0.27, 1.04), 0.0, &paints.white);
        build.block(base + Vec3::new(-0.02, 0.13, 0.0), Vec3::new(0.02, 0.02, 0.2), 0.0, &paints.dark);
    }
    build.place(Cylinder::new(0.11, 0.28), Transform::from_translation(at + Vec3::new(0.0, 1.44, 0.2)), &paints.red);
}

fn plant(build: &mut Builder, paints: &Paints, at: Vec3) {
    build.place(Cylinder::new(0.22, 0.4), Transform::from_translation(at + Vec3::Y * 0.2), &paints.white);
    build.place(Cylinder::new(0.03, 0.7), Transform::from_translation(at + Vec3::Y * 0.7), &paints.wood);
    let mut chance = Chance(0x9e37_79b9);
    for leaf in 0..14 {
        let turn = leaf as f32 * 2.4;
        let (reach, height) = (0.12 + 0.22 * chance.next(), 0.75 + 0.6 * chance.next());
        let place = at + Vec3::new(reach * turn.cos(), height, reach * turn.sin());
        let transform = Transform::from_translation(place)
            .with_rotation(Quat::from_rotation_y(-turn) * Quat::from_rotation_z(0.6))
            .with_scale(Vec3::new(1.0, 0.25, 0.6));
        build.place(Sphere::new(0.17).mesh().uv(16, 10), transform, &paints.green);
    }
}

fn picture(build: &mut Builder, paints: &Paints) {
    let back = Vec3::new(-0.3, 1.5, MIN.z + 0.02);
    build.block(back, Vec3::new(1.3, 0.9, 0.03), 0.0, &paints.dark);
    build.block(back + Vec3::new(0.0, 0.06, 0.02), Vec3::new(1.18, 0.78, 0.01), 0.0, &paints.white);
    build.block(back + Vec3::new(-0.2, 0.15, 0.03), Vec3::new(0.4, 0.5, 0.01), 0.0, &paints.red);
    build.block(back + Vec3::new(0.25, 0.25, 0.03), Vec3::new(0.35, 0.3, 0.01), 0.0, &paints.green);
}

/// Hangs below its entity: cord, shade, bulb and the light itself.
fn lamp(build: &mut Builder, paints: &Paints) {
    let bulb = build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        emissive: LinearRgba::rgb(2.0, 1.7, 1.2),
        ..default()
    });
    let shade = ConicalFrustum { radius_top: 0.06, radius_bottom: 0.24, height: 0.22 };
    let (cord, shade, ball) =
        (build.meshes.add(Cylinder::new(0.01, CORD)), build.meshes.add(shade), build.meshes.add(Sphere::new(0.05)));
    // Shade and bulb surround the light: they show, but neither block nor bounce it.
    let beside_light = (NotShadowCaster, VoxelizedMesh::OFF);
    build.commands.spawn((Lamp, Transform::default(), Visibility::default())).with_children(|lamp| {
        lamp.spawn((
            Mesh3d(cord),
            MeshMaterial3d(paints.dark.clone()),
            Transform::from_xyz(0.0, -0.5 * CORD, 0.0),
            beside_light.clone(),
        ));
        lamp.spawn((
            Mesh3d(shade),
            MeshMaterial3d(paints.steel.clone()),
            Transform::from_xyz(0.0, -CORD, 0.0),
            beside_light.clone(),
        ));
        lamp.spawn((
            Mesh3d(ball),
            MeshMaterial3d(bulb),
            Transform::from_xyz(0.0, -CORD - 0.11, 0.0),
            beside_light.clone(),
        ));
        lamp.spawn((
            SpotLight {
                color: Color::linear_rgb(1.0, 0.86, 0.66),
                intensity: 900.0 * 4.0 * std::f32::consts::PI,
                range: 50.0,
                inner_angle: 0.75,
                outer_angle: 0.95,
                shadow_maps_enabled: true,
                ..default()
            },
            Transform::from_xyz(0.0, -CORD - 0.12, 0.0).looking_to(Vec3::NEG_Y, Vec3::Z),
        ));
    });
}

fn swing(time: Res<Time>, mut lamps: Query<&mut Transform, With<Lamp>>) {
    let phase = (time.elapsed_secs_f64() * 0.7) as f32;
    for mut transform in &mut lamps {
        transform.translation = Vec3::new(2.0 * (phase * 0.5).sin(), MAX.y, -0.3 + 0.7 * (phase * 0.5).cos());
        transform.rotation =
            Quat::from_rotation_z(0.35 * (phase * 3.1).sin()) * Quat::from_rotation_x(0.2 * phase.cos());
    }
}
