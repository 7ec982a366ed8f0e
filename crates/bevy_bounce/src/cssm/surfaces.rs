//! Which triangle each texel of a bake shows: the one with the largest share of the texel's cell, by clipping, as in the bake.

use bevy::math::Vec2;
use bevy_bounce_cssm::CssmFile;
use bevy_bounce_shaders::types::{CssmSurface, NONE};

/// A triangle of every texel, in their order.
pub fn surfaces(file: &CssmFile) -> Vec<CssmSurface> {
    let none = CssmSurface { part: NONE, ..CssmSurface::default() };
    let mut found = vec![(0.0_f32, none); file.meta.texels as usize];
    let size = Vec2::new(file.meta.atlas[0] as f32, file.meta.atlas[1] as f32);
    for (part, record) in (0..).zip(file.parts.iter()) {
        for triangle in 0..record.triangles {
            let Some(corners) = file.parts.triangle(record.first_triangle + triangle) else { continue };
            let corners = corners.map(|corner| Vec2::from(corner) * size);
            let low = corners[0].min(corners[1]).min(corners[2]).floor().max(Vec2::ZERO).as_uvec2();
            let high = corners[0].max(corners[1]).max(corners[2]).ceil().as_uvec2();
            for row in low.y..high.y.min(file.meta.atlas[1]) {
                for column in low.x..high.x.min(file.meta.atlas[0]) {
                    let Some(texel) = file.texel_at([column, row]) else { continue };
                    let (area, center) = clipped(corners, Vec2::new(column as f32, row as f32));
                    if area > found[texel].0 {
                        let barycentric = barycentric(corners, center);
                        found[texel] = (area, CssmSurface { part, triangle, barycentric });
                    }
                }
            }
        }
    }
    found.into_iter().map(|(_, surface)| surface).collect()
}

/// Area of what a triangle has in the unit square at `low`, and its centre.
fn clipped(triangle: [Vec2; 3], low: Vec2) -> (f32, Vec2) {
    let mut polygon: Vec<Vec2> = triangle.map(|corner| corner - low).to_vec();
    for (axis, flip) in [(0, false), (0, true), (1, false), (1, true)] {
        let inside = |p: Vec2| if flip { 1.0 - p[axis] } else { p[axis] };
        let mut kept = Vec::with_capacity(polygon.len() + 1);
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (inside(a), inside(b));
            if da >= 0.0 {
                kept.push(a);
            }
            if (da >= 0.0) != (db >= 0.0) {
                kept.push(a + (b - a) * (da / (da - db)));
            }
        }
        polygon = kept;
    }
    let (mut area, mut moment) = (0.0, Vec2::ZERO);
    for i in 1..polygon.len().saturating_sub(1) {
        let (a, b, c) = (polygon[0], polygon[i], polygon[i + 1]);
        let part = 0.5 * (b - a).perp_dot(c - a);
        area += part;
        moment += part * (a + b + c) / 3.0;
    }
    if area == 0.0 { (0.0, low) } else { (area.abs(), moment / area + low) }
}

/// Weights of the second and third corner, packed.
fn barycentric([a, b, c]: [Vec2; 3], at: Vec2) -> u32 {
    let whole = (b - a).perp_dot(c - a);
    let second = (at - a).perp_dot(c - a) / whole;
    let third = (b - a).perp_dot(at - a) / whole;
    let pack = |weight: f32| (weight.clamp(0.0, 1.0) * 65535.0).round() as u32;
    pack(second) | pack(third) << 16
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_bounce_cssm::{Meta, NO_TEXEL, Parts, Texel};

    /// An atlas of 4 by 2 cells, all of them texels.
    fn file(parts: Parts) -> CssmFile {
        let texel = |cell: u32| Texel { cell: [cell % 4, cell / 4], ..Texel::default() };
        CssmFile {
            meta: Meta { atlas: [4, 2], texels: 8, ..Meta::default() },
            texels: (0..8).flat_map(|cell| texel(cell).to_words()).collect(),
            cells: (0..8).collect(),
            parts,
            maps: Default::default(),
            csm: Default::default(),
        }
    }

    #[test]
    fn texels_find_their_triangles() {
        let mut parts = Parts::default();
        // The left half by two triangles without a gap, the third column by one of another part, the last by none.
        let left = [[0.0, 0.0], [0.5, 0.0], [0.5, 1.0], [0.0, 1.0]];
        parts.push([0, 0, 0], &[Some([left[0], left[1], left[2]]), None, Some([left[0], left[2], left[3]])]);
        parts.push([1, 0, 0], &[None, Some([[0.5, 0.0], [0.75, 0.0], [0.75, 1.0]])]);
        let found = surfaces(&file(parts));
        let which: Vec<_> = found.iter().map(|surface| (surface.part, surface.triangle)).collect();
        // Cell (0, 0) is halved by the diagonal: the first comes first.
        assert_eq!((which[1], which[4]), ((0, 0), (0, 2)));
        assert_eq!((which[0].0, which[5].0), (0, 0));
        assert_eq!((which[2].0, which[6].0), (1, 1));
        assert_eq!((which[3].0, which[7].0), (NONE, NONE));
    }

    #[test]
    fn weights_are_those_of_the_middle() {
        let mut parts = Parts::default();
        parts.push([0, 0, 0], &[Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])]);
        let found = surfaces(&file(parts));
        let [second, third] = [found[1].barycentric & 0xffff, found[1].barycentric >> 16].map(|w| w as f32 / 65535.0);
        // Cell (1, 0) spans a quarter to a half of the width, and 0 to a half of the height, all within the triangle.
        assert!((second - 0.375).abs() < 1.0e-3 && (third - 0.25).abs() < 1.0e-3, "{second} {third}");
    }

    #[test]
    fn a_cell_without_a_texel_is_passed_over() {
        let mut parts = Parts::default();
        parts.push([0, 0, 0], &[Some([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])]);
        let mut file = file(parts);
        file.cells = vec![NO_TEXEL; 8];
        assert!(surfaces(&file).iter().all(|surface| surface.part == NONE));
    }
}
