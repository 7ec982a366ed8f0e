//! Skinned and morphed meshes: their poses, and where their deformed vertices lie.
//!
//! Each such instance has a deformed copy of its vertices in the geometry buffer, in world space, written by
//! `scene/deform.wgsl` in the frame in which its pose changed. Poses come from the main world after its transforms were
//! propagated, so that they are this frame's. As in Bevy a skinned mesh stands where its joints are, whatever its own
//! transform, and a joint that is missing does not move. Joint weights are normalised.

use std::ops::Range;

use bevy::camera::visibility::InheritedVisibility;
use bevy::math::Affine3A;
use bevy::mesh::morph::{MeshMorphWeights, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{DEFORMED_WORDS, DeformChunk, DeformJob, NONE};

use super::VoxelizedMesh;
use super::bounds::Bounds;
use super::extract::{ExtractedInstance, SceneCameras, spawn_order};
use super::instances::Instances;
use super::meshes::{Geometry, MeshEntry, Meshes};
use super::passes::ScenePipelines;
use super::table::GpuTable;
use crate::compute::MAX_WORKGROUPS;

/// Vertices a workgroup deforms.
const CHUNK_VERTICES: u32 = 64;
/// Floats of a joint matrix: three rows.
const JOINT_FLOATS: usize = 12;

/// How an instance is bent this frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Pose {
    /// World from mesh, by joint.
    pub joints: Vec<Affine3A>,
    /// By morph target.
    pub weights: Vec<f32>,
}

impl Pose {
    fn is_finite(&self) -> bool {
        self.joints.iter().all(|joint| joint.is_finite()) && self.weights.iter().all(|weight| weight.is_finite())
    }

    fn words(&self) -> impl Iterator<Item = f32> {
        let rows = |joint: &Affine3A| rows(joint).into_iter().flat_map(|row| row.to_array());
        self.joints.iter().flat_map(rows).chain(self.weights.iter().copied())
    }
}

/// Rows of an affine matrix.
pub(super) fn rows(transform: &Affine3A) -> [Vec4; 3] {
    let (matrix, offset) = (transform.matrix3, transform.translation);
    [0, 1, 2].map(|i| Vec4::new(matrix.x_axis[i], matrix.y_axis[i], matrix.z_axis[i], offset[i]))
}

/// The poses of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedPoses {
    poses: Vec<(Entity, Pose)>,
}

/// Reads the poses of all that may take part.
pub(super) fn extract_poses(
    mut extracted: ResMut<ExtractedPoses>,
    cameras: Res<SceneCameras>,
    meshes: Extract<
        Query<
            (Entity, &InheritedVisibility, Option<&VoxelizedMesh>, Option<&SkinnedMesh>, Option<&MeshMorphWeights>),
            (With<Mesh3d>, Or<(With<SkinnedMesh>, With<MeshMorphWeights>)>),
        >,
    >,
    transforms: Extract<Query<&GlobalTransform>>,
    bindposes: Extract<Res<Assets<SkinnedMeshInverseBindposes>>>,
    morph_weights: Extract<Query<&MorphWeights>>,
) {
    extracted.poses.clear();
    if !cameras.active {
        return;
    }
    for (entity, visibility, voxelized, skin, morph) in &meshes {
        if !visibility.get() || voxelized.is_some_and(|voxelized| !voxelized.enabled) {
            continue;
        }
        let joints = skin.map_or_else(Vec::new, |skin| joint_matrices(skin, &bindposes, &transforms));
        let weights = match morph {
            Some(MeshMorphWeights::Value { weights }) => weights.as_slice(),
            Some(MeshMorphWeights::Reference(source)) => {
                morph_weights.get(*source).map_or(&[][..], |weights| weights.weights())
            }
            None => &[],
        };
        extracted.poses.push((entity, Pose { joints, weights: weights.to_vec() }));
    }
    extracted.poses.sort_by_key(|(entity, _)| spawn_order(*entity));
}

/// As bevy_pbr's `extract_skins`.
fn joint_matrices(
    skin: &SkinnedMesh,
    bindposes: &Assets<SkinnedMeshInverseBindposes>,
    transforms: &Query<&GlobalTransform>,
) -> Vec<Affine3A> {
    let bindposes = bindposes.get(&skin.inverse_bindposes);
    skin.joints
        .iter()
        .enumerate()
        .map(|(index, joint)| match (bindposes.and_then(|bindposes| bindposes.get(index)), transforms.get(*joint)) {
            (Some(bindpose), Ok(joint)) => joint.affine() * Affine3A::from_mat4(*bindpose),
            _ => Affine3A::IDENTITY,
        })
        .collect()
}

/// The deformed copy of an instance's vertices.
#[derive(Debug)]
pub(super) struct Deformed {
    range: Range<u32>,
    /// What the copy was last made from; `None` where it must be made anew.
    made_from: Option<(Pose, Affine3A)>,
    /// Box of the copy, world; empty while there is nothing to show.
    pub bounds: Bounds,
}

impl Deformed {
    /// First vertex, in words of the geometry buffer.
    pub fn offset(&self) -> u32 {
        self.range.start
    }
}

/// What an instance is made of, as far as it can bend.
#[derive(Debug, Default)]
pub(super) enum Shape {
    /// As the mesh is.
    #[default]
    Rigid,
    /// It will bend once its pose is known.
    Pending,
    /// By its deformed copy.
    Deformed(Deformed),
}

impl Shape {
    /// Of a new instance, or one whose mesh is another.
    pub fn of(source: &ExtractedInstance) -> Self {
        if source.deforms { Self::Pending } else { Self::Rigid }
    }

    /// Gives its room back.
    pub fn free(self, geometry: &mut Geometry) {
        if let Self::Deformed(deformed) = self {
            geometry.free(deformed.range);
        }
    }
}

/// What `scene/deform.wgsl` does this frame.
#[derive(Resource)]
pub(super) struct DeformJobs {
    /// One an instance whose pose changed.
    pub jobs: GpuTable<DeformJob>,
    /// Workgroups.
    pub chunks: GpuTable<DeformChunk>,
    /// Joint matrices and morph weights.
    pub pose: GpuTable<f32>,
}

impl Default for DeformJobs {
    fn default() -> Self {
        Self {
            jobs: GpuTable::new("bounce_deform_jobs"),
            chunks: GpuTable::new("bounce_deform_chunks"),
            pose: GpuTable::new("bounce_deform_pose"),
        }
    }
}

impl DeformJobs {
    /// What its buffers hold on the GPU, bytes.
    pub fn bytes(&self) -> u64 {
        let buffers = [self.jobs.buffer(), self.chunks.buffer(), self.pose.buffer()];
        buffers.into_iter().flatten().map(|buffer| buffer.size()).sum()
    }

    /// The device the buffers were made on is gone.
    pub fn lose_buffers(&mut self) {
        self.jobs.lose_buffer();
        self.chunks.lose_buffer();
        self.pose.lose_buffer();
    }
}

/// Finds the instances whose pose changed, and gives them room and a job.
pub(super) fn update_deformed(
    mut instances: ResMut<Instances>,
    mut deform: ResMut<DeformJobs>,
    mut geometry: ResMut<Geometry>,
    mut extracted: ResMut<ExtractedPoses>,
    meshes: Res<Meshes>,
    pipelines: Res<ScenePipelines>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let mut jobs = Vec::new();
    let mut words = Vec::new();
    let ready = pipelines.deform.is_ready(&cache);
    for (entity, pose) in extracted.poses.drain(..).filter(|_| ready) {
        let Some((slot, shape, mesh_id, transform)) = instances.shape_mut(entity) else { continue };
        let Some(mesh) = meshes.get(mesh_id) else { continue };
        let (pose, transform) = fitted(pose, transform, mesh);
        if pose == Pose::default() {
            if !matches!(shape, Shape::Rigid) {
                std::mem::take(shape).free(&mut geometry);
                instances.mark(slot);
            }
            continue;
        }
        if !matches!(shape, Shape::Deformed(_)) {
            let room = u64::from(mesh.vertex_count) * u64::from(DEFORMED_WORDS);
            let Some(range) = geometry.allocate(room, &device, &queue) else { continue };
            *shape = Shape::Deformed(Deformed { range, made_from: None, bounds: Bounds::EMPTY });
        }
        let Shape::Deformed(deformed) = shape else { continue };
        if deformed.made_from.as_ref().is_some_and(|from| from.0 == pose && from.1 == transform) {
            continue;
        }
        deformed.bounds = Bounds::EMPTY;
        if pose.is_finite() && transform.is_finite() {
            deformed.bounds = deformed_bounds(mesh, &pose, &transform);
            jobs.push(job(mesh, &pose, &transform, deformed.range.start, words.len()));
            words.extend(pose.words());
        }
        deformed.made_from = Some((pose, transform));
        instances.mark(slot);
    }
    deform.chunks.replace(chunks(&jobs).into_iter());
    deform.jobs.replace(jobs.into_iter());
    deform.pose.replace(words.into_iter());
    if !deform.chunks.values().is_empty() {
        deform.chunks.upload(&device, &queue);
        deform.jobs.upload(&device, &queue);
        deform.pose.upload(&device, &queue);
    }
}

/// The part of a pose that moves a mesh; nothing for a mesh that cannot bend. A skin takes the place of the transform.
fn fitted(mut pose: Pose, transform: Affine3A, mesh: &MeshEntry) -> (Pose, Affine3A) {
    if mesh.skin_offset.is_none() {
        pose.joints.clear();
    }
    pose.weights.truncate(mesh.morph_bounds.len());
    let transform = if pose.joints.is_empty() { transform } else { Affine3A::IDENTITY };
    (pose, transform)
}

fn job(mesh: &MeshEntry, pose: &Pose, transform: &Affine3A, deformed_offset: u32, words: usize) -> DeformJob {
    let [x, y, z] = rows(transform);
    DeformJob {
        world_from_local_x: x,
        world_from_local_y: y,
        world_from_local_z: z,
        vertex_offset: mesh.vertex_offset,
        vertex_count: mesh.vertex_count,
        skin_offset: mesh.skin_offset.filter(|_| !pose.joints.is_empty()).unwrap_or(NONE),
        morph_offset: mesh.morph_offset,
        deformed_offset,
        joint_offset: words as u32,
        joint_count: pose.joints.len() as u32,
        weight_offset: (words + pose.joints.len() * JOINT_FLOATS) as u32,
        weight_count: pose.weights.len() as u32,
        ..default()
    }
}

/// Workgroups for all jobs; where they fold into a second axis the last row is filled up.
fn chunks(jobs: &[DeformJob]) -> Vec<DeformChunk> {
    let mut chunks: Vec<_> = (0u32..)
        .zip(jobs)
        .flat_map(|(job, work)| {
            (0..work.vertex_count)
                .step_by(CHUNK_VERTICES as usize)
                .map(move |first_vertex| DeformChunk { job, first_vertex })
        })
        .collect();
    let row = MAX_WORKGROUPS as usize;
    if chunks.len() > row {
        chunks.resize(chunks.len().next_multiple_of(row), DeformChunk { job: NONE, first_vertex: 0 });
    }
    chunks
}

/// A box round the deformed vertices: that of the morphed mesh, or that of what follows each joint, where the joint is.
fn deformed_bounds(mesh: &MeshEntry, pose: &Pose, transform: &Affine3A) -> Bounds {
    let deltas = mesh
        .morph_bounds
        .iter()
        .zip(&pose.weights)
        .fold(Bounds { min: Vec3::ZERO, max: Vec3::ZERO }, |sum, (target, weight)| sum.sum(&target.scaled(*weight)));
    let Some(last_joint) = pose.joints.len().checked_sub(1) else {
        return mesh.bounds.sum(&deltas).transformed(transform);
    };
    mesh.joint_bounds.iter().fold(Bounds::EMPTY, |bounds, (joint, part)| {
        let joint = &pose.joints[usize::from(*joint).min(last_joint)];
        bounds.union(&part.sum(&deltas).transformed(joint))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_every_vertex_and_fill_their_last_row() {
        let job = |vertex_count| DeformJob { vertex_count, ..default() };
        let found: Vec<_> = chunks(&[job(65), job(0), job(1)]).iter().map(|c| (c.job, c.first_vertex)).collect();
        assert_eq!(found, [(0, 0), (0, 64), (2, 0)]);
        let many = chunks(&[job(64 * 65535 + 1)]);
        assert_eq!((many.len(), many[65536].job), (2 * 65535, NONE));
    }
}
