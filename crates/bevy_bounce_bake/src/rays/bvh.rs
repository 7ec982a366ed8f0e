//! The hierarchy over the triangles, built by `obvhs`.

use std::time::Duration;

use glam::Vec3;
use obvhs::{BvhBuildParams, bvh2::Bvh2, bvh2::builder::build_bvh2_from_tris, ray::Ray, triangle::Triangle};

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

/// A bounding volume hierarchy over triangles.
pub struct Bvh {
    tree: Bvh2,
    /// Node 0 is the root.
    pub nodes: Vec<Node>,
    /// Corners of the triangles in the order of the leaves.
    pub triangles: Vec<[Vec3; 3]>,
    single: Vec<Triangle>,
}

impl Bvh {
    /// Builds the hierarchy; the same for the same triangles.
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
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
        Self { nodes, triangles: ordered, single, tree }
    }

    /// Whether nothing lies on the way from `from` to `to`, both ends left out by `margin` of the way. Ray by ray, by the
    /// crate's own traversal and intersection.
    pub fn visible(&self, from: Vec3, to: Vec3, margin: f32) -> bool {
        let direction = to - from;
        let ray = Ray::new(from.to_array().into(), direction.to_array().into(), margin, 1.0 - margin);
        self.tree.ray_traverse_miss(ray, |ray, id| self.single[id].intersect(ray))
    }
}
