//! Twin of `ssbc/near.wgsl`.

use bevy::math::{IVec2, Vec2, Vec3};

use super::ssbc::{GBuffer, Lens};

const ONE_PLANE: f32 = 0.95;
const SLACK: f32 = 0.05;
const STRIP: f32 = 2.0;
const MOST_STRIPS: f32 = 8.0;
/// Cosine of 87 degrees.
const GRAZING: f32 = 0.052335956;

/// Twin of `grazing_decay` in `ssbc/common.wgsl`.
pub fn grazing_decay(cosine: f32) -> f32 {
    (cosine / GRAZING).clamp(0.0, 1.0).powi(2)
}

fn extent(gbuffer: &GBuffer, (position, normal, footprint): (Vec3, Vec3, f32), neighbor: IVec2) -> f32 {
    let neighbor = neighbor.clamp(IVec2::ZERO, gbuffer.size.as_ivec2() - 1);
    let rises = gbuffer.surface_at(neighbor.as_uvec2()).is_some_and(|(next, next_normal, _)| {
        normal.dot(next - position) > -SLACK * footprint && normal.dot(next_normal) < ONE_PLANE
    });
    if rises { 1.0 } else { 0.5 }
}

fn edge_term(axis: Vec3, a: Vec3, b: Vec3) -> f32 {
    let across = a.cross(b);
    across.length().atan2(a.dot(b)) * axis.dot(across) / across.length().max(1e-20)
}

/// Irradiance, from radiance 1, at the origin of a surface of that normal, and area over its plane.
pub fn polygon_light(corners: [Vec3; 4], normal: Vec3) -> (f32, f32) {
    let mut above = Vec::new();
    for (a, b) in corners.into_iter().zip(corners.into_iter().cycle().skip(1)) {
        let heights = (normal.dot(a), normal.dot(b));
        if heights.0 >= 0.0 {
            above.push(a);
        }
        if (heights.0 < 0.0) != (heights.1 < 0.0) {
            above.push(a.lerp(b, heights.0 / (heights.0 - heights.1)));
        }
    }
    let edges = || above.iter().zip(above.iter().cycle().skip(1));
    let light: f32 = edges().map(|(a, b)| edge_term(normal, *a, *b)).sum();
    let area: Vec3 = edges().map(|(a, b)| a.cross(*b)).sum();
    (0.5 * light.abs(), 0.5 * area.length())
}

fn depth_of_plane(lens: &Lens, position: Vec3, normal: Vec3) -> Vec3 {
    let equation = normal.extend(-normal.dot(position));
    -Vec3::new(equation.dot(lens.x), equation.dot(lens.y), equation.dot(lens.origin)) / equation.dot(lens.depth)
}

/// Irradiance, of a pixel's radiance, from a pixel next to the receiver that is above the bound.
pub fn near_light(gbuffer: &GBuffer, (position, normal): (Vec3, Vec3), bound: f32, pixel: IVec2) -> f32 {
    let Some(surface) = gbuffer.surface_at(pixel.as_uvec2()) else { return 0.0 };
    let lens = &gbuffer.lens;
    let middle = pixel.as_vec2() + 0.5;
    let toward_eye = (lens.position(middle, 2.0 * gbuffer.depth(pixel.as_uvec2())).0 - surface.0).normalize();
    let cosine = surface.1.dot(toward_eye);
    if cosine <= 0.0 || normal.dot(surface.0 - position) <= 0.0 {
        return 0.0;
    }
    let plane = depth_of_plane(lens, surface.0, surface.1);
    let across = (plane - depth_of_plane(lens, position, normal)).abs();
    let step = if across.x > across.y { IVec2::X } else { IVec2::Y };
    let [low, high] = [-1, 1].map(|side| {
        let extent = extent(gbuffer, surface, pixel + side * step);
        middle + side as f32 * Vec2::splat(0.5).max(step.as_vec2() * extent)
    });
    let strips = (1.0 / (cosine * STRIP)).ceil().clamp(1.0, MOST_STRIPS);
    let along = if plane.x.abs() > plane.y.abs() { Vec2::X } else { Vec2::Y };
    let light_of = |strip: usize| {
        let end = |i: usize| low + (high - low) * along * (i as f32 / strips);
        let (low, high) = (end(strip), end(strip + 1) + (high - low) * (Vec2::ONE - along));
        let corners = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)]
            .map(|at| lens.position(at, plane.dot(at.extend(1.0)).max(1e-9)).0 - position);
        let (light, area) = polygon_light(corners, normal);
        (light - bound * area).max(0.0)
    };
    (0..strips as usize).map(light_of).sum()
}
