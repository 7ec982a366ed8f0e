// The residual between the pixels at which it was computed: bilinear among those of the same surface.

#define_import_path bevy_bounce::ssbc::upsample

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::interleaved::surface::{Surface, is_same_surface}
#import bevy_bounce::ssbc::common::{parameters, surface_texture, surface_at, Lens}

@group(0) @binding(3) var residual_texture: texture_2d<u32>;

/// Bits of rgb9e5.
const MANTISSAS: u32 = 0x7ffffffu;

struct Upsampled {
    // Irradiance over pi.
    light: vec3<f32>,
    // Share of the samples that were of the same surface.
    weight: f32,
}

// Samples round a pixel, 1 or 2 in either direction.
fn samples_near(pixel: vec2<u32>) -> vec2<u32> {
    return select(vec2<u32>(1u), pixel % 2u + 1u, parameters.scale == 2u);
}

/// Whether there is light at any of the samples, of whatever surface.
fn is_lit_near(pixel: vec2<u32>) -> bool {
    let last = textureDimensions(residual_texture) - 1u;
    let first = pixel / parameters.scale;
    let second = min(first + samples_near(pixel) - 1u, last);
    var words = textureLoad(residual_texture, first, 0).x | textureLoad(residual_texture, second, 0).x;
    words |= textureLoad(residual_texture, vec2<u32>(first.x, second.y), 0).x;
    words |= textureLoad(residual_texture, vec2<u32>(second.x, first.y), 0).x;
    return (words & MANTISSAS) != 0u;
}

/// The residual between its samples.
fn upsample(lens: Lens, surface: Surface, pixel: vec2<u32>) -> Upsampled {
    if parameters.scale == 1u {
        return Upsampled(rgb9e5_to_vec3_(textureLoad(residual_texture, pixel, 0).x), 1.0);
    }
    let size = textureDimensions(surface_texture);
    let first = pixel / 2u;
    let samples = samples_near(pixel);
    var sum = vec4<f32>(0.0);
    for (var y = 0u; y < samples.y; y++) {
        for (var x = 0u; x < samples.x; x++) {
            let texel = first + vec2<u32>(x, y);
            let at = texel * 2u;
            if all(at < size) && is_same_surface(surface, surface_at(lens, at)) {
                sum += vec4<f32>(rgb9e5_to_vec3_(textureLoad(residual_texture, texel, 0).x), 1.0);
            }
        }
    }
    return Upsampled(sum.rgb / max(sum.w, 1.0), sum.w / f32(samples.x * samples.y));
}
