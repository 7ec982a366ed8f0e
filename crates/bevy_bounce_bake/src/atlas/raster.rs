//! From charts to texels: what lies under each, by exact clipping.

use bevy_bounce_cssm::{Texel, octahedral};
use glam::{Vec2, Vec3, Vec4};

use super::{Atlas, AtlasTexel, Charted, barycentric};
use crate::{
    BakeError,
    scene::{Material, Part, Scene},
};

/// A texel with less of the surface than this share shows none of it.
const LEAST_COVER: f32 = 1.0e-3;
/// Charts that cover more than this much of a texel overlap.
const MOST_COVER: f32 = 1.02;
/// Places a side of a texel at which a surface with holes is looked at.
const SAMPLES: u32 = 4;
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

/// What a triangle shows in a texel.
struct Piece {
    /// In texels.
    area: f32,
    center: Vec2,
    /// Linear.
    color: Vec3,
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
                cover.area += area;
                let piece = self.shade(Vec2::new(x as f32, y as f32), area, moment);
                if piece.area > 0.0 {
                    self.add(cover, &piece);
                }
                if charted.from_scene && (cover.area > MOST_COVER || (before.area > 0.0 && before.chart != self.chart))
                {
                    return Err(self.conflict(&before, [x, y], cover.area > MOST_COVER, charted));
                }
            }
        }
        Ok(())
    }

    /// What the surface shows of `area` with first `moment` in the texel at `low`. With holes, that is looked at in a grid.
    fn shade(&self, low: Vec2, area: f32, moment: Vec2) -> Piece {
        let center = moment / area;
        if self.material().cutoff <= 0.0 {
            return Piece { area, center, color: self.color(center).truncate() };
        }
        let grid = (0..SAMPLES * SAMPLES).map(|i| Vec2::new((i % SAMPLES) as f32, (i / SAMPLES) as f32));
        let grid = grid.map(|at| low + (at + 0.5) / SAMPLES as f32);
        let mut places: Vec<Vec2> =
            grid.filter(|at| barycentric(self.uv, *at).iter().all(|weight| *weight >= 0.0)).collect();
        if places.is_empty() {
            places.push(center);
        }
        let all = places.len() as f32;
        let there: Vec<(Vec2, Vec4)> = places.into_iter().map(|at| (at, self.color(at))).collect();
        let there: Vec<_> = there.into_iter().filter(|(_, color)| color.w >= self.material().cutoff).collect();
        let count = there.len() as f32;
        let (center, color) = there.into_iter().fold((Vec2::ZERO, Vec4::ZERO), |a, b| (a.0 + b.0, a.1 + b.1));
        Piece { area: area * count / all, center: center / count, color: color.truncate() / count }
    }

    fn add(&self, cover: &mut Cover, piece: &Piece) {
        let Piece { area, center, color } = *piece;
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
        let world = area * self.density;
        cover.color += world * color;
        cover.world_area += world;
        let larger = area > cover.triangle_area;
        if larger {
            (cover.triangle, cover.triangle_area, cover.normal) = (self.number, area, self.normal);
        }
        if cover.flat {
            cover.moment += area * center;
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

    fn material(&self) -> &Material {
        &self.scene.materials[self.part.material]
    }

    /// Colour and alpha.
    fn color(&self, at: Vec2) -> Vec4 {
        let weights = barycentric(self.uv, at);
        let uv = self.part.texture_coordinates(self.material());
        let uv = uv.map(|values| (0..3).map(|i| values[self.corners[i] as usize] * weights[i]).sum());
        let mix = |values: &Vec<Vec4>| (0..3).map(|i| values[self.corners[i] as usize] * weights[i]).sum();
        self.material().color(uv) * self.part.colors.as_ref().map_or(Vec4::ONE, mix)
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
