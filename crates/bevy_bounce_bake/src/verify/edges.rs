//! Silhouettes.

use std::collections::HashMap;

use glam::Vec3;

use crate::rays::Bvh;

/// The edges of all triangles that stop light.
pub struct Edges<'a> {
    bvh: &'a Bvh<'a>,
    edges: Vec<Edge>,
    /// Of each triangle of the hierarchy.
    of_triangle: Vec<[u32; 3]>,
}

struct Edge {
    ends: [Vec3; 2],
    /// Normals of its two triangles, as they would be wound alike; none where there is but one, or more than two.
    normals: Option<[Vec3; 2]>,
}

/// Rays from a point within an angle of each other.
#[derive(Clone, Copy)]
pub struct Cone {
    /// World units.
    pub origin: Vec3,
    /// Unit length.
    pub axis: Vec3,
    /// Of half the opening angle.
    pub tangent: f32,
}

impl Cone {
    /// Whether a ball may reach into the cone.
    fn meets(&self, center: Vec3, radius: f32) -> bool {
        let offset = center - self.origin;
        let along = offset.dot(self.axis);
        let across = (offset - along * self.axis).length();
        // The slanted side is farther than the distance across suggests.
        let slant = (1.0 + self.tangent * self.tangent).sqrt();
        across - along * self.tangent <= radius * slant && along >= -radius
    }

    fn holds(&self, point: Vec3) -> bool {
        let offset = point - self.origin;
        let along = offset.dot(self.axis);
        along > 0.0 && (offset - along * self.axis).length() <= along * self.tangent
    }
}

impl<'a> Edges<'a> {
    /// Of the hierarchy's triangles. Corners at the same place are one.
    pub fn new(bvh: &'a Bvh<'a>) -> Self {
        let (mut edges, mut known): (Vec<(Edge, u32)>, HashMap<_, u32>) = (Vec::new(), HashMap::new());
        let key = |point: Vec3| (point + Vec3::ZERO).to_array().map(f32::to_bits);
        let mut of_triangle = Vec::new();
        for &[a, b, c] in &bvh.triangles {
            let normal = (b - a).cross(c - a);
            of_triangle.push([[a, b], [b, c], [c, a]].map(|ends| {
                let [from, to] = ends.map(key);
                let turned = from > to;
                let number = *known.entry(if turned { (to, from) } else { (from, to) }).or_insert(edges.len() as u32);
                // Neighbours that are wound alike go along the edge in opposite directions.
                let normal = if turned { -normal } else { normal };
                match edges.get_mut(number as usize) {
                    None => edges.push((Edge { ends, normals: Some([normal, Vec3::ZERO]) }, 1)),
                    Some((edge, count)) => {
                        *count += 1;
                        edge.normals = edge.normals.filter(|_| *count == 2).map(|[first, _]| [first, -normal]);
                    }
                }
                number
            }));
        }
        let whole = |(edge, count): (Edge, u32)| Edge { normals: edge.normals.filter(|_| count == 2), ..edge };
        Self { bvh, edges: edges.into_iter().map(whole).collect(), of_triangle }
    }

    /// Whether a silhouette of what a map knows passes through the cone: an edge where a surface that faces the tip ends, or
    /// meets one that does not, with at most one surface before it. `lift` is how far from a surface is on it, in world units.
    pub fn silhouette_in(&self, cone: &Cone, lift: f32) -> bool {
        let mut open = vec![0];
        while let Some(index) = open.pop() {
            let node = self.bvh.nodes[index as usize];
            if !cone.meets(0.5 * (node.min + node.max), 0.5 * node.min.distance(node.max)) {
                continue;
            }
            if node.count == 0 {
                open.extend([node.first, node.first + 1]);
                continue;
            }
            let triangles = &self.of_triangle[node.first as usize..(node.first + node.count) as usize];
            if triangles.as_flattened().iter().any(|&edge| self.edges[edge as usize].known_in(cone, self.bvh, lift)) {
                return true;
            }
        }
        false
    }
}

impl Edge {
    fn known_in(&self, cone: &Cone, bvh: &Bvh, lift: f32) -> bool {
        let [from, to] = self.ends;
        if let Some([first, second]) = self.normals {
            let side = |normal: Vec3| (cone.origin - from).dot(normal) > 0.0;
            if side(first) == side(second) {
                return false;
            }
        }
        // Where the edge comes nearest to the axis: there the plane through both cuts it.
        let (way, offset) = (to - from, from - cone.origin);
        let across = |vector: Vec3| vector - cone.axis * vector.dot(cone.axis);
        let (way_across, offset_across) = (across(way), across(offset));
        let at = -offset_across.dot(way_across) / way_across.length_squared().max(f32::MIN_POSITIVE);
        let nearest = from + way * at.clamp(0.0, 1.0);
        // A little beside the edge, so that its own surface is not in the way by rounding.
        let distance = cone.origin.distance(nearest);
        cone.holds(nearest) && bvh.surfaces_between(cone.origin, nearest, (4.0 * lift / distance).min(0.5)) < 2
    }
}
