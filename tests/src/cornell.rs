//! Light in the Cornell box by path tracing: what is compared with does not come from what is tested.

use bevy::math::{Quat, UVec2, Vec2, Vec3};
use bevy::transform::components::Transform;
use bevy_bounce_examples::scenes::CornellBox;

use crate::twins::random::Random;

/// Where a ray meets the box.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Along the ray, in its lengths.
    pub t: f32,
    /// Towards where the ray comes from.
    pub normal: Vec3,
    /// A wall, in the order of `PANELS`, or after them three sides of each block, by axis.
    pub surface: usize,
}

/// Sides of blocks follow the walls, three each.
const AXES: usize = 3;

/// The first surface on a ray. Walls are met from within alone.
pub fn hit(origin: Vec3, ray: Vec3) -> Option<Hit> {
    let mut found: Option<Hit> = None;
    let mut meet = |hit: Hit| {
        if hit.t > 0.0 && found.is_none_or(|found| hit.t < found.t) {
            found = Some(hit);
        }
    };
    for (surface, panel) in CornellBox::PANELS.iter().enumerate() {
        let normal = panel.u.cross(panel.v).normalize();
        let t = normal.dot(panel.corner - origin) / normal.dot(ray);
        let at = origin + ray * t - panel.corner;
        let inside = |edge: Vec3| (0.0..=1.0).contains(&(at.dot(edge) / edge.length_squared()));
        if normal.dot(ray) < 0.0 && inside(panel.u) && inside(panel.v) {
            meet(Hit { t, normal, surface });
        }
    }
    for (index, block) in CornellBox::BLOCKS.iter().enumerate() {
        let turn = Quat::from_rotation_y(2.0 * block.half_turn[0].atan2(block.half_turn[1]));
        let centre = block.base + Vec3::Y * block.size.y * 0.5;
        let (from, along) = (turn.inverse() * (origin - centre), turn.inverse() * ray);
        let (a, b) = ((-block.size * 0.5 - from) / along, (block.size * 0.5 - from) / along);
        let (near, far) = (a.min(b), a.max(b).min_element());
        let axis = near.max_position();
        if near[axis] < far {
            let side = Vec3::AXES[axis] * -along[axis].signum();
            let surface = CornellBox::PANELS.len() + AXES * index + axis;
            meet(Hit { t: near[axis], normal: turn * side, surface });
        }
    }
    found
}

fn albedo(surface: usize) -> Vec3 {
    let paint = CornellBox::PANELS.get(surface).map(|panel| panel.surface);
    paint.unwrap_or(bevy_bounce_examples::scenes::Surface::White).albedo().into()
}

/// Irradiance from the lamp, lux: Bevy's spot light, whose square falls off between its angles.
fn lamp(at: Vec3, normal: Vec3) -> f32 {
    let to_lamp = CornellBox::LAMP - at;
    let (distance, direction) = (to_lamp.length(), to_lamp.normalize());
    let cosine = normal.dot(direction);
    let [inner, outer] = CornellBox::LAMP_CONE.map(f32::cos);
    let cone = ((direction.y - outer) / (inner - outer)).clamp(0.0, 1.0).powi(2);
    if cosine <= 0.0 || cone == 0.0 {
        return 0.0;
    }
    let blocked = hit(at + normal * 1e-4, direction).is_some_and(|hit| hit.t < distance - 1e-3);
    if blocked { 0.0 } else { CornellBox::LAMP_CANDELA * cone * cosine / (distance * distance) }
}

/// Bounced radiance that comes from there, cd/m^2: one path of as many bounces as count.
fn radiance(mut origin: Vec3, mut ray: Vec3, random: &mut Random) -> Vec3 {
    let (mut light, mut weight) = (Vec3::ZERO, Vec3::ONE);
    for _ in 0..16 {
        let Some(met) = hit(origin, ray) else { break };
        origin += ray * met.t + met.normal * 1e-4;
        weight *= albedo(met.surface);
        light += weight * lamp(origin, met.normal) / std::f32::consts::PI;
        // Cosine-distributed: the normal and a point of the unit sphere.
        ray = (met.normal + random.direction() * 0.999).normalize();
    }
    light
}

/// A direction by the phase function of Henyey and Greenstein about another; its cosine by the inverse of the
/// cumulative distribution (Pharr et al., "Physically Based Rendering", 11.3).
fn henyey_greenstein(about: Vec3, g: f32, random: &mut Random) -> Vec3 {
    let u = random.unit();
    let cosine = if g == 0.0 {
        1.0 - 2.0 * u
    } else {
        let ratio = (1.0 - g * g) / (1.0 - g + 2.0 * g * u);
        ((1.0 + g * g - ratio * ratio) / (2.0 * g)).clamp(-1.0, 1.0)
    };
    let (right, up) = about.any_orthonormal_pair();
    let around = Vec2::from_angle(std::f32::consts::TAU * random.unit()) * (1.0 - cosine * cosine).sqrt();
    right * around.x + up * around.y + about * cosine
}

/// Mean of the bounced radiance from all directions at a point in the air, weighted by the phase function of Henyey and Greenstein for
/// light that goes on against `view`.
pub fn scattered(at: Vec3, view: Vec3, asymmetry: f32, paths: u32, random: &mut Random) -> Vec3 {
    let mut sum = Vec3::ZERO;
    for _ in 0..paths {
        let direction = henyey_greenstein(view, asymmetry, random);
        sum += radiance(at, direction, random);
    }
    sum / paths as f32
}

/// A point in the air, and the pixel that shows it.
#[derive(Clone, Copy, Debug)]
pub struct PointInAir {
    /// World space.
    pub at: Vec3,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
}

/// Metres from points in the air to surfaces.
const CLEARANCE: f32 = 0.25;
/// Metres from the eye, along its axis.
const NEAREST: f32 = 1.0;
/// Edge of what is put there to be looked at, metres.
pub const PIECE: f32 = 0.2;
/// Pixels between them, in the longer direction.
const APART: f32 = 6.0;

/// Fifty points in the air of the box that an eye of that vertical field of view sees in a picture of that size, none behind another's
/// [`PIECE`].
pub fn points_in_air(eye: &Transform, field_of_view: f32, size: UVec2) -> Vec<PointInAir> {
    let mut random = Random::new(5);
    let mut points: Vec<(PointInAir, f32)> = Vec::new();
    let scale = 0.5 * size.y as f32 / (0.5 * field_of_view).tan();
    let view_from_world = eye.to_matrix().inverse();
    while points.len() < 50 {
        let at = Vec3::Y * 2.0 + random.vector() * 1.6;
        let clear = (0..64).all(|_| hit(at, random.direction()).is_none_or(|hit| hit.t > CLEARANCE));
        let seen = hit(eye.translation, at - eye.translation).is_none_or(|hit| hit.t > 1.0);
        let view = view_from_world.transform_point3(at);
        let pixel = Vec2::new(view.x, -view.y) * (scale / -view.z) + 0.5 * size.as_vec2();
        let inside = -view.z > NEAREST && pixel.cmpge(Vec2::ZERO).all() && pixel.cmplt(size.as_vec2()).all();
        if !clear || !seen || !inside {
            continue;
        }
        let (point, wide) = (PointInAir { at, x: pixel.x as usize, y: pixel.y as usize }, PIECE * scale / -view.z);
        let apart = |(other, others): &(PointInAir, f32)| {
            let pixels = point.x.abs_diff(other.x).max(point.y.abs_diff(other.y)) as f32;
            pixels > APART.max(wide).max(*others)
        };
        if points.iter().all(apart) {
            points.push((point, wide));
        }
    }
    points.into_iter().map(|(point, _)| point).collect()
}
