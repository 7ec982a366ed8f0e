//! Baked objects, and how light is gathered from them.

use bevy::math::{Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

/// Baked objects that are lit at a time, at most.
pub const CSSM_OBJECTS: usize = 64;

/// A baked object: where it stands, and where its words are and how they are read. Lengths are world units of the object's own
/// space.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CssmBake {
    /// First row of the affine matrix from the object's space to the world.
    pub world_from_object_x: Vec4,
    /// Second row.
    pub world_from_object_y: Vec4,
    /// Third row.
    pub world_from_object_z: Vec4,
    /// First row of its inverse.
    pub object_from_world_x: Vec4,
    /// Second row.
    pub object_from_world_y: Vec4,
    /// Third row.
    pub object_from_world_z: Vec4,
    /// Smallest corner of the object's box.
    pub bounds_min: Vec3,
    /// Texels, each with a cube map.
    pub texel_count: u32,
    /// Largest corner.
    pub bounds_max: Vec3,
    /// Side of a cube map's face, pixels.
    pub depth: u32,
    /// Centre of the sphere that the maps from outside show.
    pub csm_center: Vec3,
    /// Its radius.
    pub csm_radius: f32,
    /// Depth of one step in a cube map.
    pub quantum: f32,
    /// How far above its texel a cube map's centre stands.
    pub lift: f32,
    /// Depth of one step in a map from outside.
    pub csm_quantum: f32,
    /// Side of the grid of directions of the maps from outside; 0 without such maps.
    pub csm_grid: u32,
    /// Side of a map from outside, pixels.
    pub csm_side: u32,
    /// Levels of the hierarchy below its root.
    pub levels: u32,
    /// From the middle of a square of the largest texel's area to its corners.
    pub reach: f32,
    /// First of its places in the arrays of light: other objects of the same bake have others.
    pub first_light: u32,
    /// First of its texels' records.
    pub first_texel: u32,
    /// First of its nodes; its leaves are behind them.
    pub first_node: u32,
    /// Where in the directory that of its cube maps begins.
    pub directory: u32,
    /// Where in the directory that of its maps from outside begins.
    pub csm_directory: u32,
    /// Where in the blocks those of its cube maps begin.
    pub blocks: u32,
    /// Where in the blocks those of its maps from outside begin.
    pub csm_blocks: u32,
    /// Columns of its atlas, texels.
    pub atlas_width: u32,
    /// Rows of it.
    pub atlas_height: u32,
}

/// Nodes of the tree over baked objects, at most.
pub const CSSM_TOP_NODES: usize = 2 * CSSM_OBJECTS - 1;

/// A node of the tree over baked objects: in depth-first order, the first child behind its parent.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CssmTop {
    /// Centre of the sphere round the objects' texels, world.
    pub center: Vec3,
    /// Its radius, world units.
    pub radius: f32,
    /// The next node without what is below this one.
    pub skip: u32,
    /// The object that a leaf is, or [`NONE`](super::NONE).
    pub object: u32,
}

/// All baked objects.
#[derive(ShaderType, Clone, Copy, Debug, PartialEq)]
pub struct CssmBakes {
    /// Objects.
    pub count: u32,
    /// Places in the arrays of light: the texels of all objects.
    pub lights: u32,
    /// Words of a page of blocks, as a power of two.
    pub page_bits: u32,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
    /// In the order of their places in the arrays of light.
    pub objects: [CssmBake; CSSM_OBJECTS],
    /// Over them; with one object, that alone.
    pub top: [CssmTop; CSSM_TOP_NODES],
}

impl Default for CssmBakes {
    fn default() -> Self {
        Self {
            count: 0,
            lights: 0,
            page_bits: 0,
            padding: 0,
            objects: [CssmBake::default(); CSSM_OBJECTS],
            top: [CssmTop::default(); CSSM_TOP_NODES],
        }
    }
}

/// How light is gathered from baked objects.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CssmGather {
    /// Light, cd/m^2, below which a node's share is not refined.
    pub threshold: f32,
    /// 1 where visibility is filtered over four pixels.
    pub filtered: u32,
    /// Frames over which a pixel that rests is averaged at most, below 256; up to 1 is none.
    pub frames: u32,
    /// 1 where the last frame shows something else.
    pub restart: u32,
}

/// A level of the hierarchies.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CssmLevel {
    /// Steps from the root.
    pub level: u32,
}

/// Which triangle a texel of a baked object shows.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct CssmSurface {
    /// Part, of those of all baked objects, or [`NONE`](super::NONE).
    pub part: u32,
    /// Triangle within the part.
    pub triangle: u32,
    /// Weights of the second and third corner, 2 unorm16.
    pub barycentric: u32,
}
