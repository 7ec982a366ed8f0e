//! From charts to texels: what lies under each, by exact clipping.

use bevy_bounce_cssm::{Texel, octahedral};
use glam::{Vec2, Vec3};

use super::{Atlas, AtlasTexel, Charted};
use crate::{
    BakeError,
    scene::{Part, Scene},
};

/// A texel with less of the surface than this share shows none of it.
const LEAST_COVER: f32 = 1.0e-3;
/// Charts that cover more than this much of a texel overlap.
const MOST_COVER: f32 = 1.02;
/// Faces of a texel whose normals differ by less (cosine) are one plane.
const COPLANAR: f32 = 0.9999;

/// What lies under a texel so far.
#[derive(Clone, Copy, Default)]
struct Cover {
    /// Of the chart with the largest share: its triangle with the largest share and that share.
    triangle: u32,
    triangle_area: f32,
    chart: u32,
    chart_area: f32,
    /// All charts.
    area: f32,
    /// Of the chart: world area, first moment in the atlas, sum of colours by world area.
    world_area: f32,
    moment: Vec2,
    color: Vec3,
    flat: bool,
    normal: Vec3,
}

/// Fills the texels of all charts.
pub fn rasterize(scene: &Scene, charted: Charted) -> Result<Atlas, BakeError> {
    let size = charted.size;
    let mut cover = vec![Cover::default(); (size.x * size.y) as usize];
    let mut number = 0;
    for part in &scene.parts {
        for corners in &part.triangles {
            if let Some(uv) = charted.corners[number] {
                let triangle = Triangle::new(scene, part, *corners, uv, number as u32, charted.chart[number]);
                triangle.cover(&mut cover, &charted)?;
            }
            number += 1;
        }
    }
    let triangles: Vec<[Vec3; 3]> = scene.triangles().collect();
    let mut texels = Vec::new();
    for (index, cover) in cover.iter().enumerate() {
        if cover.chart_area >= LEAST_COVER {
            let cell = [index as u32 % size.x, index as u32 / size.x];
            texels.push(finish(cover, cell, &triangles, &charted));
        }
    }
    if texels.is_empty() {
        return Err(BakeError::Atlas(format!(
            "no chart covers a texel of an atlas of {} by {}; bake with a larger --atlas",
            size.x, size.y
        )));
    }
    Ok(Atlas { size, texels, charts: charted.charts, charted })
}

fn finish(cover: &Cover, cell: [u32; 2], triangles: &[[Vec3; 3]], charted: &Charted) -> AtlasTexel {
    let corners = triangles[cover.triangle as usize];
    let uv = charted.corners[cover.triangle as usize].unwrap_or_default();
    let weights = barycentric(uv, cover.moment / cover.chart_area);
    let position = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2];
    let normal = octahedral::decode(octahedral::encode(cover.normal.to_array()));
    let diffuse = (cover.color / cover.world_area).clamp(Vec3::ZERO, Vec3::ONE).to_array();
    let texel = Texel {
        position: position.to_array(),
        normal,
        area: cover.world_area,
        diffuse,
        chart: cover.chart,
        cell,
        slot: 0,
    };
    AtlasTexel { texel, triangle: cover.triangle }
}

struct Triangle<'a> {
    part: &'a Part,
    scene: &'a Scene,
    corners: [u32; 3],
    uv: [Vec2; 3],
    normal: Vec3,
    /// World area of one texel.
    density: f32,
    number: u32,
    chart: u32,
}

impl<'a> Triangle<'a> {
    fn new(scene: &'a Scene, part: &'a Part, corners: [u32; 3], uv: [Vec2; 3], number: u32, chart: u32) -> Self {
        let [a, b, c] = corners.map(|index| part.positions[index as usize]);
        let cross = (b - a).cross(c - a);
        let uv_area = 0.5 * (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]).abs();
        let density = if uv_area > 0.0 { 0.5 * cross.length() / uv_area } else { 0.0 };
        Self { part, scene, corners, uv, normal: cross.normalize_or_zero(), density, number, chart }
    }

    /// Adds the triangle to every texel it touches. Coordinates from the scene must not overlap.
    fn cover(&self, cover: &mut [Cover], charted: &Charted) -> Result<(), BakeError> {
        let size = charted.size;
        let low = self.uv[0].min(self.uv[1]).min(self.uv[2]).max(Vec2::ZERO).as_uvec2();
        let high = self.uv[0].max(self.uv[1]).max(self.uv[2]).ceil().as_uvec2().min(size);
        for y in low.y..high.y {
            for x in low.x..high.x {
                let (area, moment) = clipped(self.uv, Vec2::new(x as f32, y as f32));
                if area <= 0.0 {
                    continue;
                }
                let cover = &mut cover[(y * size.x + x) as usize];
                let before = *cover;
                self.add(cover, area, moment);
                if charted.from_scene && (cover.area > MOST_COVER || (before.area > 0.0 && before.chart != self.chart))
                {
                    return Err(self.conflict(&before, [x, y], cover.area > MOST_COVER, charted));
                }
            }
        }
        Ok(())
    }

    fn add(&self, cover: &mut Cover, area: f32, moment: Vec2) {
        cover.area += area;
        if cover.chart_area > 0.0 && cover.chart != self.chart {
            // The chart with the larger share has the texel; unwrapped charts never meet here.
            if area <= cover.chart_area {
                return;
            }
            *cover = Cover { area: cover.area, ..Cover::default() };
        }
        if cover.chart_area == 0.0 {
            *cover = Cover { chart: self.chart, flat: true, normal: self.normal, area: cover.area, ..Cover::default() };
        }
        cover.flat &= cover.normal.dot(self.normal) > COPLANAR;
        let (world, center) = (area * self.density, moment / area);
        cover.color += world * self.color(center);
        cover.world_area += world;
        let larger = area > cover.triangle_area;
        if larger {
            (cover.triangle, cover.triangle_area, cover.normal) = (self.number, area, self.normal);
        }
        if cover.flat {
            cover.moment += moment;
            cover.chart_area += area;
        } else {
            // Over an edge: the middle of the largest face.
            cover.chart_area += area;
            if larger {
                cover.moment = center * cover.chart_area;
            } else {
                cover.moment *= cover.chart_area / (cover.chart_area - area);
            }
        }
    }

    fn color(&self, at: Vec2) -> Vec3 {
        let weights = barycentric(self.uv, at);
        let material = &self.scene.materials[self.part.material];
        let set = match &material.picture {
            Some(picture) if picture.uv_set == 1 => &self.part.uv1,
            _ => &self.part.uv0,
        };
        let mix2 = |values: &Vec<Vec2>| (0..3).map(|i| values[self.corners[i] as usize] * weights[i]).sum::<Vec2>();
        let mix3 = |values: &Vec<Vec3>| (0..3).map(|i| values[self.corners[i] as usize] * weights[i]).sum::<Vec3>();
        material.color(set.as_ref().map(mix2)) * self.part.colors.as_ref().map_or(Vec3::ONE, mix3)
    }

    fn conflict(&self, other: &Cover, cell: [u32; 2], overlap: bool, charted: &Charted) -> BakeError {
        let mut first = other.triangle as usize;
        let name = self.scene.parts.iter().find_map(|part| match first.checked_sub(part.triangles.len()) {
            None => Some(part.name.as_str()),
            Some(rest) => {
                first = rest;
                None
            }
        });
        let (name, [x, y], size) = (name.unwrap_or("-"), cell, charted.size.x);
        BakeError::Atlas(if overlap {
            format!(
                "{} and {name} overlap in TEXCOORD_1 at texel ({x}, {y}) of {size}; lay it out without overlaps, or bake with --unwrap",
                self.part.name
            )
        } else {
            format!(
                "an atlas of {size} texels is too small for TEXCOORD_1: charts of {} and {name} meet in texel ({x}, {y}); bake with a larger --atlas or --unwrap",
                self.part.name
            )
        })
    }
}

/// Area and first moment of what a triangle has in the unit square at `low`.
fn clipped(triangle: [Vec2; 3], low: Vec2) -> (f32, Vec2) {
    let mut polygon: Vec<Vec2> = triangle.map(|corner| corner - low).to_vec();
    let mut next = Vec::with_capacity(8);
    for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
        let inside = |p: Vec2| if side > 0.0 { p[axis] } else { 1.0 - p[axis] };
        next.clear();
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (inside(a), inside(b));
            if da >= 0.0 {
                next.push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                next.push(a + (b - a) * (da / (da - db)));
            }
        }
        std::mem::swap(&mut polygon, &mut next);
        if polygon.is_empty() {
            return (0.0, Vec2::ZERO);
        }
    }
    let (mut area, mut moment) = (0.0, Vec2::ZERO);
    for i in 1..polygon.len() - 1 {
        let (a, b, c) = (polygon[0], polygon[i], polygon[i + 1]);
        let part = 0.5 * (b - a).perp_dot(c - a);
        area += part;
        moment += part * (a + b + c) / 3.0;
    }
    let sign = area.signum();
    (area.abs(), sign * moment + area.abs() * low)
}

/// Weights of the corners at `at`.
fn barycentric([a, b, c]: [Vec2; 3], at: Vec2) -> [f32; 3] {
    let whole = (b - a).perp_dot(c - a);
    let wb = (at - a).perp_dot(c - a) / whole;
    let wc = (b - a).perp_dot(at - a) / whole;
    [1.0 - wb - wc, wb, wc]
}
