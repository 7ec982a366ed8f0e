// Fills the radiance caches: one cone a texel of the hemisphere, then its pre-convolved levels. Rehfeld, Zirr and Dachsbacher
// 2014, 3.1; Scherzer et al. 2012.
//
// A workgroup is a cache, a thread one of its 16x16 directions, then one of the 4 x 8x8 texels of the coarser levels, for
// which it weighs all directions. The paper takes means of four texels; convolved levels are free of their blocks, and
// come from the same texels in workgroup memory.
//
// Cost: a cone and 256 weights a thread; 4 KiB of the atlas and 8 KiB of workgroup memory a cache.

#import bevy_bounce::radiance_cache::cone::{grid, Start}
#import bevy_bounce::radiance_cache::hemisphere::{square_to_hemisphere, from_cache}
#import bevy_bounce::radiance_cache::lobes::lobe_weight
#import bevy_bounce::radiance_cache::march::march_cone
#import bevy_bounce::shared::groups::folded_index
#ifdef SKY
#import bevy_bounce::shared::sky::sky_texel
#endif
#import bevy_bounce::radiance_cache::types::{
    RadianceCache, CacheCounters, cache_corner, level_corner, CACHE_EDGE, CACHE_COARSE_EDGE,
}

@group(0) @binding(0) var<storage, read> counters: CacheCounters;
@group(0) @binding(1) var<storage, read> caches: array<RadianceCache>;
@group(0) @binding(2) var atlas: texture_storage_2d<rgba16float, write>;
#ifdef SKY
// The sky, radiance, cd/m^2; and the radiance that counts as 1.
@group(0) @binding(3) var<storage, read> table: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> unit: array<f32>;
#endif

/// Of what a half float holds, with a margin.
const BRIGHTEST: f32 = 6e4;
const TEXELS: u32 = 256u;
const COARSE_TEXELS: u32 = 64u;
/// Diameter over distance of a cone of a 256th of the hemisphere: twice the tangent of acos(1 - 1/256).
const SPREAD: f32 = 0.17748;
/// Voxels by which cones start above the surface: the grid knows it as planes of its voxels.
const LIFT: f32 = 0.25;

var<workgroup> radiance: array<vec4<f32>, TEXELS>;
var<workgroup> directions: array<vec3<f32>, TEXELS>;

fn texel_direction(texel: u32, edge: u32) -> vec3<f32> {
    return square_to_hemisphere((vec2<f32>(vec2<u32>(texel % edge, texel / edge)) + 0.5) / f32(edge));
}

fn convolve(level: u32, axis: vec3<f32>) -> vec4<f32> {
    var sum = vec4<f32>(0.0);
    var weights = 0.0;
    for (var i = 0u; i < TEXELS; i++) {
        let weight = lobe_weight(level, dot(directions[i], axis));
        sum += radiance[i] * weight;
        weights += weight;
    }
    return sum / max(weights, 1e-12);
}

@compute @workgroup_size(256)
fn create(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    if index >= counters.clusters {
        return;
    }
    let cache = caches[index];
    let direction = texel_direction(lane, CACHE_EDGE);
    let start = Start((cache.position - grid.origin) / grid.voxel_size, cache.normal);
    let cone = from_cache(cache.normal, direction);
    var light = march_cone(start, LIFT, cone, SPREAD);
#ifdef SKY
    let sky = min(table[sky_texel(cone)].rgb / unit[0], vec3<f32>(BRIGHTEST));
    light = vec4<f32>(light.rgb + sky * (1.0 - light.a), light.a);
#endif
    radiance[lane] = light;
    directions[lane] = direction;
    let corner = cache_corner(index);
    textureStore(atlas, corner + vec2<u32>(lane % CACHE_EDGE, lane / CACHE_EDGE), light);
    workgroupBarrier();
    let level = 1u + lane / COARSE_TEXELS;
    let texel = lane % COARSE_TEXELS;
    let at = corner + level_corner(level) + vec2<u32>(texel % CACHE_COARSE_EDGE, texel / CACHE_COARSE_EDGE);
    textureStore(atlas, at, convolve(level, texel_direction(texel, CACHE_COARSE_EDGE)));
}
