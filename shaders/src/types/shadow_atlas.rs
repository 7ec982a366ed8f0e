//! What is drawn into the shadow maps of virtual lights.

use bevy::math::Vec3;
use bevy::render::render_resource::ShaderType;

/// [`Occluder::flags`]: casts from both sides.
pub const OCCLUDER_TWO_SIDED: u32 = 1;

/// A triangle that casts shadows.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Occluder {
    /// First corner, world space; counter-clockwise as seen from the side that casts.
    pub a: Vec3,
    /// [`OCCLUDER_TWO_SIDED`]; above it, 2 bits of [`OccluderChunk::error`]; 8 bits of the largest share of any part of
    /// it that is there, in 255ths, 0 where all of it is; 21 bits that are the triangle's own.
    pub flags: u32,
    /// Second corner.
    pub b: Vec3,
    /// The baked object that it is part of, or `NONE`; nothing where no bakes are asked.
    pub object: u32,
    /// Third corner.
    pub c: Vec3,
    /// How much of each of its 16 parts is there where it has holes, in thirds of that share, 2 bits each.
    pub cover: u32,
}

/// Up to [`CHUNK_TRIANGLES`](super::CHUNK_TRIANGLES) occluders of one mesh.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct OccluderChunk {
    /// Index into the instances.
    pub instance: u32,
    /// First index, in words of the geometry buffer.
    pub first_index: u32,
    /// Where the triangles go in the list of occluders.
    pub first_occluder: u32,
    /// Triangles.
    pub triangle_count: u32,
    /// How far they may be off the surface: the root of the share of [`AtlasParameters::error`], in thirds.
    pub error: u32,
}

/// Texel of the shadow atlas where nothing is.
pub const TILE_EMPTY: u32 = 0xffff_ffff;

/// Largest edge of what one workgroup draws of a tile, texels: twin of `PART_EDGE` in `shadow_atlas/tile.wgsl`.
pub const PART_EDGE: u32 = 48;

/// Parts of a tile of that edge, of which a workgroup draws one each.
pub const fn tile_parts(tile: u32) -> u32 {
    tile.div_ceil(PART_EDGE).pow(2)
}

/// Sizes of the shadow atlas.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct AtlasParameters {
    /// Edge of a tile, texels.
    pub tile: u32,
    /// Triangles in the list of occluders.
    pub occluder_count: u32,
    /// Distance of depth 1, world units.
    pub far: f32,
    /// Of a point, where maps are made from points: square world units.
    pub point_area: f32,
    /// Largest distance of what casts from the surfaces it stands for, world units.
    pub error: f32,
}

/// Points are in the order of the surfaces; a light takes one of this many subsets, each spread over all of them.
pub const POINT_SUBSETS: u32 = 4;

/// A point of a surface, wherever that goes.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfacePoint {
    /// Index into the instances.
    pub instance: u32,
    /// First index of its triangle, in words of the geometry buffer.
    pub first_index: u32,
    /// Weights of the second and third corner, 2 unorm16.
    pub barycentric: u32,
}

/// A point of a surface as it stands in the world.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct WorldPoint {
    /// World position.
    pub position: Vec3,
    /// Octahedral normal, 2 snorm16, and in their lowest bits whether both sides cast, and whether the triangle is wide.
    pub normal: u32,
}
