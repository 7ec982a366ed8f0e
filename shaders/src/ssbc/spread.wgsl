// The residual at every pixel from that at every second one of every second row, where it is not blurred: its root, bilinear
// among the samples of the same surface; and the list of the pixels of whose surface too few samples are near. Where no sample
// near has any, of whatever surface, none is taken to be: two surfaces that are near enough give to each other. A surface that is
// narrower than the samples are apart may lose its share.
//
// Towards where it ends the residual falls with the square of the distance: both the part of a surface that has a geometry term
// above the bound and by how much shrink linearly. So the mean of two samples would be too much between them, that of their roots
// is not.
//
// Cost: one thread a sample; twelve loads, four stores.

#import bevy_bounce::interleaved::surface::{Surface, is_same_surface}
#import bevy_bounce::ssbc::common::{surface_texture, surface_at, view_lens}
#import bevy_bounce::ssbc::list::list_pixels

@group(0) @binding(3) var residual_texture: texture_2d<f32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;

/// Share of the samples that must be of the same surface.
const ENOUGH: f32 = 0.7;

struct Sample {
    surface: Surface,
    light: vec3<f32>,
}

// A pixel's light between the samples of its surface, and their share. The pixel has a sample at each corner of its place.
fn upsample(samples: array<Sample, 4>, surface: Surface, place: vec2<u32>) -> vec4<f32> {
    var near = samples;
    var sum = vec4<f32>(0.0);
    var count = 0.0;
    for (var i = 0u; i < 4u; i++) {
        let is_corner = all(vec2<u32>(i & 1u, i >> 1u) <= place);
        count += select(0.0, 1.0, is_corner);
        if is_corner && surface.valid && is_same_surface(surface, near[i].surface) {
            sum += vec4<f32>(sqrt(near[i].light), 1.0);
        }
    }
    let root = sum.rgb / max(sum.w, 1.0);
    return vec4<f32>(root * root, sum.w / count);
}

@compute @workgroup_size(8, 8)
fn spread(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(surface_texture);
    let last = textureDimensions(residual_texture) - 1u;
    let lens = view_lens();
    var samples: array<Sample, 4>;
    var is_lit = false;
    for (var i = 0u; i < 4u; i++) {
        let texel = id.xy + vec2<u32>(i & 1u, i >> 1u);
        let inside = all(texel <= last);
        let light = textureLoad(residual_texture, min(texel, last), 0).rgb;
        samples[i] = Sample(surface_at(lens, 2u * min(texel, last)), light);
        samples[i].surface.valid = samples[i].surface.valid && inside;
        is_lit = is_lit || (inside && any(light > vec3<f32>(0.0)));
    }

    // Bits of the pixels at which it fails.
    var fails = 0u;
    for (var i = 0u; i < 4u; i++) {
        let place = vec2<u32>(i & 1u, i >> 1u);
        let pixel = 2u * id.xy + place;
        let surface = surface_at(lens, min(pixel, size - 1u));
        let upsampled = upsample(samples, surface, place);
        let inside = all(pixel < size);
        if inside {
            textureStore(output, pixel, vec4<f32>(upsampled.rgb, 1.0));
        }
        fails |= select(0u, 1u << i, inside && surface.valid && is_lit && upsampled.a < ENOUGH);
    }
    list_pixels(2u * id.xy, fails, lane);
}
