// What each pixel sends to its surroundings: diffuse direct light, bounced light as far as it is known, emission. Specular
// light and fog are not in it. With it the area of the pixel's surface: level 0 of the hierarchy. At grazing angles the radiance
// decays, not the area: how far off a pixel's surface reaches stays known.
//
// Cost: one thread a pixel, five loads; one more from the second iteration on.

#import bevy_pbr::pbr_deferred_types::unpack_unorm4x8_
#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::compose::marks::share_of_bounced_light
#import bevy_bounce::interleaved::surface::toward_eye
#import bevy_bounce::ssbc::common::{view, surface_texture, surface_at, view_lens, grazing_decay}
#import bevy_bounce::ssbc::hierarchy::encode_pixel

#ifdef COMPENSATED
@group(0) @binding(3) var residual: texture_2d<f32>;
#endif
@group(0) @binding(4) var deferred_texture: texture_2d<u32>;
@group(0) @binding(5) var direct_diffuse: texture_2d<f32>;
@group(0) @binding(6) var indirect: texture_2d<f32>;
@group(0) @binding(7) var output: texture_storage_2d<rgba32uint, write>;

/// Cosine below which a surface is as long as at it: nearly nothing of its radiance is left there.
const LEAST_COSINE: f32 = 0.01;

@compute @workgroup_size(8, 8)
fn radiance(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let lens = view_lens();
    let surface = surface_at(lens, id.xy);
    if !surface.valid {
        textureStore(output, id.xy, vec4<u32>(0u));
        return;
    }
    let to_eye = toward_eye(view, surface.position);
    let cosine = dot(surface.normal, to_eye);
    // Over that of the pixel seen head-on.
    let area_ratio = dot(view.world_from_view[2].xyz, to_eye) / max(cosine, LEAST_COSINE);
    // As Bevy unpacks them in bevy_pbr/src/deferred/pbr_deferred_functions.wgsl.
    let packed = textureLoad(deferred_texture, id.xy + vec2<u32>(view.main_pass_viewport.xy), 0);
    let base_color = pow(unpack_unorm4x8_(packed.r).rgb, vec3<f32>(2.2));
    let properties = unpack_unorm4x8_(packed.b);
    let reflected = base_color * ((1.0 - properties.g) * properties.b);
    var irradiance = textureLoad(indirect, id.xy, 0).rgb;
#ifdef COMPENSATED
    irradiance += textureLoad(residual, id.xy, 0).rgb;
#endif
    let direct = textureLoad(direct_diffuse, id.xy, 0);
    irradiance *= share_of_bounced_light(direct.a);
    let light = (rgb9e5_to_vec3_(packed.g) + direct.rgb + irradiance * reflected) * grazing_decay(cosine);
    let texel = textureLoad(surface_texture, id.xy, 0).xy;
    textureStore(output, id.xy, encode_pixel(texel, area_ratio, light));
}
