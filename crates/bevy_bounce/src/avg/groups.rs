//! The grids of groups, behind the world's in the same buffers: each has a place of the same size there.
//!
//! A grid is voxelised by the kernels of the world's, bound to its place in the voxels and the cells, over instances in the group's
//! own space.

use bevy::math::{Affine3A, Vec4};
use bevy::prelude::*;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::encase::{ShaderSize, StorageBuffer};
use bevy::render::render_resource::{Buffer, BufferInitDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{GROUP_EDGE, Grid, Scene, VOXEL_GROUPS, VoxelGroup, VoxelGroups};

use super::grid::{PHASE, VoxelGrid, Workspace, extent_of};
use crate::scene::{Bounds, GroupGrid, Groups};
use crate::settings::GiWorldSettings;

/// Voxels that each grid has room for.
pub(super) const GROUP_VOXELS: u64 = (GROUP_EDGE as u64).pow(3);
/// Cells.
pub(crate) const GROUP_CELLS: u64 = GROUP_VOXELS / 2;
/// Groups begin behind so many voxels or cells of the world that they can be bound by themselves, in any buffer that holds words
/// for each: 256 bytes.
pub(crate) fn first_behind(world: u64) -> u64 {
    world.next_multiple_of(64)
}

/// Whether the voxels of the world's grids and of all groups fit one binding.
pub(crate) fn has_room_for_groups(edge: u32, levels: usize, limit: u64) -> bool {
    let world = u64::from(edge).pow(3) * levels.max(1) as u64;
    (first_behind(world) + VOXEL_GROUPS as u64 * GROUP_VOXELS) * 4 <= limit
}

/// What a grid is voxelised from.
pub(crate) struct GroupSource {
    /// Another one where anything of it has changed.
    pub revision: u64,
    /// Instances in the group's space.
    pub instances: Buffer,
    /// All chunks, then how many there are.
    pub chunks: (Buffer, u32),
    /// Those that emit.
    pub emissive_chunks: (Buffer, u32),
    /// Where the grid lies in the group's space.
    pub grid: UniformBuffer<Grid>,
    /// The counts, as the voxeliser reads them.
    pub scene: UniformBuffer<Scene>,
    /// Whether any group has it: only then is its content that of the materials as they are.
    pub is_placed: bool,
    /// Whether it has been voxelised.
    pub is_built: bool,
}

/// All grids of groups.
pub(crate) struct GroupGrids {
    /// Where the groups stand.
    pub uniform: UniformBuffer<VoxelGroups>,
    /// By grid.
    pub sources: Vec<GroupSource>,
    /// Sums and distances of the one that is voxelised.
    pub work: Option<Workspace>,
    /// Grids there is room for.
    pub capacity: usize,
    /// How often a grid has been voxelised.
    pub built: u64,
    /// Where they begin in the voxels.
    pub first_voxel: u64,
    /// Where they begin in the cells.
    pub first_cell: u64,
}

impl GroupGrids {
    /// Behind so many voxels and cells.
    pub fn new(capacity: usize, world_voxels: u64, world_cells: u64) -> Self {
        Self {
            uniform: UniformBuffer::default(),
            sources: Vec::new(),
            work: None,
            capacity,
            built: 0,
            first_voxel: first_behind(world_voxels),
            first_cell: first_behind(world_cells),
        }
    }

    /// Voxels of all, the world's among them.
    pub fn voxel_count(&self) -> u64 {
        self.first_voxel + self.capacity as u64 * GROUP_VOXELS
    }

    /// The same of the cells.
    pub fn cell_count(&self) -> u64 {
        self.first_cell + self.capacity as u64 * GROUP_CELLS
    }

    /// Groups that take part.
    pub fn count(&self) -> u32 {
        self.uniform.get().count
    }

    /// Where a grid's voxels are, bytes.
    pub fn voxel_range(&self, index: usize) -> (u64, u64) {
        ((self.first_voxel + index as u64 * GROUP_VOXELS) * 4, GROUP_VOXELS * 4)
    }

    /// Where its cells are in a buffer with so many bytes a cell, bytes.
    pub fn cell_range(&self, index: usize, bytes: u64) -> (u64, u64) {
        ((self.first_cell + index as u64 * GROUP_CELLS) * bytes, GROUP_CELLS * bytes)
    }

    /// Grids that are to be voxelised.
    pub fn missing(&self) -> impl Iterator<Item = (usize, &GroupSource)> {
        self.sources.iter().enumerate().filter(|(_, source)| source.is_placed && !source.is_built)
    }

    /// Follows the groups of this frame.
    pub fn update(&mut self, groups: &Groups, device: &RenderDevice, queue: &RenderQueue) {
        for (index, grid) in groups.grids.iter().enumerate().take(self.capacity) {
            let is_placed = groups.placed.iter().any(|group| group.grid == index);
            match self.sources.get_mut(index) {
                Some(source) if source.revision == grid.revision || !is_placed => source.is_placed = is_placed,
                Some(source) => *source = GroupSource::new(grid, is_placed, device, queue),
                None => self.sources.push(GroupSource::new(grid, is_placed, device, queue)),
            }
        }
        if self.work.is_none() && self.capacity > 0 {
            self.work = Some(Workspace::new(device, GROUP_VOXELS, GROUP_CELLS, 1));
        }
        let mut placed = VoxelGroups::default();
        let within = groups.placed.iter().filter(|group| group.grid < self.sources.len());
        for (slot, group) in placed.groups.iter_mut().zip(within) {
            let (source, grid) = (&self.sources[group.grid], &groups.grids[group.grid]);
            *slot = VoxelGroup {
                first_voxel: (self.first_voxel + group.grid as u64 * GROUP_VOXELS) as u32,
                first_cell: (self.first_cell + group.grid as u64 * GROUP_CELLS) as u32,
                max_emission: grid.max_emission(),
                ..place(source.grid.get(), &group.world_from_group)
            };
            placed.count += 1;
        }
        if *self.uniform.get() != placed || self.uniform.buffer().is_none() {
            self.uniform.set(placed);
            self.uniform.write_buffer(device, queue);
        }
    }
}

impl GroupSource {
    fn new(grid: &GroupGrid, is_placed: bool, device: &RenderDevice, queue: &RenderQueue) -> Self {
        let chunks = |emissive_only| {
            let chunks = grid.chunks(emissive_only);
            (storage(device, "bounce_group_chunks", &chunks), chunks.len() as u32)
        };
        let (chunks, emissive_chunks) = (chunks(false), chunks(true));
        let scene = Scene {
            chunk_count: chunks.1,
            world_chunk_count: chunks.1,
            emissive_chunk_count: emissive_chunks.1,
            world_emissive_chunk_count: emissive_chunks.1,
            max_emission: grid.max_emission(),
            ..default()
        };
        let mut source = Self {
            revision: grid.revision,
            instances: storage(device, "bounce_group_instances", &grid.instances()),
            chunks,
            emissive_chunks,
            grid: UniformBuffer::from(fit(&grid.bounds(), grid.resolution())),
            scene: UniformBuffer::from(scene),
            is_placed,
            is_built: false,
        };
        source.grid.write_buffer(device, queue);
        source.scene.write_buffer(device, queue);
        source
    }
}

fn storage<T: ShaderType + ShaderSize + WriteInto + Default>(
    device: &RenderDevice,
    label: &'static str,
    values: &[T],
) -> Buffer {
    let mut bytes = StorageBuffer::new(Vec::new());
    let written = if values.is_empty() { bytes.write(&[T::default()].as_slice()) } else { bytes.write(&values) };
    if let Err(error) = written {
        error!("{label}: {error}");
    }
    device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some(label),
        contents: bytes.as_ref(),
        usage: BufferUsages::STORAGE,
    })
}

/// Cubic voxels over what a grid holds, with an empty one all round.
fn fit(bounds: &Bounds, edge: u32) -> Grid {
    // An empty voxel on either side, and what the phase takes.
    let voxel_size = extent_of(bounds.min, bounds.max) / (edge - 3) as f32;
    let low = bounds.min / voxel_size - 1.0 - PHASE;
    let dims = (bounds.max / voxel_size - low).ceil().as_uvec3() + 1;
    Grid {
        origin: low * voxel_size,
        voxel_size,
        dims: dims.min(UVec3::splat(edge)),
        cell_capacity: GROUP_CELLS as u32,
        ..default()
    }
}

/// A grid as it stands in the world.
fn place(grid: &Grid, world_from_group: &Affine3A) -> VoxelGroup {
    let voxels_from_group =
        Affine3A::from_scale_rotation_translation(Vec3::splat(1.0 / grid.voxel_size), Quat::IDENTITY, Vec3::ZERO)
            * Affine3A::from_translation(-grid.origin);
    let voxels_from_world = voxels_from_group * world_from_group.inverse();
    let (matrix, offset) = (voxels_from_world.matrix3, voxels_from_world.translation);
    let row = |i: usize| Vec4::new(matrix.x_axis[i], matrix.y_axis[i], matrix.z_axis[i], offset[i]);
    let half = 0.5 * grid.voxel_size * grid.dims.as_vec3();
    let diagonals = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]].map(|[y, z]| half * Vec3::new(1.0, y, z));
    let reach = |diagonal| world_from_group.transform_vector3(diagonal).length();
    VoxelGroup {
        middle: world_from_group.transform_point3(grid.origin + half),
        radius: diagonals.map(reach).into_iter().fold(0.0, f32::max),
        voxels_from_world_x: row(0),
        voxels_from_world_y: row(1),
        voxels_from_world_z: row(2),
        dims: grid.dims,
        inverse_determinant: 1.0 / matrix.determinant(),
        ..default()
    }
}

/// Groups and their grids, and how often a grid was voxelised: see [`group_counts`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GroupCounts {
    /// Groups that have a grid.
    pub groups: u32,
    /// Grids that they share.
    pub grids: u32,
    /// Times that a grid was voxelised, since there are buffers for them.
    pub voxelized: u64,
}

/// What is known of [`VoxelizedGroup`](crate::VoxelizedGroup)s in the render world; `None` where nothing is voxelised. For
/// measurements.
pub fn group_counts(render_world: &World) -> Option<GroupCounts> {
    render_world.get_resource::<GiWorldSettings>()?.0?;
    let held = &render_world.get_resource::<VoxelGrid>()?.groups;
    let placed = &render_world.get_resource::<Groups>()?.placed;
    let grids: std::collections::BTreeSet<usize> = placed.iter().map(|group| group.grid).collect();
    Some(GroupCounts { groups: held.count(), grids: grids.len() as u32, voxelized: held.built })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_begins_where_it_can_be_bound() {
        let groups = GroupGrids::new(4, 33 * 33 * 33, 1001);
        for index in 0..4 {
            for (offset, size) in
                [groups.voxel_range(index), groups.cell_range(index, 16), groups.cell_range(index, 12)]
            {
                assert!(offset % 256 == 0 && size % 4 == 0 && offset >= 1001 * 12, "{offset}");
            }
        }
        assert_eq!(groups.voxel_range(3).0 + groups.voxel_range(3).1, groups.voxel_count() * 4);
        assert!(has_room_for_groups(128, 4, 1 << 27) && !has_room_for_groups(256, 2, 1 << 27));
    }

    #[test]
    fn a_grid_holds_its_group_with_a_border() {
        for (min, max) in [
            (Vec3::splat(-2.8), Vec3::splat(2.8)),
            (Vec3::new(-18.0, -0.1, -11.0), Vec3::new(19.0, 0.1, 12.0)),
            (Vec3::new(3.0, 4.0, 5.0), Vec3::new(3.0, 9.0, 5.0)),
        ] {
            for edge in [8, 17, 32] {
                let grid = fit(&Bounds { min, max }, edge);
                let low = (min - grid.origin) / grid.voxel_size;
                let high = (max - grid.origin) / grid.voxel_size;
                assert!(low.cmpge(Vec3::splat(0.9)).all(), "{grid:?} {low}");
                assert!(high.cmple(grid.dims.as_vec3() - 0.9).all(), "{grid:?} {high}");
                assert!(grid.dims.max_element() <= edge, "{grid:?}");
            }
        }
    }

    #[test]
    fn a_placed_grid_is_where_the_group_is() {
        let grid = fit(&Bounds { min: Vec3::NEG_ONE, max: Vec3::new(1.0, 2.0, 3.0) }, 32);
        let world_from_group = Affine3A::from_scale_rotation_translation(
            Vec3::new(2.0, -0.5, 1.5),
            Quat::from_rotation_y(0.7),
            Vec3::new(3.0, 4.0, 5.0),
        );
        let placed = place(&grid, &world_from_group);
        let point = Vec3::new(0.3, 1.1, -0.4);
        let world = world_from_group.transform_point3(point).extend(1.0);
        let rows = [placed.voxels_from_world_x, placed.voxels_from_world_y, placed.voxels_from_world_z];
        let voxels = Vec3::from_array(rows.map(|row| row.dot(world)));
        assert!(voxels.abs_diff_eq((point - grid.origin) / grid.voxel_size, 1e-3), "{voxels}");
        let volume = grid.voxel_size.powi(3) * -1.5;
        assert!((placed.inverse_determinant / volume - 1.0).abs() < 1e-4, "{}", placed.inverse_determinant);
    }
}
