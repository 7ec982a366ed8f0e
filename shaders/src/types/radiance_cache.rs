//! Clusters of pixels, radiance caches on them and the light of voxels.

use bevy::math::{UVec2, UVec3, Vec2, Vec3};
use bevy::render::render_resource::ShaderType;

/// Edge of the hemisphere of a radiance cache at its finest level, texels.
pub const CACHE_EDGE: u32 = 16;
/// Edge of its pre-convolved levels, texels.
pub const CACHE_COARSE_EDGE: u32 = 8;
/// Width of what a cache takes of the atlas, texels.
pub const CACHE_WIDTH: u32 = 16;
/// Height of it.
pub const CACHE_HEIGHT: u32 = 32;
/// Caches in a row of the atlas.
pub const CACHES_A_ROW: u32 = 128;
/// Bits of a cluster's key for its slice of depth.
pub const CLUSTER_SLICE_BITS: u32 = 10;
/// Bits of it for the facing.
pub const CLUSTER_FACING_BITS: u32 = 3;

/// The light of the voxels as textures: one for each axis, in which what faces up the axis comes first along x, then a gap,
/// then what faces down.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct LightVolume {
    /// Texels of one half along each axis: the grid's, rounded up to what the coarsest level divides.
    pub dims: UVec3,
    /// Texels between the halves: one of the coarsest level.
    pub gap: u32,
    /// Coarsest level.
    pub last_level: u32,
    /// 1 where virtual lights add further bounces.
    pub further: u32,
    /// Cells of the world, and what is left free behind them: where the light of groups begins, group by group.
    pub first_group_cell: u32,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
}

/// How the pixels of a view are put together into clusters.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheGrid {
    /// Pixels.
    pub size: UVec2,
    /// Tiles along each axis.
    pub tiles: UVec2,
    /// Edge of a tile, pixels.
    pub tile: u32,
    /// Caches there is room for; at least as many as tiles.
    pub capacity: u32,
    /// Slices of depth in a doubling of the distance; of an orthographic view, between its near and far planes.
    pub slices: u32,
    /// 1 where the view is orthographic.
    pub orthographic: u32,
    /// Radius within which a pixel gathers, tiles.
    pub reach: f32,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
}

/// What clustering found.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CacheCounters {
    /// Clusters, each with a cache.
    pub clusters: u32,
    /// Bits of the keys that were left out so that there is room for all.
    pub coarseness: u32,
    /// Clusters that were merged into others for want of room.
    pub merged: u32,
    /// Pixels with a surface.
    pub pixels: u32,
    /// Pixels with a surface that no cache lights.
    pub missing: u32,
    /// By the highest bit in which the keys of neighbours in the order differ: how many do.
    pub differences: [u32; 32],
}

/// Where a cache is.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct RadianceCache {
    /// World position.
    pub position: Vec3,
    /// Within which it lights, world units.
    pub radius: f32,
    /// Unit normal.
    pub normal: Vec3,
    /// How much it counts, for how many pixels it stands: 1 from a quarter of a tile on.
    pub share: f32,
    /// Where it is on the screen, pixels.
    pub screen: Vec2,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
}
