// Edge-preserving Gaussian blur of the residual, over 5x5 of its texels of the same surface. Cost: 50 loads a texel.

#import bevy_pbr::rgb9e5::{rgb9e5_to_vec3_, vec3_to_rgb9e5_}
#import bevy_bounce::interleaved::surface::is_same_surface
#import bevy_bounce::ssbc::common::{parameters, surface_at, view_lens}

@group(0) @binding(3) var residual_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<r32uint, write>;

const RADIUS: i32 = 2;

@compute @workgroup_size(8, 8)
fn blur(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = vec2<i32>(textureDimensions(residual_texture));
    let texel = vec2<i32>(id.xy);
    if any(texel >= size) {
        return;
    }
    let lens = view_lens();
    let scale = i32(parameters.scale);
    let center = surface_at(lens, vec2<u32>(texel * scale));
    var sum = vec4<f32>(0.0);
    for (var y = -RADIUS; y <= RADIUS; y++) {
        for (var x = -RADIUS; x <= RADIUS; x++) {
            let other = texel + vec2<i32>(x, y);
            if any(other < vec2<i32>(0)) || any(other >= size) {
                continue;
            }
            if !is_same_surface(center, surface_at(lens, vec2<u32>(other * scale))) {
                continue;
            }
            let weight = exp(-0.5 * f32(x * x + y * y));
            sum += weight * vec4<f32>(rgb9e5_to_vec3_(textureLoad(residual_texture, other, 0).x), 1.0);
        }
    }
    let light = vec3_to_rgb9e5_(sum.rgb / max(sum.w, 1e-6));
    textureStore(output, texel, vec4<u32>(light, 0u, 0u, 0u));
}
