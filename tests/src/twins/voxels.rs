//! Which voxels a triangle touches, and how much of it lies in each, exactly: clipping in double precision.

use std::collections::BTreeMap;

use bevy::math::{DVec3, IVec3, Vec3};

/// A triangle in world space.
pub type Triangle = [Vec3; 3];

/// Area of the triangle in each voxel of a grid with that origin and voxel size; world units squared. Voxels may lie
/// outside of the grid's dimensions.
pub fn areas(triangle: &Triangle, origin: Vec3, voxel_size: f32) -> BTreeMap<[i32; 3], f64> {
    let scale = f64::from(voxel_size);
    let local = triangle.map(|p| (p.as_dvec3() - origin.as_dvec3()) / scale);
    let (low, high) = (local[0].min(local[1]).min(local[2]), local[0].max(local[1]).max(local[2]));
    let mut areas = BTreeMap::new();
    let range = |axis: usize| (low[axis].floor() as i32)..=(high[axis].floor() as i32);
    for x in range(0) {
        let slab = clip(&local, 0, x);
        for y in range(1) {
            let column = clip(&slab, 1, y);
            for z in range(2) {
                let area = polygon_area(&clip(&column, 2, z)) * scale * scale;
                if area > 0.0 {
                    areas.insert([x, y, z], area);
                }
            }
        }
    }
    areas
}

/// The voxels that a dense sampling of the triangle touches.
pub fn sampled(triangle: &Triangle, origin: Vec3, voxel_size: f32, steps: u32) -> Vec<IVec3> {
    let [a, b, c] = triangle.map(|p| (p.as_dvec3() - origin.as_dvec3()) / f64::from(voxel_size));
    let mut voxels = Vec::new();
    for i in 0..=steps {
        for j in 0..=steps - i {
            let (u, v) = (f64::from(i) / f64::from(steps), f64::from(j) / f64::from(steps));
            voxels.push((a + (b - a) * u + (c - a) * v).floor().as_ivec3());
        }
    }
    voxels.sort_by_key(|v| v.to_array());
    voxels.dedup();
    voxels
}

/// The voxels that the triangle comes nearer to than `slack` voxels, and perhaps a few more at their corners.
pub fn near(triangle: &Triangle, origin: Vec3, voxel_size: f32, slack: f64) -> Vec<[i32; 3]> {
    let local = triangle.map(|p| (p.as_dvec3() - origin.as_dvec3()) / f64::from(voxel_size));
    let (low, high) = (local[0].min(local[1]).min(local[2]), local[0].max(local[1]).max(local[2]));
    let range = |axis: usize| ((low[axis] - slack).floor() as i32)..=((high[axis] + slack).floor() as i32);
    let widened = |polygon: &[DVec3], axis: usize, cell: i32| {
        let lower = cut(polygon, |p| p[axis] - f64::from(cell) + slack);
        cut(&lower, |p| f64::from(cell) + 1.0 + slack - p[axis])
    };
    let mut voxels = Vec::new();
    for x in range(0) {
        let slab = widened(&local, 0, x);
        for y in range(1) {
            let column = widened(&slab, 1, y);
            let cells = range(2).filter(|&z| !widened(&column, 2, z).is_empty());
            voxels.extend(cells.map(|z| [x, y, z]));
        }
    }
    voxels
}

/// The part of a polygon between `cell` and `cell + 1` along an axis. Sutherland and Hodgman 1974.
fn clip(polygon: &[DVec3], axis: usize, cell: i32) -> Vec<DVec3> {
    let lower = cut(polygon, |p| p[axis] - f64::from(cell));
    cut(&lower, |p| f64::from(cell) + 1.0 - p[axis])
}

/// The part of a polygon where `distance` is not negative.
fn cut(polygon: &[DVec3], distance: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &from) in polygon.iter().enumerate() {
        let to = polygon[(i + 1) % polygon.len()];
        let (a, b) = (distance(from), distance(to));
        if a >= 0.0 {
            kept.push(from);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push(from + (to - from) * (a / (a - b)));
        }
    }
    kept
}

fn polygon_area(polygon: &[DVec3]) -> f64 {
    let Some((&first, rest)) = polygon.split_first() else { return 0.0 };
    let double: DVec3 = rest.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum();
    double.length() / 2.0
}

/// Area of a triangle.
pub fn area(triangle: &Triangle) -> f64 {
    polygon_area(&triangle.map(|p| p.as_dvec3()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_sum_to_the_triangles() {
        let triangle = [Vec3::new(0.3, 0.2, 0.9), Vec3::new(5.1, 3.7, 2.2), Vec3::new(1.4, 6.3, -2.6)];
        let areas = areas(&triangle, Vec3::new(-0.1, 0.0, 0.05), 0.37);
        let sum: f64 = areas.values().sum();
        assert!((sum / area(&triangle) - 1.0).abs() < 1e-9);
        for voxel in sampled(&triangle, Vec3::new(-0.1, 0.0, 0.05), 0.37, 64) {
            assert!(areas.contains_key(&voxel.to_array()), "{voxel} is touched but has no area");
        }
    }
}
