//! Skinned and morphed vertices against plain Rust.

use bevy::math::{Affine3A, EulerRot, Quat, Vec3};
use bevy_bounce_shaders::types::{DeformChunk, DeformJob, NONE, SKIN_WORDS, VERTEX_WORDS};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::run;
use bevy_bounce_tests::twins::random::Random;

const JOINTS: usize = 5;
const TARGETS: usize = 3;
const VERTICES: usize = 150;

fn rows(matrix: &Affine3A) -> [[f32; 4]; 3] {
    let turned = matrix.matrix3.transpose();
    std::array::from_fn(|i| [turned.col(i).x, turned.col(i).y, turned.col(i).z, matrix.translation[i]])
}

fn random_affine(random: &mut Random) -> Affine3A {
    let v = random.vector() * 3.0;
    let turn = Quat::from_euler(EulerRot::XYZ, v.x, v.y, v.z);
    Affine3A::from_scale_rotation_translation(Vec3::splat(0.5 + random.unit()), turn, random.vector() * 4.0)
}

/// A mesh with its skin and morph targets, and where its vertices should stand.
struct Case {
    positions: Vec<Vec3>,
    joints: Vec<[u16; 4]>,
    weights: Vec<[u16; 4]>,
    deltas: Vec<Vec<Vec3>>,
    pose: Vec<Affine3A>,
    morph_weights: Vec<f32>,
    world: Affine3A,
}

impl Case {
    fn new(skinned: bool, morphed: bool) -> Self {
        let mut random = Random::new(13 + u64::from(skinned) + 2 * u64::from(morphed));
        let morph_weights = if morphed { vec![0.7, 0.0, -0.4] } else { Vec::new() };
        let mut weights = || {
            let raw: [f32; 4] = std::array::from_fn(|_| random.unit() + 1e-3);
            let sum: f32 = raw.iter().sum();
            raw.map(|weight| (weight / sum * 65535.0).round() as u16)
        };
        let weights = (0..VERTICES).map(|_| weights()).collect();
        Self {
            positions: (0..VERTICES).map(|_| random.vector()).collect(),
            joints: (0..VERTICES).map(|_| std::array::from_fn(|_| random.below(JOINTS as u32) as u16)).collect(),
            weights,
            deltas: (0..TARGETS).map(|_| (0..VERTICES).map(|_| random.vector()).collect()).collect(),
            pose: if skinned { (0..JOINTS).map(|_| random_affine(&mut random)).collect() } else { Vec::new() },
            morph_weights,
            world: random_affine(&mut random),
        }
    }

    fn expected(&self, vertex: usize) -> Vec3 {
        let morphs = self.morph_weights.iter().zip(&self.deltas);
        let position = self.positions[vertex] + morphs.map(|(weight, deltas)| *weight * deltas[vertex]).sum::<Vec3>();
        if self.pose.is_empty() {
            return self.world.transform_point3(position);
        }
        let sum: f32 = self.weights[vertex].iter().map(|weight| f32::from(*weight)).sum();
        let joints = self.joints[vertex].iter().zip(&self.weights[vertex]);
        joints.map(|(j, w)| self.pose[usize::from(*j)].transform_point3(position) * (f32::from(*w) / sum)).sum()
    }

    /// Buffers of the kernel, the mesh somewhere within them, and the first word of the result.
    fn bind(&self) -> (Resources, usize) {
        let mut geometry = vec![7; 32];
        let vertex_offset = geometry.len() as u32;
        for position in &self.positions {
            geometry.extend(position.to_array().map(f32::to_bits));
            geometry.push(0);
        }
        assert_eq!(geometry.len() - vertex_offset as usize, VERTICES * VERTEX_WORDS as usize);
        let skin_offset = if self.pose.is_empty() { NONE } else { geometry.len() as u32 };
        for (joints, weights) in self.joints.iter().zip(&self.weights) {
            let pack = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
            let skin = [joints, weights].map(|four| [pack(four[0], four[1]), pack(four[2], four[3])]);
            assert_eq!(skin.as_flattened().len(), SKIN_WORDS as usize);
            geometry.extend(skin.as_flattened());
        }
        let morph_offset = geometry.len() as u32;
        for delta in self.deltas.iter().flatten() {
            geometry.extend(delta.to_array().map(f32::to_bits));
        }
        let deformed_offset = geometry.len() as u32;
        geometry.resize(geometry.len() + VERTICES * 3, 0);
        let mut pose = vec![9.0; 24];
        let joint_offset = pose.len() as u32;
        pose.extend(self.pose.iter().flat_map(|joint| rows(joint).concat()));
        let weight_offset = pose.len() as u32;
        pose.extend(&self.morph_weights);
        let [x, y, z] = rows(&self.world);
        let job = DeformJob {
            world_from_local_x: x.into(),
            world_from_local_y: y.into(),
            world_from_local_z: z.into(),
            vertex_offset,
            vertex_count: VERTICES as u32,
            skin_offset,
            morph_offset,
            deformed_offset,
            joint_offset,
            joint_count: self.pose.len() as u32,
            weight_offset,
            weight_count: self.morph_weights.len() as u32,
            ..Default::default()
        };
        let chunk = |first_vertex| DeformChunk { job: 1, first_vertex };
        let idle = DeformChunk { job: NONE, first_vertex: 0 };
        let resources = Resources::new(gpu())
            .words("geometry", &geometry)
            .structs("jobs", &[DeformJob::default(), job])
            .structs("chunks", &[chunk(0), idle, chunk(64), chunk(128)])
            .floats("pose", &pose);
        (resources, deformed_offset as usize)
    }
}

#[test]
fn deformed_vertices_stand_where_bevy_draws_them() {
    for (skinned, morphed) in [(false, true), (true, false), (true, true)] {
        let case = Case::new(skinned, morphed);
        let (resources, deformed) = case.bind();
        let before = resources.read_words("geometry").expect("reads back");
        run(gpu(), "scene/deform.wgsl", "deform", &resources, [4, 1, 1]);
        let after = resources.read_words("geometry").expect("reads back");
        assert!(before[..deformed] == after[..deformed], "what is not deformed is left alone");
        for (vertex, words) in after[deformed..].as_chunks::<3>().0.iter().enumerate() {
            let (found, expected) = (Vec3::from(words.map(f32::from_bits)), case.expected(vertex));
            let error = found.distance(expected);
            assert!(error < 2e-4, "vertex {vertex}, skinned {skinned}, morphed {morphed}: {found}, not {expected}");
        }
    }
}
