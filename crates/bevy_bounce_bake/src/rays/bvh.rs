//! The hierarchy over the triangles, built by `obvhs`.

use std::time::Duration;

use glam::Vec3;
use obvhs::ray::{Ray, RayHit};
use obvhs::{BvhBuildParams, bvh2::Bvh2, bvh2::builder::build_bvh2_from_tris, triangle::Triangle};

use crate::scene::{Cutout, Material, Scene};

/// A node, compact: boxes of the children decide where packets go.
#[derive(Clone, Copy, Debug)]
pub struct Node {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
    /// First triangle of a leaf, first of two children otherwise.
    pub first: u32,
    /// Triangles of a leaf, 0 for inner nodes.
    pub count: u32,
}

/// A place where a ray meets a surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Which of [`Scene::occluders`].
    pub occluder: u32,
    /// Of the triangle's corners; they add up to 1.
    pub weights: [f32; 3],
    /// Whether it is the side from which the corners run counter-clockwise.
    pub front: bool,
}

/// A bounding volume hierarchy over the triangles that stop light.
pub struct Bvh<'a> {
    tree: Bvh2,
    /// Node 0 is the root.
    pub nodes: Vec<Node>,
    /// Corners of the triangles in the order of the leaves.
    pub triangles: Vec<[Vec3; 3]>,
    /// For cutouts.
    pub materials: &'a [Material],
    /// In the same order; empty where no triangle has holes.
    cutouts: Vec<Option<Cutout>>,
    single: Vec<Triangle>,
}

impl<'a> Bvh<'a> {
    /// Builds the hierarchy; the same for the same scene.
    pub fn new(scene: &'a Scene) -> Self {
        let (triangles, cutouts): (Vec<_>, Vec<_>) = scene.occluders().unzip();
        let convert = |corners: &[Vec3; 3]| {
            let [v0, v1, v2] = corners.map(|corner| corner.to_array().into());
            Triangle { v0, v1, v2 }
        };
        let single: Vec<Triangle> = triangles.iter().map(convert).collect();
        // Without spatial splits each triangle is in one leaf.
        let params = BvhBuildParams { pre_split: false, ..BvhBuildParams::medium_build() };
        let tree = build_bvh2_from_tris(&single, params, &mut Duration::default());
        let nodes = tree.nodes.iter().map(|node| {
            let [min, max] = [node.aabb().min, node.aabb().max].map(|corner| Vec3::from_array(corner.into()));
            Node { min, max, first: node.first_index, count: node.prim_count }
        });
        let nodes = nodes.collect();
        let order = |&index: &u32| triangles[index as usize];
        let ordered = tree.primitive_indices.iter().map(order).collect();
        let single = tree.primitive_indices.iter().map(|&index| single[index as usize]).collect();
        let solid = cutouts.iter().all(Option::is_none);
        let cutouts = tree.primitive_indices.iter().filter(|_| !solid).map(|&index| cutouts[index as usize]).collect();
        Self { nodes, triangles: ordered, materials: &scene.materials, cutouts, single, tree }
    }

    /// The holes of a triangle, by its place in [`triangles`](Self::triangles).
    #[inline]
    pub fn cutout(&self, index: usize) -> Option<&Cutout> {
        self.cutouts.get(index)?.as_ref()
    }

    /// Whether nothing lies on the way from `from` to `to`, both ends left out by `margin` of the way. Ray by ray, by the
    /// crate's own traversal and intersection.
    pub fn visible(&self, from: Vec3, to: Vec3, margin: f32) -> bool {
        let (ray, way) = segment(from, to, margin);
        self.tree.ray_traverse_miss(ray, |ray, id| self.meets(ray, id, from, way))
    }

    /// Surfaces on the way from `from` to `to`, both ends left out by `margin` of the way; two closer than that are one.
    pub fn surfaces_between(&self, from: Vec3, to: Vec3, margin: f32) -> usize {
        let (ray, way) = segment(from, to, margin);
        let mut hits = Vec::new();
        self.tree.ray_traverse_miss(ray, |ray, id| {
            hits.extend(Some(self.meets(ray, id, from, way)).filter(|at| at.is_finite()));
            f32::INFINITY
        });
        hits.sort_by(f32::total_cmp);
        hits.dedup_by(|at, last| *at - *last <= margin);
        hits.len()
    }

    /// The first surface that a ray from `from` meets.
    pub fn first(&self, from: Vec3, direction: Vec3) -> Option<Hit> {
        let ray = Ray::new(from.to_array().into(), direction.to_array().into(), 0.0, f32::INFINITY);
        let mut nearest = RayHit::none();
        self.tree.ray_traverse(ray, &mut nearest, |ray, id| self.meets(ray, id, from, direction));
        let triangle = (nearest.t < f32::INFINITY).then_some(nearest.primitive_id as usize)?;
        let corners = &self.triangles[triangle];
        Some(Hit {
            occluder: self.tree.primitive_indices[triangle],
            weights: weights(corners, from + direction * nearest.t),
            front: (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(direction) < 0.0,
        })
    }

    /// Whether a ray from `from` meets nothing for that many lengths of `direction`.
    pub fn is_free(&self, from: Vec3, direction: Vec3, distance: f32) -> bool {
        let ray = Ray::new(from.to_array().into(), direction.to_array().into(), 0.0, distance);
        self.tree.ray_traverse_miss(ray, |ray, id| self.meets(ray, id, from, direction))
    }

    /// Where a ray meets a triangle, in lengths of the way; infinite where it passes by or through a hole.
    fn meets(&self, ray: &Ray, triangle: usize, from: Vec3, way: Vec3) -> f32 {
        let at = self.single[triangle].intersect(ray);
        let hole = at < f32::INFINITY
            && self.cutout(triangle).is_some_and(|cutout| {
                let weights = weights(&self.triangles[triangle], from + way * at);
                !cutout.is_there(self.materials, weights)
            });
        if hole { f32::INFINITY } else { at }
    }
}

/// The ray from `from` to `to` without `margin` of it at each end, and the way.
fn segment(from: Vec3, to: Vec3, margin: f32) -> (Ray, Vec3) {
    let way = to - from;
    (Ray::new(from.to_array().into(), way.to_array().into(), margin, 1.0 - margin), way)
}

/// Weights of a triangle's corners at a point of it.
fn weights([a, b, c]: &[Vec3; 3], at: Vec3) -> [f32; 3] {
    let normal = (b - a).cross(c - a);
    let share = |from: Vec3, to: Vec3| (from - at).cross(to - at).dot(normal) / normal.length_squared();
    let (wa, wb) = (share(*b, *c), share(*c, *a));
    [wa, wb, 1.0 - wa - wb]
}
