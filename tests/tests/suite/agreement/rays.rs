//! Exact rays through the triangles of a scene.

use bevy::math::Vec3;
use bevy_bounce_tests::scene::TestScene;

/// The triangles, halved until there are `LEAF` each, and the box of each: what exact rays look through.
pub struct Rays {
    triangles: Vec<[Vec3; 3]>,
    boxes: Vec<(Vec3, Vec3)>,
}

const LEAF: usize = 32;

impl Rays {
    pub fn new(scene: &TestScene) -> Self {
        let mut triangles = scene.triangles.clone();
        fn split(triangles: &mut [[Vec3; 3]]) {
            if triangles.len() <= LEAF {
                return;
            }
            let centre = |t: &[Vec3; 3]| t[0] + t[1] + t[2];
            let (low, high) = triangles
                .iter()
                .map(centre)
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            let axis = (high - low).max_position();
            let middle = (triangles.len() / 2).next_multiple_of(LEAF);
            if middle >= triangles.len() {
                return;
            }
            triangles.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
            let (a, b) = triangles.split_at_mut(middle);
            split(a);
            split(b);
        }
        split(&mut triangles);
        let bounds = |chunk: &[[Vec3; 3]]| {
            let corners = chunk.as_flattened();
            corners.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
        };
        let boxes = triangles.chunks(LEAF).map(bounds).collect();
        Self { triangles, boxes }
    }

    /// The nearest surface between two distances, from either side: its distance and triangle.
    pub fn cast(&self, origin: Vec3, direction: Vec3, least: f32, most: f32) -> Option<(f32, [Vec3; 3])> {
        let inverse = direction.recip();
        let mut found = None;
        let mut nearest = most;
        for (chunk, (low, high)) in self.triangles.chunks(LEAF).zip(&self.boxes) {
            let (a, b) = ((*low - origin) * inverse, (*high - origin) * inverse);
            let enter = a.min(b).max_element().max(least);
            if enter > a.max(b).min_element().min(nearest) {
                continue;
            }
            for t in chunk {
                let turned = [t[0], t[2], t[1]];
                let hit = crate::paths::intersect(t, origin, direction)
                    .or_else(|| crate::paths::intersect(&turned, origin, direction));
                if let Some(distance) = hit.filter(|distance| *distance > least && *distance < nearest) {
                    nearest = distance;
                    found = Some((distance, *t));
                }
            }
        }
        found
    }
}
