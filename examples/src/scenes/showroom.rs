//! A car-like body in a showroom: smooth panels, a grille of thin bars, wheels with spokes, several roughnesses, on a polished floor
//! under panels of light. The camera goes round it.

use std::f32::consts::{PI, TAU};

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::{Builder, Walls};

/// The room, its lights, the body and a camera on its way round.
pub struct ShowroomPlugin;

/// Seconds for a way round.
const ROUND: f32 = 24.0;
/// Half the length of the body, metres.
const LENGTH: f32 = 2.1;
const RINGS: u32 = 120;
const SIDES: u32 = 96;

#[derive(Component)]
struct Walker;

impl Plugin for ShowroomPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, walk);
    }
}

fn paint(build: &mut Builder, color: [f32; 3], metallic: f32, roughness: f32) -> Handle<StandardMaterial> {
    build.materials.add(StandardMaterial {
        base_color: Color::linear_rgb(color[0], color[1], color[2]),
        metallic,
        perceptual_roughness: roughness,
        ..default()
    })
}

/// 0 at `from` and before, 1 at `to` and after.
fn rise(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Half width, lowest and highest point of the body's section at that place of its length.
fn section(x: f32) -> [f32; 3] {
    let end = (1.0 - (x / LENGTH).powi(6)).max(0.0).sqrt();
    let cabin = rise(-1.0, -0.25, x) * (1.0 - rise(0.75, 1.9, x));
    let hood = 0.62 + 0.12 * rise(-LENGTH, -0.9, x) + 0.04 * rise(1.2, LENGTH, x);
    let bottom = 0.24 + 0.12 * (1.0 - end);
    [0.88 * end * (1.0 - 0.06 * (3.0 * x).cos()), bottom, (hood + 0.6 * cabin).max(bottom + 0.05) * (0.7 + 0.3 * end)]
}

/// A body from sections that are rounded boxes, narrower towards the roof.
fn body() -> Mesh {
    let point = |ring: u32, side: u32| {
        let x = -LENGTH * (PI * ring as f32 / RINGS as f32).cos();
        let [width, low, high] = section(x);
        let (sin, cos) = (TAU * side as f32 / SIDES as f32).sin_cos();
        let round = |v: f32| v.signum() * v.abs().powf(0.45);
        let up = 0.5 + 0.5 * round(sin);
        let roof = 1.0 - 0.28 * rise(0.75, 1.3, low + (high - low) * up);
        let crease = 1.0 + 0.025 * (-((up - 0.55) * 14.0).powi(2)).exp();
        [x, low + (high - low) * up, width * round(cos) * roof * crease]
    };
    let positions: Vec<[f32; 3]> = (0..=RINGS).flat_map(|ring| (0..SIDES).map(move |side| point(ring, side))).collect();
    let at = |ring: u32, side: u32| ring * SIDES + side % SIDES;
    let quads = (0..RINGS).flat_map(|ring| (0..SIDES).map(move |side| (ring, side)));
    let indices = quads.flat_map(|(ring, side)| {
        let [a, b] = [at(ring, side), at(ring, side + 1)];
        let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
        [a, c, b, b, c, d]
    });
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(indices.collect()))
        .with_computed_smooth_normals()
}

fn wheel(build: &mut Builder, at: Vec3, rubber: &Handle<StandardMaterial>, alloy: &Handle<StandardMaterial>) {
    let axis = Quat::from_rotation_x(PI / 2.0);
    build.place(Torus::new(0.24, 0.34), Transform::from_translation(at).with_rotation(axis), rubber);
    build.place(Cylinder::new(0.06, 0.16), Transform::from_translation(at).with_rotation(axis), alloy);
    for spoke in 0..10 {
        let angle = TAU * spoke as f32 / 10.0;
        let place = Transform::from_translation(at + Vec3::new(angle.cos(), angle.sin(), 0.0) * 0.14);
        build.place(Cuboid::new(0.2, 0.025, 0.1), place.with_rotation(Quat::from_rotation_z(angle)), alloy);
    }
}

fn car(build: &mut Builder) {
    let lacquer = paint(build, [0.65, 0.04, 0.03], 0.6, 0.25);
    let chrome = paint(build, [0.85, 0.86, 0.88], 1.0, 0.15);
    let alloy = paint(build, [0.75, 0.76, 0.78], 1.0, 0.35);
    let rubber = paint(build, [0.03, 0.03, 0.03], 0.0, 0.8);
    build.place(body(), Transform::IDENTITY, &lacquer).insert(Name::new("body"));
    for (x, z) in [(-1.3, 0.82), (1.3, 0.82), (-1.3, -0.82), (1.3, -0.82)] {
        wheel(build, Vec3::new(x, 0.34, z), &rubber, &alloy);
    }
    for bar in 0..14 {
        let z = 0.06 * (bar as f32 - 6.5);
        build.place(Cuboid::new(0.05, 0.2, 0.02), Transform::from_xyz(-2.08, 0.5, z), &chrome);
    }
    for side in [-1.0, 1.0] {
        build.place(Sphere::new(0.11), Transform::from_xyz(-1.98, 0.56, 0.62 * side), &chrome);
        build.place(
            Sphere::new(0.1),
            Transform::from_xyz(-0.6, 0.95, 0.98 * side).with_scale(Vec3::new(0.6, 0.7, 1.0)),
            &chrome,
        );
    }
}

fn spawn(mut build: Builder) {
    let white = build.paint([0.75, 0.75, 0.74]);
    let walls = Walls {
        floor: paint(&mut build, [0.12, 0.12, 0.13], 0.0, 0.3),
        ceiling: white.clone(),
        back: build.paint([0.2, 0.35, 0.6]),
        front: white.clone(),
        left: white,
        right: build.paint([0.75, 0.5, 0.2]),
    };
    build.room(Vec3::new(-6.0, 0.0, -5.0), Vec3::new(6.0, 4.0, 5.0), &walls);
    let panel = build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        emissive: LinearRgba::rgb(2500.0, 2400.0, 2200.0),
        emissive_exposure_weight: 1.0,
        ..default()
    });
    for x in [-2.5, 0.0, 2.5] {
        build.block(Vec3::new(x, 3.85, 0.0), Vec3::new(0.6, 0.05, 5.0), 0.0, &panel);
    }
    car(&mut build);
    build.commands.spawn((
        PointLight { intensity: 120_000.0, range: 60.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(-3.5, 3.4, 3.2),
    ));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 9.0 },
        Projection::Perspective(PerspectiveProjection { fov: 0.7, ..default() }),
        eye(0.0),
        Walker,
    ));
}

/// Where the camera is after that many seconds.
fn eye(seconds: f32) -> Transform {
    let angle = 2.4 + TAU * seconds / ROUND;
    Transform::from_xyz(4.8 * angle.cos(), 1.5, 4.4 * angle.sin()).looking_at(Vec3::new(0.0, 0.55, 0.0), Vec3::Y)
}

fn walk(time: Res<Time>, mut camera: Single<&mut Transform, With<Walker>>) {
    **camera = eye(time.elapsed_secs());
}
