// The clusters of the radiance caches: pixels of one have one colour, and the pixel of its cache is white.
//
// Cost: one workgroup a cluster, a word a pixel.

#import bevy_bounce::radiance_cache::types::{CacheGrid, CacheCounters, RadianceCache}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> parameters: CacheGrid;
@group(0) @binding(1) var<storage, read> counters: CacheCounters;
// Key, pixel; sorted.
@group(0) @binding(2) var<storage, read> pairs: array<vec2<u32>>;
// First pixel in the order of each cluster; after the last, the number of pixels.
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> caches: array<RadianceCache>;
@group(0) @binding(5) var picture: texture_storage_2d<rgba16float, write>;

/// Some colour, neither dark nor white; Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", pcg3d.
fn color_of(index: u32) -> vec3<f32> {
    var v = vec3<u32>(index, index + 1u, index + 2u) * 1664525u + 1013904223u;
    v += v.yzx * v.zxy;
    v ^= v >> vec3<u32>(16u);
    v += v.yzx * v.zxy;
    return vec3<f32>(v & vec3<u32>(255u)) / 255.0 * 0.7 + 0.1;
}

@compute @workgroup_size(64)
fn show_clusters(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let cluster = folded_index(group);
    if cluster >= min(counters.clusters, parameters.capacity) {
        return;
    }
    let place = vec2<u32>(caches[cluster].screen);
    let color = color_of(cluster);
    for (var i = starts[cluster] + lane; i < starts[cluster + 1u]; i += 64u) {
        let index = pairs[i].y;
        let pixel = vec2<u32>(index % parameters.size.x, index / parameters.size.x);
        textureStore(picture, pixel, vec4<f32>(select(color, vec3<f32>(1.0), all(pixel == place)), 1.0));
    }
}
