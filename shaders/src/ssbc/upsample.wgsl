// The residual between the pixels at which it was computed: bilinear among those of the same surface.

#define_import_path bevy_bounce::ssbc::upsample

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface, is_same_surface}
#import bevy_bounce::ssbc::common::{view, parameters, surface_texture}

@group(0) @binding(3) var residual_texture: texture_2d<u32>;

/// Irradiance over pi, and the weight of the samples that were of the same surface, 0 to 1.
fn upsample(surface: Surface, pixel: vec2<u32>) -> vec4<f32> {
    if parameters.scale == 1u {
        return vec4<f32>(rgb9e5_to_vec3_(textureLoad(residual_texture, pixel, 0).x), 1.0);
    }
    let size = textureDimensions(surface_texture);
    let first = pixel / 2u;
    let between = pixel % 2u;
    var sum = vec4<f32>(0.0);
    for (var y = 0u; y <= between.y; y++) {
        for (var x = 0u; x <= between.x; x++) {
            let texel = first + vec2<u32>(x, y);
            let at = texel * 2u;
            if any(at >= size) {
                continue;
            }
            let other = unpack_surface(textureLoad(surface_texture, at, 0).xy, at, size, view);
            if is_same_surface(surface, other) {
                sum += vec4<f32>(rgb9e5_to_vec3_(textureLoad(residual_texture, texel, 0).x), 1.0);
            }
        }
    }
    let samples = f32((between.x + 1u) * (between.y + 1u));
    return vec4<f32>(sum.rgb / max(sum.w, 1.0), sum.w / samples);
}
