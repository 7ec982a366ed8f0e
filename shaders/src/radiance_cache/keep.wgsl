// Caches of the last frame that still hold, at the pixels where they are now. Rehfeld, Zirr and Dachsbacher 2014, 6, as future
// work: places are used again, as Laine et al. 2007, "Incremental Instant Radiosity", do with virtual lights. Their light is
// made anew every frame.
//
// A cache holds while its place is seen on the surface that it was put on: in its pixel there is a surface that looks as it does,
// lies in its plane and is a pixel or two away. Of several at one pixel the last in the order is taken.
//
// Cost: one thread a cache.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface, is_same_surface}
#import bevy_bounce::radiance_cache::types::{CacheGrid, RadianceCache, screen_place}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> parameters: CacheGrid;
@group(0) @binding(2) var surface_texture: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> last: array<RadianceCache>;
// Of each pixel, one more than the index of the cache that is kept there; 0 without.
@group(0) @binding(4) var<storage, read_write> kept: array<atomic<u32>>;

/// Pixels between a cache and what its pixel shows.
const NEAR: f32 = 2.0;

@compute @workgroup_size(64)
fn keep(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * 64u + lane;
    if index >= arrayLength(&last) || last[index].radius <= 0.0 {
        return;
    }
    let cache = last[index];
    let clip = view.clip_from_world * vec4<f32>(cache.position, 1.0);
    let place = screen_place(clip, parameters.size);
    if clip.w <= 0.0 || any(place < vec2<f32>(0.0)) || any(place >= vec2<f32>(parameters.size)) {
        return;
    }
    let pixel = vec2<u32>(place);
    let seen = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, parameters.size, view);
    let held = Surface(cache.position, cache.normal, seen.footprint, true);
    if is_same_surface(held, seen) && distance(seen.position, cache.position) < NEAR * seen.footprint {
        atomicMax(&kept[pixel.y * parameters.size.x + pixel.x], index + 1u);
    }
}
