//! An elephant out of tubes: a skeleton, and a mesh whose rings hang on it.

use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;

/// Number of joints.
pub const JOINTS: usize = 16;

/// How finely tubes are divided.
#[derive(Clone, Copy, Debug)]
pub struct Detail {
    /// Vertices round a tube.
    sides: usize,
    /// Rings from a key ring to the next.
    steps: usize,
}

impl Detail {
    /// 11,000 triangles, for one that is looked at.
    pub const FINE: Self = Self { sides: 20, steps: 4 };
    /// 2,000 triangles, for one of many.
    pub const COARSE: Self = Self { sides: 8, steps: 1 };
}

/// A joint at rest: its parent, and where it is in the animal's space, metres. The animal looks along +z.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// Index of its parent; the first has none.
    pub parent: Option<usize>,
    /// Place at rest.
    pub rest: Vec3,
}

/// Indices of joints.
pub mod joint {
    /// Root.
    pub const SPINE: usize = 0;
    /// Child of the spine.
    pub const HEAD: usize = 1;
    /// First of three down the trunk.
    pub const TRUNK: usize = 2;
    /// Left, then right.
    pub const EARS: usize = 5;
    /// Child of the spine.
    pub const TAIL: usize = 7;
    /// Hip and knee of the front left, front right, rear left, rear right leg.
    pub const LEGS: usize = 8;
}

/// Where legs join the body: left is +x.
const HIPS: [Vec3; 4] = [
    Vec3::new(0.22, 0.82, 0.46),
    Vec3::new(-0.22, 0.82, 0.46),
    Vec3::new(0.22, 0.82, -0.54),
    Vec3::new(-0.22, 0.82, -0.54),
];
const KNEE: f32 = 0.42;

/// The skeleton at rest; parents come before their children.
pub fn skeleton() -> [Joint; JOINTS] {
    let at = |parent: usize, x: f32, y: f32, z: f32| Joint { parent: Some(parent), rest: Vec3::new(x, y, z) };
    let hip = |leg: usize| Joint { parent: Some(joint::SPINE), rest: HIPS[leg] };
    let knee = |leg: usize| Joint { parent: Some(joint::LEGS + 2 * leg), rest: HIPS[leg].with_y(KNEE) };
    [
        Joint { parent: None, rest: Vec3::new(0.0, 1.05, 0.0) },
        at(joint::SPINE, 0.0, 1.24, 0.62),
        at(joint::HEAD, 0.0, 1.1, 1.06),
        at(joint::TRUNK, 0.0, 0.8, 1.15),
        at(joint::TRUNK + 1, 0.0, 0.52, 1.17),
        at(joint::HEAD, 0.2, 1.36, 0.74),
        at(joint::HEAD, -0.2, 1.36, 0.74),
        at(joint::SPINE, 0.0, 1.2, -0.8),
        hip(0),
        knee(0),
        hip(1),
        knee(1),
        hip(2),
        knee(2),
        hip(3),
        knee(3),
    ]
}

/// A cross-section: an ellipse about `center`, carried by joints with these weights.
#[derive(Clone, Copy)]
struct Ring {
    center: Vec3,
    radii: Vec2,
    weights: [f32; JOINTS],
}

fn ring(center: [f32; 3], radii: [f32; 2], weights: &[(usize, f32)]) -> Ring {
    let mut all = [0.0; JOINTS];
    weights.iter().for_each(|(joint, weight)| all[*joint] = *weight);
    Ring { center: center.into(), radii: radii.into(), weights: all }
}

/// Skin and tusks, both carried by [`skeleton`].
pub fn meshes(detail: Detail) -> (Mesh, Mesh) {
    use joint::{EARS, HEAD, LEGS, SPINE, TAIL, TRUNK};
    let mut skin = Tubes::new(detail);
    skin.add(
        Vec3::X,
        [0.6, 0.3],
        &[
            ring([0.0, 1.08, -0.8], [0.2, 0.24], &[(SPINE, 1.0)]),
            ring([0.0, 1.06, -0.6], [0.33, 0.38], &[(SPINE, 1.0)]),
            ring([0.0, 1.02, -0.15], [0.39, 0.44], &[(SPINE, 1.0)]),
            ring([0.0, 1.05, 0.3], [0.37, 0.41], &[(SPINE, 1.0)]),
            ring([0.0, 1.14, 0.56], [0.29, 0.34], &[(SPINE, 0.8), (HEAD, 0.2)]),
            ring([0.0, 1.22, 0.74], [0.22, 0.26], &[(SPINE, 0.4), (HEAD, 0.6)]),
        ],
    );
    skin.add(
        Vec3::X,
        [0.8, 0.4],
        &[
            ring([0.0, 1.28, 0.62], [0.2, 0.22], &[(HEAD, 1.0)]),
            ring([0.0, 1.33, 0.78], [0.25, 0.28], &[(HEAD, 1.0)]),
            ring([0.0, 1.27, 0.96], [0.19, 0.22], &[(HEAD, 1.0)]),
            ring([0.0, 1.16, 1.06], [0.12, 0.14], &[(HEAD, 1.0)]),
        ],
    );
    skin.add(
        Vec3::X,
        [0.5, 0.3],
        &[
            ring([0.0, 1.24, 0.98], [0.13, 0.13], &[(HEAD, 1.0)]),
            ring([0.0, 1.08, 1.08], [0.115, 0.115], &[(HEAD, 0.6), (TRUNK, 0.4)]),
            ring([0.0, 0.88, 1.14], [0.1, 0.1], &[(TRUNK, 0.8), (TRUNK + 1, 0.2)]),
            ring([0.0, 0.68, 1.17], [0.085, 0.085], &[(TRUNK, 0.2), (TRUNK + 1, 0.8)]),
            ring([0.0, 0.46, 1.17], [0.07, 0.07], &[(TRUNK + 1, 0.4), (TRUNK + 2, 0.6)]),
            ring([0.0, 0.28, 1.2], [0.06, 0.06], &[(TRUNK + 2, 1.0)]),
            ring([0.0, 0.2, 1.27], [0.05, 0.05], &[(TRUNK + 2, 1.0)]),
        ],
    );
    for (leg, hip) in HIPS.iter().enumerate() {
        let (upper, lower) = (LEGS + 2 * leg, LEGS + 2 * leg + 1);
        let at = |y: f32| [hip.x, y, hip.z];
        skin.add(
            Vec3::X,
            [0.5, 0.08],
            &[
                ring(at(1.0), [0.14, 0.18], &[(SPINE, 0.7), (upper, 0.3)]),
                ring(at(0.78), [0.145, 0.165], &[(SPINE, 0.2), (upper, 0.8)]),
                ring(at(0.54), [0.12, 0.13], &[(upper, 0.9), (lower, 0.1)]),
                ring(at(KNEE), [0.112, 0.118], &[(upper, 0.5), (lower, 0.5)]),
                ring(at(0.3), [0.11, 0.112], &[(upper, 0.1), (lower, 0.9)]),
                ring(at(0.1), [0.12, 0.125], &[(lower, 1.0)]),
                ring(at(0.01), [0.13, 0.14], &[(lower, 1.0)]),
            ],
        );
    }
    for (ear, side) in [1.0, -1.0].into_iter().enumerate() {
        let ear = EARS + ear;
        skin.add(
            Vec3::Z,
            [0.2, 0.3],
            &[
                ring([0.18 * side, 1.37, 0.76], [0.035, 0.13], &[(HEAD, 0.7), (ear, 0.3)]),
                ring([0.34 * side, 1.33, 0.68], [0.03, 0.25], &[(ear, 1.0)]),
                ring([0.5 * side, 1.25, 0.6], [0.022, 0.2], &[(ear, 1.0)]),
            ],
        );
    }
    skin.add(
        Vec3::X,
        [0.5, 0.5],
        &[
            ring([0.0, 1.22, -0.76], [0.05, 0.05], &[(SPINE, 1.0)]),
            ring([0.0, 1.06, -0.88], [0.035, 0.035], &[(TAIL, 1.0)]),
            ring([0.0, 0.76, -0.93], [0.02, 0.02], &[(TAIL, 1.0)]),
            ring([0.0, 0.62, -0.93], [0.035, 0.035], &[(TAIL, 1.0)]),
        ],
    );
    let mut tusks = Tubes::new(detail);
    for side in [1.0, -1.0] {
        tusks.add(
            Vec3::X,
            [0.2, 0.8],
            &[
                ring([0.11 * side, 1.1, 0.99], [0.035, 0.035], &[(HEAD, 1.0)]),
                ring([0.14 * side, 0.97, 1.12], [0.032, 0.032], &[(HEAD, 1.0)]),
                ring([0.15 * side, 0.92, 1.26], [0.024, 0.024], &[(HEAD, 1.0)]),
                ring([0.14 * side, 0.96, 1.38], [0.01, 0.01], &[(HEAD, 1.0)]),
            ],
        );
    }
    (skin.mesh(), tusks.mesh())
}

struct Tubes {
    detail: Detail,
    positions: Vec<Vec3>,
    weights: Vec<[f32; JOINTS]>,
    indices: Vec<u32>,
}

impl Tubes {
    fn new(detail: Detail) -> Self {
        Self { detail, positions: Vec::new(), weights: Vec::new(), indices: Vec::new() }
    }

    /// A closed tube along the key rings, which lie across their path with their first radius along `across`. The caps
    /// bulge by `caps` times the radius.
    fn add(&mut self, across: Vec3, caps: [f32; 2], keys: &[Ring]) {
        let Detail { sides, steps } = self.detail;
        let rings = smooth(keys, steps);
        let tangent = |index: usize| {
            let (from, to) = (rings[index.saturating_sub(1)], rings[(index + 1).min(rings.len() - 1)]);
            (to.center - from.center).normalize_or(Vec3::Y)
        };
        let first = self.positions.len() as u32;
        let (begin, end) = (rings[0], rings[rings.len() - 1]);
        let (into, out) = (tangent(0), tangent(rings.len() - 1));
        let cap = |ring: Ring, outward: Vec3, bulge: f32, angle: f32| {
            let center = ring.center + outward * bulge * ring.radii.min_element() * angle.sin();
            Ring { center, radii: ring.radii * angle.cos(), ..ring }
        };
        let bends = [1.2, 0.8, 0.4];
        let mut all: Vec<(Ring, Vec3)> = bends.map(|angle| (cap(begin, -into, caps[0], angle), into)).into();
        all.extend(rings.iter().enumerate().map(|(index, ring)| (*ring, tangent(index))));
        all.extend(bends.iter().rev().map(|angle| (cap(end, out, caps[1], *angle), out)));

        self.push(begin.center - into * caps[0] * begin.radii.min_element(), begin.weights);
        for (ring, along) in &all {
            let right = (across - *along * across.dot(*along)).normalize_or(Vec3::X);
            let up = along.cross(right);
            for side in 0..sides {
                let (sin, cos) = (std::f32::consts::TAU * side as f32 / sides as f32).sin_cos();
                self.push(ring.center + right * ring.radii.x * cos + up * ring.radii.y * sin, ring.weights);
            }
        }
        self.push(end.center + out * caps[1] * end.radii.min_element(), end.weights);

        let last = self.positions.len() as u32 - 1;
        let vertex = |ring: usize, side: usize| first + 1 + (ring * sides + side % sides) as u32;
        for side in 0..sides {
            self.indices.extend([first, vertex(0, side + 1), vertex(0, side)]);
            for ring in 0..all.len() - 1 {
                let [a, b, c, d] =
                    [vertex(ring, side), vertex(ring, side + 1), vertex(ring + 1, side + 1), vertex(ring + 1, side)];
                self.indices.extend([a, b, c, a, c, d]);
            }
            self.indices.extend([last, vertex(all.len() - 1, side), vertex(all.len() - 1, side + 1)]);
        }
    }

    fn push(&mut self, position: Vec3, weights: [f32; JOINTS]) {
        self.positions.push(position);
        self.weights.push(weights);
    }

    fn normals(&self) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; self.positions.len()];
        for triangle in self.indices.chunks_exact(3) {
            let [a, b, c] = [triangle[0], triangle[1], triangle[2]].map(|index| self.positions[index as usize]);
            let twice_area = (b - a).cross(c - a);
            triangle.iter().for_each(|index| normals[*index as usize] += twice_area);
        }
        normals.into_iter().map(|normal| normal.normalize_or(Vec3::Y)).collect()
    }

    fn mesh(&self) -> Mesh {
        let (joints, weights): (Vec<[u16; 4]>, Vec<[f32; 4]>) = self.weights.iter().map(strongest).unzip();
        let arrays = |vectors: &[Vec3]| vectors.iter().map(Vec3::to_array).collect::<Vec<_>>();
        Mesh::new(PrimitiveTopology::TriangleList, default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, arrays(&self.positions))
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, arrays(&self.normals()))
            .with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, vec![[0.0, 0.0]; self.positions.len()])
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(joints))
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, weights)
            .with_inserted_indices(Indices::U32(self.indices.clone()))
    }
}

/// The four joints with the largest weights; those sum to one.
fn strongest(weights: &[f32; JOINTS]) -> ([u16; 4], [f32; 4]) {
    let mut order: [usize; JOINTS] = std::array::from_fn(|joint| joint);
    order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]));
    let four = [order[0], order[1], order[2], order[3]];
    let sum = four.iter().map(|joint| weights[*joint]).sum::<f32>().max(f32::MIN_POSITIVE);
    (four.map(|joint| joint as u16), four.map(|joint| weights[joint] / sum))
}

/// Rings from key ring to key ring in so many steps: centres and radii along Catmull-Rom curves, weights straight.
fn smooth(keys: &[Ring], steps: usize) -> Vec<Ring> {
    let key = |index: isize| keys[index.clamp(0, keys.len() as isize - 1) as usize];
    let mut rings = Vec::with_capacity((keys.len() - 1) * steps + 1);
    for segment in 0..keys.len() as isize - 1 {
        let four = [key(segment - 1), key(segment), key(segment + 1), key(segment + 2)];
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            let radii = catmull_rom(four.map(|ring| ring.radii.extend(0.0)), t).truncate();
            rings.push(Ring {
                center: catmull_rom(four.map(|ring| ring.center), t),
                radii: radii.max(Vec2::splat(1e-3)),
                weights: std::array::from_fn(|joint| four[1].weights[joint].lerp(four[2].weights[joint], t)),
            });
        }
    }
    rings.push(keys[keys.len() - 1]);
    rings
}

fn catmull_rom([a, b, c, d]: [Vec3; 4], t: f32) -> Vec3 {
    0.5 * (2.0 * b + (c - a) * t + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t + (3.0 * b - a - 3.0 * c + d) * t * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_vertex_hangs_on_the_skeleton() {
        let meshes = [Detail::FINE, Detail::COARSE].map(meshes);
        for mesh in meshes.into_iter().flat_map(|(skin, tusks)| [skin, tusks]) {
            let Some(VertexAttributeValues::Float32x4(weights)) = mesh.attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT) else {
                panic!("no weights")
            };
            assert!(weights.iter().all(|four| (four.iter().sum::<f32>() - 1.0).abs() < 1e-5));
            let Some(VertexAttributeValues::Float32x3(normals)) = mesh.attribute(Mesh::ATTRIBUTE_NORMAL) else {
                panic!("no normals")
            };
            assert!(normals.iter().all(|normal| (Vec3::from(*normal).length() - 1.0).abs() < 1e-3));
        }
    }

    #[test]
    fn tubes_face_outwards() {
        let mut tubes = Tubes::new(Detail::COARSE);
        let end = |z| ring([0.0, 0.0, z], [1.0, 1.0], &[(0, 1.0)]);
        tubes.add(Vec3::X, [1.0, 1.0], &[end(-1.0), end(1.0)]);
        let outwards =
            tubes.positions.iter().zip(tubes.normals()).filter(|(position, normal)| position.dot(*normal) > 0.0);
        assert_eq!(outwards.count(), tubes.positions.len());
    }
}
