//! Structs that Rust and WGSL share. A test compares every one with what naga makes of its WGSL twin of the same name.

use bevy::math::{Mat4, UVec2, UVec3, Vec2, Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

/// No such offset or index.
pub const NONE: u32 = u32::MAX;

/// Triangles a workgroup of the voxeliser takes: one [`Chunk`] each.
pub const CHUNK_TRIANGLES: u32 = 64;

/// Words a vertex takes in the geometry buffer: position (3 f32, local), UV (2 f16 in one word).
pub const VERTEX_WORDS: u32 = 4;

/// Words a vertex takes in the skin section: 4 u16 joint indices, 4 unorm16 weights.
pub const SKIN_WORDS: u32 = 4;

/// Words a deformed vertex takes: world-space position (3 f32).
pub const DEFORMED_WORDS: u32 = 3;

/// Edge of a thumbnail, in texels; one word a texel (RGBA8, colour stored as its square root).
pub const THUMBNAIL_SIZE: u32 = 16;

/// [`Instance::flags`]: reflects on both sides.
pub const INSTANCE_TWO_SIDED: u32 = 1;

/// [`Instance::flags`]: the side seen is the one with clockwise winding (front faces are culled).
pub const INSTANCE_FLIPPED: u32 = 2;

/// One mesh in the world.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Instance {
    /// First row of the affine local-to-world matrix.
    pub world_from_local_x: Vec4,
    /// Second row.
    pub world_from_local_y: Vec4,
    /// Third row.
    pub world_from_local_z: Vec4,
    /// First index, in words of the geometry buffer.
    pub index_offset: u32,
    /// Triangles; 0 for a free slot.
    pub triangle_count: u32,
    /// First vertex, in words of the geometry buffer.
    pub vertex_offset: u32,
    /// First deformed vertex, in words of the geometry buffer, or [`NONE`] for a rigid mesh.
    pub deformed_offset: u32,
    /// Index into the materials.
    pub material: u32,
    /// `INSTANCE_*`.
    pub flags: u32,
    /// RGBA8 linear albedo that replaces the material's where alpha is not 0.
    pub albedo_override: u32,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
}

/// Up to [`CHUNK_TRIANGLES`] consecutive triangles of one instance.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Chunk {
    /// Index into the instances.
    pub instance: u32,
    /// First triangle within the instance.
    pub first_triangle: u32,
}

/// What bounced light needs to know of a material.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Material {
    /// Linear albedo, multiplies the thumbnail; alpha likewise.
    pub albedo: Vec4,
    /// Emitted radiance, cd/m^2, multiplies the emissive thumbnail.
    pub emissive: Vec3,
    /// Alpha below which a masked surface is not there; 0 for an opaque one.
    pub alpha_cutoff: f32,
    /// UV transform, rows: u' = dot(x.xy, uv) + x.z.
    pub uv_x: Vec4,
    /// v' = dot(y.xy, uv) + y.z.
    pub uv_y: Vec4,
    /// First word of the base colour thumbnail, or [`NONE`].
    pub albedo_thumbnail: u32,
    /// First word of the emissive thumbnail, or [`NONE`].
    pub emissive_thumbnail: u32,
    /// What is reflected before light comes to the albedo, 0 to 1.
    pub specular: f32,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
}

/// [`Light::kind`]: point light.
pub const LIGHT_POINT: u32 = 0;
/// [`Light::kind`]: spot light.
pub const LIGHT_SPOT: u32 = 1;
/// [`Light::kind`]: directional light.
pub const LIGHT_DIRECTIONAL: u32 = 2;
/// [`Light::kind`]: rect light.
pub const LIGHT_RECT: u32 = 3;

/// A light of Bevy's, or a direction of the sky.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Light {
    /// World position, of a rect light its middle; unused for a directional light.
    pub position: Vec3,
    /// `LIGHT_*`.
    pub kind: u32,
    /// Direction in which it shines, unit length.
    pub direction: Vec3,
    /// Distance beyond which it does not reach; 0 for none.
    pub range: f32,
    /// Linear RGB, candela (point, spot), lux (directional) or cd/m^2 (rect).
    pub color: Vec3,
    /// Share of the paths, sum of it over this light and those before it, in lumens (luminance).
    pub cumulative_power: f32,
    /// Spot cone: attenuation is saturate(cos * scale + offset)^2, as Bevy's.
    pub spot_scale: f32,
    /// See `spot_scale`.
    pub spot_offset: f32,
    /// Cosine of the outer cone.
    pub spot_cos_outer: f32,
    /// Longest path from this light, in bounces.
    pub max_bounces: u32,
    /// From the middle of a rect light to that of a side, world units.
    pub side: Vec3,
    /// Half its extent across that, world units.
    pub half_height: f32,
}

/// Sizes of the scene, for every pass.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Scene {
    /// Corner of the bounds of all that takes part.
    pub bounds_min: Vec3,
    /// Bevy's lights; those of the sky follow them in the same table.
    pub light_count: u32,
    /// Opposite corner.
    pub bounds_max: Vec3,
    /// Sum of the lights' power, lumens (luminance).
    pub light_power: f32,
    /// Chunks of all instances.
    pub chunk_count: u32,
    /// Chunks of the instances whose material emits.
    pub emissive_chunk_count: u32,
    /// Largest component of the radiance that any material emits, cd/m^2.
    pub max_emission: f32,
    /// Directional lights that stand for the sky.
    pub sky_count: u32,
    /// Boxes round the cameras, each within the next, the last of which holds all.
    pub regions: [Region; REGIONS],
    /// How many of them there are: 1 where the scene is small.
    pub region_count: u32,
    /// Chunks that are voxelised with the world: the first of all. Those of groups with a grid of their own follow.
    pub world_chunk_count: u32,
    /// The same of the chunks that emit.
    pub world_emissive_chunk_count: u32,
}

/// Boxes round the cameras, at most.
pub const REGIONS: usize = 4;

/// A box round the cameras.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Region {
    /// Lowest corner.
    pub min: Vec3,
    /// Paths that start in it are so many times as dense as in the innermost, for each box that they start in.
    pub weight: f32,
    /// Opposite corner.
    pub max: Vec3,
    /// Makes it 32 bytes.
    pub padding: u32,
}

/// Edge of the sky's table, in texels of an octahedral map.
pub const SKY_EDGE: u32 = 32;

/// The cube map that is the sky, and what it is made into.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Sky {
    /// Quaternion that turns directions of the world into those of the map.
    pub rotation: Vec4,
    /// Radiance of a texel of 1, cd/m^2.
    pub intensity: f32,
    /// Samples along the edge of a texel of the table.
    pub samples: u32,
    /// Longest path from the sky, in bounces.
    pub max_bounces: u32,
    /// Scales its share of the paths.
    pub share: f32,
}

/// A skinned or morphed instance whose pose changed.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct DeformJob {
    /// First row of the affine local-to-world matrix; a skinned mesh stands where its joints are instead.
    pub world_from_local_x: Vec4,
    /// Second row.
    pub world_from_local_y: Vec4,
    /// Third row.
    pub world_from_local_z: Vec4,
    /// First vertex, in words of the geometry buffer.
    pub vertex_offset: u32,
    /// Number of vertices.
    pub vertex_count: u32,
    /// First word of the skin in the geometry buffer, or [`NONE`].
    pub skin_offset: u32,
    /// First word of the morph deltas in the geometry buffer.
    pub morph_offset: u32,
    /// First deformed vertex, in words of the geometry buffer.
    pub deformed_offset: u32,
    /// First joint matrix, in words of the pose buffer: three rows of four floats.
    pub joint_offset: u32,
    /// Number of joints.
    pub joint_count: u32,
    /// First morph weight, in words of the pose buffer.
    pub weight_offset: u32,
    /// Number of morph targets.
    pub weight_count: u32,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
}

/// Vertices that one workgroup deforms.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct DeformChunk {
    /// Index into the jobs, or [`NONE`].
    pub job: u32,
    /// First of up to 64 vertices.
    pub first_vertex: u32,
}

/// A thumbnail to be made.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ThumbnailJob {
    /// First word of the thumbnail.
    pub offset: u32,
    /// 1 where colours count by their alpha.
    pub masked: u32,
    /// Mip levels of the texture.
    pub mip_levels: u32,
    /// Makes it 16 bytes.
    pub padding: u32,
}

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

/// A virtual point light: a cosine emitter.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Vpl {
    /// World position.
    pub position: Vec3,
    /// Bounces behind it, 0 on an emissive surface; the highest bit is set where its light met a surface.
    pub bounce_met: u32,
    /// Unit normal.
    pub normal: Vec3,
    /// Index of its path.
    pub path: u32,
    /// Linear RGB flux, lumens.
    pub flux: Vec3,
    /// Direction of the light that it reflects, octahedral, 2 snorm8; in the upper half, voxels which that had come freely, f16.
    pub incoming: u32,
}

impl Vpl {
    /// Bounces behind it: 0 on an emissive surface.
    pub const fn bounce(&self) -> u32 {
        self.bounce_met & !(1 << 31)
    }

    /// Whether its light met a surface.
    pub const fn met(&self) -> bool {
        self.bounce_met >> 31 == 1
    }
}

/// Most workgroups of a dispatch along an axis, WebGPU's default limit; a longer row is folded into the second axis.
pub const MAX_WORKGROUPS: u32 = 65535;

/// Words known of a brick of the grid: lights times 2^15; the first light filed under it, counted from 1; candidates
/// whose light falls into it, and of these those whose light meets something from there; area of the groups in it, in 1/256
/// voxel faces.
pub const BRICK_WORDS: u32 = 5;
/// Places of which a path from a directional light starts at one.
pub const CANDIDATES: u32 = 8;
/// Words a virtual light has for what its path met: distance and normal; the next light of its brick, counted from 1.
pub const MEETING_WORDS: u32 = 2;

/// A path that was traced.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Path {
    /// Vertices.
    pub length: u32,
    /// Bounce of the first one: 0 on an emissive surface, else 1.
    pub first_bounce: u32,
    /// Vertices of the paths before it.
    pub first: u32,
}

/// An emissive triangle as an area light.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Emitter {
    /// World position of its first corner.
    pub position: Vec3,
    /// 1 where it shines on both sides.
    pub two_sided: u32,
    /// From the first corner to the second.
    pub edge_b: Vec3,
    /// Power, lumens (luminance), of this triangle and those before it.
    pub cumulative_power: f32,
    /// From the first corner to the third.
    pub edge_c: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_a: u32,
    /// Unit normal of the side that is seen.
    pub normal: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_b: u32,
    /// Linear RGB flux, lumens, of all its sides.
    pub flux: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
}

/// Sizes of the path tracer.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VplParameters {
    /// Virtual lights there is room for.
    pub capacity: u32,
    /// Paths traced.
    pub path_count: u32,
    /// Longest path, bounces.
    pub max_bounces: u32,
    /// Scale of the bound of the geometry term.
    pub bound_scale: f32,
}

/// Bits of each coordinate of a place on a Hilbert curve.
pub const HILBERT_BITS: u32 = 7;

/// Steps of the error of a node of the tree over the vertices: 32 an octave. See `vpl/cuts.wgsl`.
pub const NODE_STEPS: u32 = 1024;

/// Pairs that one workgroup sorts.
pub const SORT_BLOCK: u32 = 1024;

/// Eight bits of a sort key.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Digit {
    /// Lowest bit.
    pub shift: u32,
}

/// Subsets of the virtual lights: a pixel of each 4x4 block is lit by one of them.
pub const SUBSETS: usize = 16;

/// What the list of virtual lights holds.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct VplHeader {
    /// First light of each subset, and the end of the last.
    pub subset_start: [u32; SUBSETS + 1],
    /// Paths traced: fluxes are divided by it.
    pub path_count: u32,
    /// Largest geometry term where lights lie as densely as on the average, 1/m^2.
    pub geometry_bound: f32,
    /// Lights in the list.
    pub count: u32,
}

/// [`Occluder::flags`]: casts from both sides.
pub const OCCLUDER_TWO_SIDED: u32 = 1;

/// A triangle that casts shadows.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Occluder {
    /// First corner, world space; counter-clockwise as seen from the side that casts.
    pub a: Vec3,
    /// `OCCLUDER_*`.
    pub flags: u32,
    /// Second corner.
    pub b: Vec3,
    /// The baked object that it is part of, or `NONE`; nothing where no bakes are asked.
    pub object: u32,
    /// Third corner.
    pub c: Vec3,
    /// Keeps rows of 16 bytes.
    pub padding_c: u32,
}

/// Up to [`CHUNK_TRIANGLES`] occluders of one mesh.
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

/// Largest tile of the shadow atlas, texels.
pub const MAX_TILE_TEXELS: u32 = 2304;

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
pub const POINT_SUBSETS: u32 = 16;

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
    /// Octahedral normal, 2 snorm16; lowest bit: both sides cast.
    pub normal: u32,
}

/// How the bias compensation integrates.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct SsbcParameters {
    /// Projected solid angle above which a texel is refined, sr.
    pub solid_angle: f32,
    /// The same for a texel that spans an edge, sr.
    pub edge_solid_angle: f32,
    /// Pixels a side of a texel of the residual: 1 or 2.
    pub scale: u32,
    /// Keeps rows of 16 bytes.
    pub padding: u32,
}

/// Levels of the hierarchy of the bias compensation above the pixels.
pub const SSBC_LEVELS: u32 = 6;

/// What the history is told of the last frame.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct HistoryParameters {
    /// As it was drawn: jittered where the camera is.
    pub previous_clip_from_world: Mat4,
    /// The inverse.
    pub previous_world_from_clip: Mat4,
    /// As motion vectors count: without jitter.
    pub previous_unjittered_clip_from_world: Mat4,
    /// This frame's exposure over the last one's.
    pub exposure: f32,
    /// Frames over which light is averaged at most.
    pub frames: f32,
    /// 1 where there is a last frame, 0 where not.
    pub valid: u32,
    /// 0, or up to 1 after a budget has changed how many lights there are: how much further off history may be.
    pub leniency: f32,
}

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
    /// The object that a leaf is, or [`NONE`].
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
    /// Part, of those of all baked objects, or [`NONE`].
    pub part: u32,
    /// Triangle within the part.
    pub triangle: u32,
    /// Weights of the second and third corner, 2 unorm16.
    pub barycentric: u32,
}

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

/// Directions that a probe has a value for.
pub const PROBE_FACES: u32 = 6;

/// Where the light probes are.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeParameters {
    /// Corner of the volume; the first probe is half a spacing inside.
    pub origin: Vec3,
    /// World units between probes.
    pub spacing: f32,
    /// Probes along each axis.
    pub dims: UVec3,
    /// What a texel holds for 1 cd/m^2.
    pub scale: f32,
}

/// Where the light of a probe's face is taken.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbePlace {
    /// World position.
    pub position: Vec3,
    /// Octahedral normal (16 bits), how far the place is known.
    pub word: u32,
}
