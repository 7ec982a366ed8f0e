// The scene on the GPU: structs as in types/scene.rs, and what is computed from them alone.

#define_import_path bevy_bounce::shared::scene

/// No such offset or index.
const NONE: u32 = 0xffffffffu;
/// Triangles of a chunk.
const CHUNK_TRIANGLES: u32 = 64u;
/// Words of a vertex: position (3 f32, local), UV (2 f16).
const VERTEX_WORDS: u32 = 4u;
/// Words of a vertex's skin: 4 joints (u16), 4 weights (unorm16).
const SKIN_WORDS: u32 = 4u;
/// Words of a deformed vertex: world-space position (3 f32).
const DEFORMED_WORDS: u32 = 3u;
/// Edge of a thumbnail, in texels.
const THUMBNAIL_SIZE: u32 = 16u;
/// Words of a thumbnail.
const THUMBNAIL_WORDS: u32 = 256u;
/// How a texture goes on beyond its edges along an axis.
const WRAP_CLAMP: u32 = 1u;
const WRAP_MIRROR: u32 = 2u;
const WRAP_BITS: u32 = 2u;
/// Reflects on both sides.
const INSTANCE_TWO_SIDED: u32 = 1u;
/// The side seen is the one with clockwise winding.
const INSTANCE_FLIPPED: u32 = 2u;
const LIGHT_POINT: u32 = 0u;
const LIGHT_SPOT: u32 = 1u;
const LIGHT_DIRECTIONAL: u32 = 2u;
const LIGHT_RECT: u32 = 3u;

struct Instance {
    world_from_local_x: vec4<f32>,
    world_from_local_y: vec4<f32>,
    world_from_local_z: vec4<f32>,
    index_offset: u32,
    triangle_count: u32,
    vertex_offset: u32,
    deformed_offset: u32,
    material: u32,
    flags: u32,
    albedo_override: u32,
    color_offset: u32,
}

struct Chunk {
    instance: u32,
    first_triangle: u32,
}

struct Material {
    albedo: vec4<f32>,
    emissive: vec3<f32>,
    alpha_cutoff: f32,
    uv_x: vec4<f32>,
    uv_y: vec4<f32>,
    albedo_thumbnail: u32,
    emissive_thumbnail: u32,
    specular: f32,
    padding: u32,
}

struct Light {
    position: vec3<f32>,
    kind: u32,
    direction: vec3<f32>,
    range: f32,
    color: vec3<f32>,
    cumulative_power: f32,
    spot_scale: f32,
    spot_cos_outer: f32,
    name: u32,
    max_bounces: u32,
    side: vec3<f32>,
    half_height: f32,
}

struct Scene {
    bounds_min: vec3<f32>,
    light_count: u32,
    bounds_max: vec3<f32>,
    light_power: f32,
    chunk_count: u32,
    emissive_chunk_count: u32,
    max_emission: f32,
    sky_count: u32,
    regions: array<Region, 4>,
    region_count: u32,
    world_chunk_count: u32,
    world_emissive_chunk_count: u32,
}

struct Region {
    min: vec3<f32>,
    weight: f32,
    max: vec3<f32>,
    padding: u32,
}

/// Area of a box's shadow on a plane across that unit direction.
fn projected_area(region: Region, direction: vec3<f32>) -> f32 {
    let size = region.max - region.min;
    return dot(size.yzx * size.zxy, abs(direction));
}

/// Share of the light at a point that paths are spent on; `inner` is the innermost region. See `scene/regions.rs`.
fn importance(inner: Region, point: vec3<f32>) -> f32 {
    let half = 0.5 * (inner.max - inner.min);
    let distance = abs(point - (inner.min + half)) / max(half, vec3<f32>(1e-30));
    return pow(max(max(distance.x, distance.y), max(distance.z, 1.0)), -3.0);
}

/// Where a mesh's UV falls in the material's textures.
fn material_uv(material: Material, uv: vec2<f32>) -> vec2<f32> {
    return vec2<f32>(
        dot(material.uv_x.xy, uv) + material.uv_x.z,
        dot(material.uv_y.xy, uv) + material.uv_y.z,
    );
}

// The place within a texture that is seen there along an axis, in [0, 1].
fn wrapped(place: f32, wrap: u32) -> f32 {
    switch wrap & ((1u << WRAP_BITS) - 1u) {
        case WRAP_CLAMP: {
            return clamp(place, 0.0, 1.0);
        }
        case WRAP_MIRROR: {
            return 1.0 - abs(2.0 * fract(0.5 * place) - 1.0);
        }
        default: {
            return fract(place);
        }
    }
}

/// Word of the thumbnails that holds the nearest texel. `thumbnail`: as a material has it.
fn thumbnail_texel(thumbnail: u32, uv: vec2<f32>) -> u32 {
    let place = vec2<f32>(wrapped(uv.x, thumbnail), wrapped(uv.y, thumbnail >> WRAP_BITS));
    let texel = min(vec2<u32>(place * f32(THUMBNAIL_SIZE)), vec2<u32>(THUMBNAIL_SIZE - 1u));
    return (thumbnail & ~(THUMBNAIL_WORDS - 1u)) + texel.y * THUMBNAIL_SIZE + texel.x;
}

/// Share of light that a surface sends on: what is reflected at the surface itself, then the rest by its colour.
fn with_surface_reflection(color: vec3<f32>, specular: f32) -> vec3<f32> {
    return mix(color, vec3<f32>(1.0), specular);
}
