//! Coherent shadow maps: the object seen from outside, by parallel projections from all directions.
//!
//! They answer what cube maps on the surface cannot: whether the object blocks a ray between two points that are not on it
//! (section 3.3 of the paper). The directions are the cells' centres of an octahedral grid. A block holds 8 by 8 of them,
//! row by row, there and back. A map shows the object's bounding sphere in a square; depth is counted from the plane that
//! touches the sphere in front, and a ray that meets the object always has a finite code.

use crate::block::LANES;
use crate::cube::group_and_row;
use crate::{CssmFile, Meta, Quantizer, Texel, octahedral};

/// Side of a block of directions.
const SQUARE: u32 = 8;

/// Across, up and forward for rays along `direction`, all of unit length.
pub fn frame(direction: [f32; 3]) -> [[f32; 3]; 3] {
    let helper = if direction[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let across = cross(helper, direction);
    let length = dot(across, across).sqrt();
    let across = across.map(|value| value / length);
    [across, cross(direction, across), direction]
}

/// The direction of rays in the map of a grid cell, of unit length.
pub fn direction(cell: [u32; 2], grid: u32) -> [f32; 3] {
    octahedral::from_square(cell.map(|at| (2 * at + 1) as f32 / grid as f32 - 1.0))
}

/// Block and lane of a grid cell's map.
pub fn slot([x, y]: [u32; 2], grid: u32) -> (usize, usize) {
    let block = (y / SQUARE) * (grid / SQUARE) + x / SQUARE;
    let (column, row) = (x % SQUARE, y % SQUARE);
    let along = if row.is_multiple_of(2) { column } else { SQUARE - 1 - column };
    debug_assert_eq!(LANES as u32, SQUARE * SQUARE);
    (block as usize, (row * SQUARE + along) as usize)
}

impl CssmFile {
    /// Whether the object blocks the way from a point outside its hull to another one, as far as its maps from outside tell.
    /// Without such maps nothing is blocked. In world units of the object's space.
    pub fn blocks(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let way: [f32; 3] = std::array::from_fn(|axis| to[axis] - from[axis]);
        let center = self.meta.csm_center;
        // Where the way is nearest to the centre: there the map's rays, which run a little askew, are off by least.
        let along = dot(way, std::array::from_fn(|axis| center[axis] - from[axis])) / dot(way, way);
        let along = along.clamp(0.0, 1.0);
        let nearest: [f32; 3] = std::array::from_fn(|axis| from[axis] + along * way[axis]);
        let offset = std::array::from_fn(|axis| nearest[axis] - center[axis]);
        if dot(offset, offset) >= self.meta.csm_radius * self.meta.csm_radius {
            return false;
        }
        let Some((depth, surface)) = self.outside_depth(nearest, way) else { return false };
        let length = dot(way, way).sqrt();
        let start = depth - along * length;
        surface.is_finite() && start < surface && surface < start + length
    }

    /// Whether a point lies in the object's box.
    pub fn holds(&self, point: [f32; 3]) -> bool {
        let Meta { bounds_min, bounds_max, lift, .. } = self.meta;
        (0..3).all(|axis| point[axis] >= bounds_min[axis] - lift && point[axis] <= bounds_max[axis] + lift)
    }

    /// Whether the object lets a texel of it see a point that may be on another object. Where a ray leaves the object through
    /// its only surface the cube map leaves open where that is: outside the box the maps from outside are asked as well.
    pub fn sees(&self, texel: &Texel, point: [f32; 3]) -> bool {
        let way = std::array::from_fn(|axis| texel.position[axis] - point[axis]);
        self.visible(texel, point) && (self.holds(point) || self.seen_from_outside(texel.position, way))
    }

    /// Whether the object stands between two points that are not on it. It is asked from outside its box; what lies between two
    /// points within that is not known.
    pub fn stands_between(&self, a: [f32; 3], b: [f32; 3]) -> bool {
        match (self.holds(a), self.holds(b)) {
            (false, _) => self.blocks(a, b),
            (true, false) => self.blocks(b, a),
            (true, true) => false,
        }
    }

    /// Whether a point of the object is seen from far away by rays along `direction`, as far as its maps from outside
    /// tell. In world units of the object's space.
    pub fn seen_from_outside(&self, point: [f32; 3], direction: [f32; 3]) -> bool {
        self.outside_depth(point, direction).is_none_or(|(depth, surface)| depth <= surface)
    }

    /// Depth of a point in the map whose rays run most nearly along `direction`, and the depth that is stored there;
    /// infinite where the ray meets nothing. Nothing if the point is not in the map.
    fn outside_depth(&self, point: [f32; 3], direction: [f32; 3]) -> Option<(f32, f32)> {
        let meta = &self.meta;
        let last = meta.csm_grid.checked_sub(1)?;
        let cell = octahedral::to_square(direction)
            .map(|at| (((at * 0.5 + 0.5) * meta.csm_grid as f32).max(0.0) as u32).min(last));
        let frame = frame(self::direction(cell, meta.csm_grid));
        let offset: [f32; 3] = std::array::from_fn(|axis| point[axis] - meta.csm_center[axis]);
        let [x, y, depth] = frame.map(|axis| dot(offset, axis));
        let pixel = [x, y].map(|at| (at / meta.csm_radius * 0.5 + 0.5) * meta.csm_side as f32);
        let inside = pixel.iter().all(|at| (0.0..meta.csm_side as f32).contains(at));
        let (block, lane) = slot(cell, meta.csm_grid);
        let (group, row) = group_and_row(inside.then(|| pixel.map(|at| at as u32))?, meta.csm_side);
        let (_, groups) = meta.csm_shape();
        let code = self.csm.code(block * groups + group, row, lane)?;
        Some((depth + meta.csm_radius, Quantizer::new(meta.csm_quantum).depth(code)))
    }
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_direction_has_its_slot() {
        let mut seen = vec![false; 24 * 24];
        for y in 0..24 {
            for x in 0..24 {
                let (block, lane) = slot([x, y], 24);
                assert!(!std::mem::replace(&mut seen[block * LANES + lane], true));
                let ray = direction([x, y], 24);
                let square = octahedral::to_square(ray).map(|at| ((at * 0.5 + 0.5) * 24.0) as u32);
                assert_eq!(square, [x, y]);
                let [across, up, forward] = frame(ray);
                for (a, b) in [(across, up), (up, forward), (forward, across)] {
                    assert!(dot(a, b).abs() < 1.0e-6 && (dot(a, a) - 1.0).abs() < 1.0e-5);
                }
            }
        }
    }
}
