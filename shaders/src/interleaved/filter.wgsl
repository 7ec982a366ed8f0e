// Joins the sixteen sub-images: the mean of a 4x4 window holds each subset of the virtual lights once. Samples across an edge
// are left out and the others weigh more. Bashford-Rogers et al. 2012, III-C.
//
// Where an edge leaves few samples, the window grows to 8x8.
//
// Cost: 32 loads a pixel, 128 along edges.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface, is_same_surface}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(2) var interleaved: texture_2d<f32>;
@group(0) @binding(3) var output: texture_storage_2d<rgba16float, write>;

/// Samples below which the window grows.
const ENOUGH: f32 = 12.0;

// Sum of the light, and the number of samples, in a window.
fn gather_window(center: Surface, pixel: vec2<i32>, low: i32, high: i32) -> vec4<f32> {
    let size = textureDimensions(surface_texture);
    var sum = vec4<f32>(0.0);
    for (var y = low; y <= high; y++) {
        for (var x = low; x <= high; x++) {
            let p = pixel + vec2<i32>(x, y);
            if any(p < vec2<i32>(0)) || any(p >= vec2<i32>(size)) {
                continue;
            }
            let surface = unpack_surface(textureLoad(surface_texture, p, 0).xy, vec2<u32>(p), size, view);
            if is_same_surface(center, surface) {
                sum += vec4<f32>(textureLoad(interleaved, p, 0).rgb, 1.0);
            }
        }
    }
    return sum;
}

@compute @workgroup_size(8, 8)
fn filter_joined(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let pixel = vec2<i32>(id.xy);
    let center = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, id.xy, size, view);
    var sum = vec4<f32>(0.0);
    if center.valid {
        sum = gather_window(center, pixel, -2, 1);
        if sum.w < ENOUGH {
            sum = gather_window(center, pixel, -4, 3);
        }
    }
    textureStore(output, pixel, vec4<f32>(sum.rgb / max(sum.w, 1.0), 1.0));
}
