//! Meshes, materials, lights and the sky, and how the first are bent and the second shrunk to thumbnails.

use bevy::math::{Vec3, Vec4};
use bevy::render::render_resource::ShaderType;

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

/// How a texture goes on beyond its edges along an axis: from its start again.
pub const WRAP_REPEAT: u32 = 0;

/// How a texture goes on beyond its edges along an axis: with what is at the edge.
pub const WRAP_CLAMP: u32 = 1;

/// How a texture goes on beyond its edges along an axis: there and back.
pub const WRAP_MIRROR: u32 = 2;

/// Bits of how a texture goes on along an axis, in the words that say where its thumbnail is: u from bit 0, v after that.
pub const WRAP_BITS: u32 = 2;

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
    /// First deformed vertex, in words of the geometry buffer, or [`NONE`](super::NONE) for a rigid mesh.
    pub deformed_offset: u32,
    /// Index into the materials.
    pub material: u32,
    /// `INSTANCE_*`.
    pub flags: u32,
    /// RGBA8 linear albedo that replaces the material's where alpha is not 0.
    pub albedo_override: u32,
    /// First vertex colour (RGBA8, the colour as its square root), in words of the geometry buffer, or [`NONE`](super::NONE).
    pub color_offset: u32,
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
    /// Alpha below which a masked surface is not there; 0 for an opaque one. The thumbnail of a masked one has the share that is there
    /// instead of alpha.
    pub alpha_cutoff: f32,
    /// UV transform, rows: u' = dot(x.xy, uv) + x.z.
    pub uv_x: Vec4,
    /// v' = dot(y.xy, uv) + y.z.
    pub uv_y: Vec4,
    /// First word of the base colour thumbnail, a multiple of [`THUMBNAIL_SIZE`]^2, with how the texture goes on beyond its edges
    /// ([`WRAP_BITS`]) in the bits below that; or [`NONE`](super::NONE).
    pub albedo_thumbnail: u32,
    /// The same of the emissive thumbnail.
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
    /// Spot cone: attenuation is saturate((cos - cos of the outer cone) * scale)^2, as Bevy's.
    pub spot_scale: f32,
    /// Cosine of the outer cone.
    pub spot_cos_outer: f32,
    /// A light keeps it while it is there: which part of the sequence its paths follow.
    pub name: u32,
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
/// Share of its ambient light that Bevy's `ambient_light` has a white diffuse surface send: `F_AB` of
/// bevy_pbr/src/render/pbr_lighting.wgsl at a roughness of 1.
pub const AMBIENT_SHARE: f32 = (1.04 - 0.572) - 1.04 * (0.0425 - 0.0275);

/// The cube map that is the sky, and what it is made into.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Sky {
    /// Quaternion that turns directions of the world into those of the map.
    pub rotation: Vec4,
    /// Radiance of a white texel, cd/m^2.
    pub radiance: Vec3,
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
    /// First word of the skin in the geometry buffer, or [`NONE`](super::NONE).
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
    /// Index into the jobs, or [`NONE`](super::NONE).
    pub job: u32,
    /// First of up to 64 vertices.
    pub first_vertex: u32,
}

/// A thumbnail to be made.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ThumbnailJob {
    /// First word of the thumbnail.
    pub offset: u32,
    /// Alpha, in 255ths, from which a texel of a masked texture is there; 0 where it is not masked.
    pub cutoff: u32,
    /// Mip levels of the texture.
    pub mip_levels: u32,
    /// Makes it 16 bytes.
    pub padding: u32,
}
