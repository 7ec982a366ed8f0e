// Bevy's depth and deferred G-buffer to the surface texture that the passes of a view read: bits of the reverse-z depth (0:
// nothing that is to be lit) and the world-space normal, octahedral.

#import bevy_pbr::pbr_deferred_types::{unpack_24bit_normal, unpack_flags, DEFERRED_FLAGS_UNLIT_BIT}
#import bevy_pbr::utils::octahedral_decode
#import bevy_render::view::View
#import bevy_bounce::shared::octahedral::encode_unit

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var depth_texture: texture_2d<f32>;
@group(0) @binding(2) var deferred_texture: texture_2d<u32>;
@group(0) @binding(3) var lighting_pass_id_texture: texture_2d<u32>;
/// Bevy's `PbrDeferredLightingDepthId`: which deferred pixels are lit as standard materials.
@group(0) @binding(4) var<uniform> lighting_pass_id: u32;
@group(0) @binding(5) var surface: texture_storage_2d<rg32uint, write>;

@compute @workgroup_size(8, 8)
fn pack(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(surface)) {
        return;
    }
    let pixel = id.xy + vec2<u32>(view.main_pass_viewport.xy);
    var texel = vec2<u32>(0u);
    let normal_and_flags = textureLoad(deferred_texture, pixel, 0).a;
    if textureLoad(lighting_pass_id_texture, pixel, 0).x == lighting_pass_id
        && (unpack_flags(normal_and_flags) & DEFERRED_FLAGS_UNLIT_BIT) == 0u {
        let normal = octahedral_decode(unpack_24bit_normal(normal_and_flags));
        texel = vec2<u32>(bitcast<u32>(textureLoad(depth_texture, pixel, 0).x), encode_unit(normal));
    }
    textureStore(surface, id.xy, vec4<u32>(texel, 0u, 0u));
}
