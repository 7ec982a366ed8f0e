//! How far a mesh is from a coarser version of it. A simplifier's own estimate is that of planes: it does not know that a
//! sheet has shrunk from its border, or that a small part is gone.

use bevy::math::Vec3;

use super::occluders::in_triangle;

/// Points of the mesh that are asked, at most.
const POINTS: usize = 512;
/// Points times triangles of the coarser version, at most, as long as that leaves `FEWEST`.
const BUDGET: usize = 1 << 22;
/// Points that are asked however many triangles there are.
const FEWEST: usize = 16;
/// One point in so many may be farther away.
const LEFT_OUT: usize = 20;

/// The distance, in local units, from the coarser version within which all but a twentieth of the mesh's surface lies. `areas` is
/// the running sum of the areas of the mesh's triangles.
///
/// Cost: a distance for each point and triangle of the coarser version, bounded as above.
pub(super) fn deviation(positions: &[[f32; 3]], indices: &[u32], areas: &[f32], coarser: &[u32]) -> f32 {
    let corners = |[a, b, c]: [u32; 3]| [a, b, c].map(|index| Vec3::from(positions[index as usize]));
    let (triangles, coarser) = (indices.as_chunks().0, coarser.as_chunks().0);
    let total = areas.last().copied().unwrap_or(0.0);
    let count = (BUDGET / coarser.len().max(1)).clamp(FEWEST, POINTS);
    let point = |index: usize| {
        let place = (index as f32 + 0.5) / count as f32 * total;
        let triangle = areas.partition_point(|sum| *sum <= place).min(triangles.len() - 1);
        let [a, b, c] = corners(triangles[triangle]);
        let (to_b, to_c) = in_triangle(index as u32);
        a + (b - a) * to_b as f32 + (c - a) * to_c as f32
    };
    let nearest = |point: Vec3| coarser.iter().map(|t| to_triangle(point, corners(*t))).fold(f32::MAX, f32::min);
    if triangles.is_empty() {
        return 0.0;
    }
    let mut distances: Vec<f32> = (0..count).map(|index| nearest(point(index))).collect();
    distances.sort_unstable_by(f32::total_cmp);
    distances[count - 1 - count / LEFT_OUT]
}

fn to_triangle(point: Vec3, [a, b, c]: [Vec3; 3]) -> f32 {
    let normal = (b - a).cross(c - a);
    let edges = [(a, b), (b, c), (c, a)];
    let over = edges.iter().all(|(from, to)| normal.dot((to - from).cross(point - from)) >= 0.0);
    match normal.try_normalize().filter(|_| over) {
        Some(normal) => (point - a).dot(normal).abs(),
        None => edges.map(|(from, to)| to_segment(point, from, to)).into_iter().fold(f32::MAX, f32::min),
    }
}

fn to_segment(point: Vec3, from: Vec3, to: Vec3) -> f32 {
    let way = to - from;
    let share = (point - from).dot(way) / way.length_squared().max(f32::MIN_POSITIVE);
    point.distance(from + way * share.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_to_a_triangle() {
        let triangle = [Vec3::ZERO, Vec3::X, Vec3::Y];
        for (point, expected) in [
            (Vec3::new(0.2, 0.2, 0.7), 0.7),
            (Vec3::new(0.5, -2.0, 0.0), 2.0),
            (Vec3::new(1.0, 1.0, 0.0), 0.5_f32.sqrt()),
            (Vec3::new(-3.0, -4.0, 0.0), 5.0),
        ] {
            assert!((to_triangle(point, triangle) - expected).abs() < 1e-5, "{point}");
        }
        assert_eq!(to_triangle(Vec3::Y, [Vec3::ZERO; 3]), 1.0, "a triangle without area");
    }

    #[test]
    fn a_sheet_that_shrank_is_far_from_what_is_left() {
        let positions = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
        let (sheet, left) = ([0, 1, 2, 0, 2, 3], [0, 4, 3]);
        let far = deviation(&positions, &sheet, &[2.0, 4.0], &left);
        assert!((2.5..3.0).contains(&far), "{far}");
        assert_eq!(deviation(&positions, &sheet, &[2.0, 4.0], &sheet), 0.0);
        assert_eq!(deviation(&positions, &[], &[], &[]), 0.0);
    }
}
