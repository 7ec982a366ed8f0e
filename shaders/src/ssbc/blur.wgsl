// The residual as the mean over a tent within its surface, as wide as that through which bounded light goes: what each has
// lost, or holds too much, next to a seam, the other has there.
//
// Cost: two loads a texel of the tent, 49 where both are of one resolution.

#import bevy_pbr::rgb9e5::{rgb9e5_to_vec3_, vec3_to_rgb9e5_}
#import bevy_bounce::interleaved::surface::is_same_surface
#import bevy_bounce::ssbc::common::{parameters, surface_at, view_lens}

@group(0) @binding(3) var residual_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(8, 8)
fn blur(@builtin(global_invocation_id) id: vec3<u32>) {
    let last = vec2<i32>(textureDimensions(residual_texture)) - 1;
    let texel = vec2<i32>(id.xy);
    if any(texel > last) {
        return;
    }
    let lens = view_lens();
    let scale = i32(parameters.scale);
    let reach = i32(parameters.reach);
    let center = surface_at(lens, vec2<u32>(texel * scale));
    let low = max(texel - (reach - 1), vec2<i32>(0));
    let high = min(texel + (reach - 1), last);
    var sum = vec4<f32>(0.0);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let other = vec2<i32>(x, y);
            if is_same_surface(center, surface_at(lens, vec2<u32>(other * scale))) {
                let weights = vec2<f32>(reach - abs(other - texel));
                let light = rgb9e5_to_vec3_(textureLoad(residual_texture, other, 0).x);
                sum += weights.x * weights.y * vec4<f32>(light, 1.0);
            }
        }
    }
    let light = vec3_to_rgb9e5_(sum.rgb / max(sum.w, 1e-6));
    textureStore(output, texel, vec4<u32>(light, 0u, 0u, 0u));
}
