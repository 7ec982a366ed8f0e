// Structs of the radiance caches, as in types.rs.

#define_import_path bevy_bounce::radiance_cache::types

const CACHE_EDGE: u32 = 16u;
const CACHE_COARSE_EDGE: u32 = 8u;
const CACHE_WIDTH: u32 = 16u;
const CACHE_HEIGHT: u32 = 32u;
const CACHES_A_ROW: u32 = 128u;
const CLUSTER_SLICE_BITS: u32 = 10u;
const CLUSTER_FACING_BITS: u32 = 3u;

struct LightVolume {
    dims: vec3<u32>,
    gap: u32,
    last_level: u32,
    further: u32,
    first_group_cell: u32,
    padding: u32,
}

struct CacheGrid {
    size: vec2<u32>,
    tiles: vec2<u32>,
    tile: u32,
    capacity: u32,
    slices: u32,
    orthographic: u32,
    reach: f32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
}

struct CacheCounters {
    clusters: u32,
    coarseness: u32,
    merged: u32,
    pixels: u32,
    missing: u32,
    differences: array<u32, 32>,
}

struct RadianceCache {
    position: vec3<f32>,
    radius: f32,
    normal: vec3<f32>,
    share: f32,
    screen: vec2<f32>,
    padding_a: u32,
    padding_b: u32,
}

/// Where on a screen of that many pixels a point of clip space is, pixels.
fn screen_place(clip: vec4<f32>, size: vec2<u32>) -> vec2<f32> {
    return (clip.xy / clip.w * vec2<f32>(0.5, -0.5) + 0.5) * vec2<f32>(size);
}

/// First texel of what a cache takes of the atlas.
fn cache_corner(index: u32) -> vec2<u32> {
    return vec2<u32>(index % CACHES_A_ROW * CACHE_WIDTH, index / CACHES_A_ROW * CACHE_HEIGHT);
}

/// Corner, within that, of a level: 0 is the light as it comes, 1 to 3 are convolved with wider and wider lobes, 4 with a
/// cosine.
fn level_corner(level: u32) -> vec2<u32> {
    if level == 0u {
        return vec2<u32>(0u);
    }
    let coarse = level - 1u;
    return vec2<u32>(coarse & 1u, coarse >> 1u) * CACHE_COARSE_EDGE + vec2<u32>(0u, CACHE_EDGE);
}
