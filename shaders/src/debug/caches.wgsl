// What the radiance caches hold, as they are in the atlas, in rows as wide as the picture: see `level_corner`.
//
// Cost: one load a pixel.

#import bevy_render::view::View
#import bevy_bounce::radiance_cache::types::{CacheGrid, CacheCounters, cache_corner, CACHE_WIDTH, CACHE_HEIGHT}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var picture: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var<uniform> parameters: CacheGrid;
@group(0) @binding(3) var<storage, read> counters: CacheCounters;
@group(0) @binding(4) var<storage, read> unit: array<f32>;
@group(0) @binding(5) var atlas: texture_2d<f32>;

@compute @workgroup_size(8, 8)
fn show_caches(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(picture);
    if any(id.xy >= size) {
        return;
    }
    let room = vec2<u32>(CACHE_WIDTH, CACHE_HEIGHT);
    let columns = max(size.x / CACHE_WIDTH, 1u);
    let place = id.xy / room;
    let index = place.y * columns + place.x;
    var light = vec3<f32>(0.0);
    if place.x < columns && index < min(counters.clusters, parameters.capacity) {
        light = textureLoad(atlas, cache_corner(index) + id.xy % room, 0).rgb * (unit[0] * view.exposure);
    }
    textureStore(picture, id.xy, vec4<f32>(light, 1.0));
}
