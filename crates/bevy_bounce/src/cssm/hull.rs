//! Hulls of baked objects, and which of them overlap.
//!
//! What an object hides from others is known from outside its hull (section 3.3 of the paper). Where hulls overlap, that is said
//! once for each pair.

use bevy::math::{Affine3A, Vec3};
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy_bounce_cssm::{CssmFile, octahedral};

/// Directions a side of the octahedral grid in which a hull has its outermost points.
const DIRECTIONS: usize = 12;
/// Hulls that are less deep in each other than this share of one only touch.
const DEPTH: f32 = 0.02;
/// Hulls that are as near as this share of their sizes have a point in common.
const NEAR: f32 = 1.0e-3;
/// Steps towards the nearest points. Hulls for which these do not suffice only touch, too.
const STEPS: usize = 256;

/// The outermost texels of an object in directions all round; the hull of these is within the hull of all.
#[derive(Clone, Debug, Default)]
pub struct Hull(Vec<Vec3>);

impl Hull {
    /// Of a file's texels, in the object's space.
    pub fn new(file: &CssmFile) -> Self {
        let texels: Vec<Vec3> =
            (0..file.meta.texels as usize).filter_map(|index| Some(file.texel(index)?.position.into())).collect();
        let at = |step: usize| (2 * step + 1) as f32 / DIRECTIONS as f32 - 1.0;
        let direction = |i: usize| Vec3::from(octahedral::from_square([at(i % DIRECTIONS), at(i / DIRECTIONS)]));
        let mut points: Vec<Vec3> =
            (0..DIRECTIONS * DIRECTIONS).filter_map(|i| outermost(&texels, direction(i))).collect();
        points.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).unwrap_or(std::cmp::Ordering::Equal));
        points.dedup();
        Self(points)
    }

    /// Its points in the world.
    fn placed(&self, world_from_object: Affine3A) -> Vec<Vec3> {
        self.0.iter().map(|&point| world_from_object.transform_point3(point)).collect()
    }
}

fn outermost(points: &[Vec3], direction: Vec3) -> Option<Vec3> {
    points.iter().copied().max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))
}

/// Points a little nearer to their middle: what touches does not overlap.
fn shrunk(points: &[Vec3]) -> Vec<Vec3> {
    let middle = points.iter().sum::<Vec3>() / points.len().max(1) as f32;
    points.iter().map(|point| point.lerp(middle, DEPTH)).collect()
}

/// Extent of points along the diagonal of their box.
fn size(points: &[Vec3]) -> f32 {
    let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.iter().fold(empty, |(low, high), point| (low.min(*point), high.max(*point)));
    low.distance(high)
}

/// Whether the hulls of two sets of points have a point in common. Gilbert 1966: the way between the hulls is shortened towards
/// the outermost points against it, until it is none or a plane across it has the hulls on both sides.
fn overlap(a: &[Vec3], b: &[Vec3]) -> bool {
    let a = &shrunk(a);
    let (Some(first_a), Some(first_b)) = (a.first(), b.first()) else { return false };
    let least = NEAR * size(a).min(size(b));
    let mut way = first_a - first_b;
    for _ in 0..STEPS {
        if way.length() < least {
            return true;
        }
        let (Some(near_a), Some(near_b)) = (outermost(a, -way), outermost(b, way)) else { return false };
        let next = near_a - near_b;
        if way.dot(next) > 0.0 {
            return false;
        }
        let step = next - way;
        way += step * (-way.dot(step) / step.length_squared()).clamp(0.0, 1.0);
    }
    false
}

/// Pairs of objects whose overlap was told.
#[derive(Default)]
pub struct Overlaps {
    told: HashSet<[Entity; 2]>,
    /// Where objects stood when they were last looked at.
    places: Vec<(Entity, Affine3A)>,
}

impl Overlaps {
    /// What is to be told of pairs that overlap and were not told before, by what their entities are called.
    pub fn new_warnings(
        &mut self,
        objects: &[(Entity, Affine3A, &Hull)],
        name: impl Fn(Entity) -> String,
    ) -> Vec<String> {
        let warning = |[a, b]: [String; 2]| {
            format!(
                "the hulls of the baked objects {a} and {b} overlap: what one hides within the other from third ones is not known"
            )
        };
        self.new_pairs(objects).into_iter().map(|pair| warning(pair.map(&name))).collect()
    }

    /// Pairs that overlap and were not told before. Nothing is done while nothing moves.
    fn new_pairs(&mut self, objects: &[(Entity, Affine3A, &Hull)]) -> Vec<[Entity; 2]> {
        let places: Vec<_> = objects.iter().map(|&(entity, place, _)| (entity, place)).collect();
        if places == self.places {
            return Vec::new();
        }
        self.places = places;
        let hulls: Vec<_> = objects.iter().map(|(entity, place, hull)| (*entity, hull.placed(*place))).collect();
        let mut found = Vec::new();
        for (i, (a, hull_a)) in hulls.iter().enumerate() {
            for (b, hull_b) in &hulls[i + 1..] {
                if !self.told.contains(&[*a, *b]) && overlap(hull_a, hull_b) {
                    self.told.insert([*a, *b]);
                    found.push([*a, *b]);
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(center: Vec3, half: f32) -> Vec<Vec3> {
        let sign = |bit: u32| if bit == 0 { -half } else { half };
        (0..8_u32).map(|i| center + Vec3::new(sign(i & 1), sign(i & 2), sign(i & 4))).collect()
    }

    #[test]
    fn hulls_overlap_or_do_not() {
        let one = cube(Vec3::ZERO, 1.0);
        assert!(overlap(&one, &one));
        assert!(overlap(&one, &cube(Vec3::new(0.2, -0.1, 0.3), 0.1)), "one within the other");
        assert!(overlap(&one, &cube(Vec3::new(1.8, 1.8, 0.0), 1.0)), "an edge within the other");
        assert!(!overlap(&one, &cube(Vec3::new(2.0, 0.0, 0.0), 1.0)), "they touch");
        assert!(!overlap(&one, &cube(Vec3::new(3.0, 0.1, 0.2), 1.0)));
        // Their boxes overlap, they do not.
        let corner: Vec<Vec3> = cube(Vec3::splat(1.3), 0.5).into_iter().filter(|p| p.element_sum() > 3.5).collect();
        let tetrahedron = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z].map(|p| p * 1.8);
        assert!(!overlap(&tetrahedron, &corner));
    }

    #[test]
    fn each_pair_is_told_once() {
        let hull = Hull(cube(Vec3::ZERO, 1.0));
        let [a, b, c] = [0, 1, 2].map(Entity::from_raw_u32).map(|entity| entity.expect("is an index"));
        let at = |x: f32| Affine3A::from_translation(Vec3::X * x);
        let mut overlaps = Overlaps::default();
        let objects = [(a, at(0.0), &hull), (b, at(1.0), &hull), (c, at(5.0), &hull)];
        assert_eq!(overlaps.new_pairs(&objects), [[a, b]]);
        assert!(overlaps.new_pairs(&objects).is_empty());
        let moved = [(a, at(0.0), &hull), (b, at(1.5), &hull), (c, at(3.0), &hull)];
        assert_eq!(overlaps.new_pairs(&moved), [[b, c]]);
    }

    #[test]
    fn a_warning_names_both_once() {
        let hull = Hull(cube(Vec3::ZERO, 1.0));
        let mut world = World::new();
        let [room, lamp] = ["room", "lamp"].map(|name| world.spawn(Name::new(name)).id());
        let name = |entity| world.get::<Name>(entity).map_or_else(String::new, |name| name.to_string());
        let mut overlaps = Overlaps::default();
        let mut told = |x: f32| {
            let at = Affine3A::from_translation(Vec3::X * x);
            overlaps.new_warnings(&[(room, Affine3A::IDENTITY, &hull), (lamp, at, &hull)], name)
        };
        assert!(told(5.0).is_empty(), "they are apart");
        let [warning] = &told(1.0)[..] else { panic!("it is told") };
        assert!(warning.contains("room and lamp overlap"), "{warning}");
        assert!(told(1.5).is_empty() && told(5.0).is_empty() && told(1.0).is_empty(), "it is told again");
    }
}
