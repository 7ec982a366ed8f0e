//! The voxel grids, of the world and of groups.

use bevy::math::{UVec3, Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

use super::REGIONS;

/// Where the voxel grid lies: the finest of several, each within the next.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Grid {
    /// World position of its lowest corner.
    pub origin: Vec3,
    /// Edge of a voxel, world units.
    pub voxel_size: f32,
    /// Voxels along each axis.
    pub dims: UVec3,
    /// Cells (voxel and facing) there is room for in all.
    pub cell_capacity: u32,
    /// Those around it.
    pub further: [GridLevel; FURTHER_LEVELS],
    /// How many of them there are.
    pub further_count: u32,
}

/// Grids around the finest one, at most.
pub const FURTHER_LEVELS: usize = REGIONS - 1;

/// One of the nested grids, and where it begins in the buffers that hold all.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct GridLevel {
    /// World position of its lowest corner.
    pub origin: Vec3,
    /// Edge of a voxel, world units.
    pub voxel_size: f32,
    /// Voxels along each axis.
    pub dims: UVec3,
    /// Voxels of the levels before it.
    pub first_voxel: u32,
    /// Their bricks.
    pub first_brick: u32,
    /// Their blocks of 2^3 voxels.
    pub first_block: u32,
    /// What a voxel's word counts its cells from.
    pub first_cell: u32,
    /// Makes it 48 bytes.
    pub padding: u32,
}

/// Groups of meshes that may have a grid of their own at a time, at most; as many grids.
pub const VOXEL_GROUPS: usize = 32;

/// Edge of the largest grid of a group, voxels. Each has as much room.
pub const GROUP_EDGE: u32 = 32;

/// A group of meshes with a grid of its own, as it stands in the world.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VoxelGroup {
    /// First row of the affine matrix from the world to the voxels of its grid.
    pub voxels_from_world_x: Vec4,
    /// Second row.
    pub voxels_from_world_y: Vec4,
    /// Third row.
    pub voxels_from_world_z: Vec4,
    /// Voxels along each axis.
    pub dims: UVec3,
    /// Where its voxels begin in the buffer that holds all.
    pub first_voxel: u32,
    /// Where its cells begin.
    pub first_cell: u32,
    /// One over the determinant of the matrix: volume of a voxel in the world, negative where the group is mirrored.
    pub inverse_determinant: f32,
    /// Largest component of the radiance that any of its materials emits, cd/m^2.
    pub max_emission: f32,
    /// Radius of a sphere round its grid, world units.
    pub radius: f32,
    /// Middle of that, world position.
    pub middle: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
}

/// All groups.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VoxelGroups {
    /// Groups.
    pub count: u32,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
    /// In the order of their entities.
    pub groups: [VoxelGroup; VOXEL_GROUPS],
}

/// One facing of a voxel: the mean of the surfaces in it that look that way.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Cell {
    /// RGBA8 unorm: linear albedo; alpha unused.
    pub albedo: u32,
    /// Octahedral mean normal, 2 snorm16.
    pub normal: u32,
    /// 2 f16: signed distance of the mean plane from the voxel's centre along the normal, in voxels; surface area in the
    /// voxel, in voxel faces.
    pub plane_area: u32,
    /// Bounds of the surfaces within the voxel, 5 bits each: low x, y, z, high x, y, z.
    pub bounds: u32,
}
