//! A statue in the Cornell box, after the Buddha of Novak et al. 2011: a closed mesh of bulges, folds and petals that nothing
//! lights but light that bounced.

use std::f32::consts::{PI, TAU};

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::{Builder, CornellBox};

/// The box, the statue, a lamp under it that points up.
pub struct BuddhaBoxPlugin;

impl Plugin for BuddhaBoxPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn);
    }
}

/// A part of the statue: a ball on its axis, stretched sideways, with folds round it. Metres.
struct Part {
    height: f32,
    radius: f32,
    /// Width over depth.
    width: f32,
    folds: f32,
    /// Depth of the folds, over the radius.
    depth: f32,
    /// Turns of the folds a metre.
    twist: f32,
}

const fn part(height: f32, radius: f32, width: f32, folds: f32, depth: f32, twist: f32) -> Part {
    Part { height, radius, width, folds, depth, twist }
}

/// Two rows of petals, crossed legs, belly, shoulders, neck, head, bun.
const PARTS: [Part; 8] = [
    part(0.16, 0.72, 1.0, 13.0, 0.12, 0.0),
    part(0.42, 0.62, 1.0, 11.0, 0.14, 0.0),
    part(0.72, 0.58, 1.35, 5.0, 0.06, 0.3),
    part(1.14, 0.44, 1.1, 17.0, 0.05, 0.7),
    part(1.5, 0.36, 1.4, 9.0, 0.06, 0.4),
    part(1.84, 0.16, 1.0, 3.0, 0.04, 0.0),
    part(2.08, 0.28, 1.0, 7.0, 0.05, 0.2),
    part(2.38, 0.13, 1.0, 9.0, 0.1, 1.0),
];
const TOP: f32 = 2.51;
const RINGS: u32 = 220;
const SIDES: u32 = 240;

impl Part {
    /// Distance of its surface from the axis.
    fn reach(&self, height: f32, angle: f32) -> f32 {
        let square = self.radius * self.radius - (height - self.height).powi(2);
        let (sin, cos) = angle.sin_cos();
        let stretch = 1.0 / (cos / self.width).hypot(sin);
        let fold = (0.5 * self.folds * (angle + TAU * self.twist * height)).cos().abs();
        square.max(0.0).sqrt() * stretch * (1.0 - self.depth * (1.0 - fold))
    }
}

/// Rings of points round an axis, closed by one at each end.
fn statue() -> Mesh {
    let ring = |i: u32| {
        let height = TOP * (0.5 - 0.5 * (PI * i as f32 / (RINGS + 1) as f32).cos());
        (0..SIDES).map(move |side| {
            let angle = TAU * side as f32 / SIDES as f32;
            let reach = PARTS.iter().map(|part| part.reach(height, angle)).fold(0.004, f32::max);
            [reach * angle.cos(), height, reach * angle.sin()]
        })
    };
    let mut positions = vec![[0.0, 0.0, 0.0]];
    positions.extend((1..=RINGS).flat_map(ring));
    positions.push([0.0, TOP, 0.0]);
    let point = |ring: u32, side: u32| 1 + (ring - 1) * SIDES + side % SIDES;
    let last = 1 + RINGS * SIDES;
    let mut indices = Vec::new();
    for side in 0..SIDES {
        indices.extend([0, point(1, side), point(1, side + 1)]);
        for ring in 1..RINGS {
            let [a, b] = [point(ring, side), point(ring, side + 1)];
            let [c, d] = [point(ring + 1, side), point(ring + 1, side + 1)];
            indices.extend([a, c, b, b, c, d]);
        }
        indices.extend([point(RINGS, side), last, point(RINGS, side + 1)]);
    }
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U32(indices))
        .with_computed_smooth_normals()
}

fn spawn(mut build: Builder) {
    CornellBox::spawn_walls(&mut build);
    let stone = build.paint([0.75, 0.72, 0.66]);
    build.place(statue(), Transform::from_xyz(0.0, 0.0, -0.2), &stone).insert(Name::new("statue"));
    build.commands.spawn((
        SpotLight {
            intensity: 20_000.0 * 4.0 * PI,
            range: 100.0,
            inner_angle: 0.45,
            outer_angle: 0.6,
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(0.0, 0.8, 1.5).looking_to(Vec3::Y, Vec3::Z),
    ));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 6.8 },
        Projection::Perspective(PerspectiveProjection { fov: CornellBox::FIELD_OF_VIEW, ..default() }),
        Transform::from_translation(CornellBox::EYE),
    ));
}
