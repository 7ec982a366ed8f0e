// What was averaged, into the view's light, and kept for the next frame, with what its pixels show. Cost: a load and two
// stores a pixel; for the last light, a load and a store more.

#import bevy_bounce::history::surfaces::pack_seen
#import bevy_bounce::shared::octahedral::decode_unit

@group(0) @binding(0) var averaged: texture_2d<f32>;
@group(0) @binding(1) var light: texture_storage_2d<rgba16float, write>;
@group(0) @binding(2) var kept_light: texture_storage_2d<rgba16float, write>;
@group(0) @binding(3) var surface_texture: texture_2d<u32>;
@group(0) @binding(4) var kept_surfaces: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(8, 8)
fn keep(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= textureDimensions(averaged)) {
        return;
    }
    let value = textureLoad(averaged, id.xy, 0);
    textureStore(light, id.xy, vec4<f32>(value.rgb, 1.0));
    textureStore(kept_light, id.xy, value);
#ifdef LAST
    let surface = textureLoad(surface_texture, id.xy, 0).xy;
    textureStore(kept_surfaces, id.xy, vec4<u32>(pack_seen(bitcast<f32>(surface.x), decode_unit(surface.y)), 0u, 0u, 0u));
#endif
}
