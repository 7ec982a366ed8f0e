//! What maps without an error but the width of their texels say.

use bevy::math::Vec2;
use bevy_bounce_shaders::types::Vpl;

use super::Pair;
use super::rays::Rays;
use crate::shadow_atlas::{from_tile, tile_frame};

/// What a light sees of a pixel by a map of `tile`^2 texels, each of which knows exactly what a ray through its middle meets: twin of
/// `shadow_atlas/lookup.wgsl`, without what is rounded there. `near`: from the light's surface to where rays begin.
pub fn sees_by_ideal_map(rays: &Rays, vpl: &Vpl, pair: &Pair, near: f32, tile: u32) -> bool {
    let frame = tile_frame(vpl.normal);
    let from = vpl.position + vpl.normal * near;
    let to = pair.position - from;
    let direction = frame.map(|axis| axis.dot(to));
    let p = Vec2::new(direction[0], direction[1])
        / (direction[0].abs() + direction[1].abs() + direction[2].max(0.0)).max(1e-30);
    let place = Vec2::new(p.x + p.y, p.x - p.y) * 0.5 + 0.5;
    let edge = tile as f32;
    let texel = (place * edge).floor().clamp(Vec2::ZERO, Vec2::splat(edge - 1.0));
    let middle = from_tile((texel + 0.5) / edge).normalize();
    let middle = frame[0] * middle.x + frame[1] * middle.y + frame[2] * middle.z;
    let Some((depth, [a, b, c])) = rays.cast(from, middle, 0.0, f32::MAX) else { return true };
    let normal = (b - a).cross(c - a).normalize();
    let normal = normal * -normal.dot(middle).signum();
    let off = to - middle * depth;
    let rounding = 1e-5 * to.length();
    let is_behind = normal.dot(off) < -(SLACK * off.length() + rounding);
    !(is_behind && pair.normal.dot(off) < -rounding && depth < to.length())
}

/// Twin of the constant in `shadow_atlas/lookup.wgsl`.
const SLACK: f32 = 0.03;
