// A pixel of Bevy's deferred G-buffer as its lighting functions want it.

#define_import_path bevy_bounce::compose::gbuffer

#import bevy_pbr::lighting
#import bevy_pbr::mesh_view_bindings::{view, deferred_prepass_texture}
#import bevy_pbr::pbr_deferred_functions::pbr_input_from_deferred_gbuffer
#import bevy_pbr::pbr_functions::calculate_diffuse_color
#import bevy_pbr::pbr_types::PbrInput
#import bevy_pbr::prepass_utils

#ifdef SCREEN_SPACE_AMBIENT_OCCLUSION
#import bevy_pbr::mesh_view_bindings::screen_space_ambient_occlusion_texture
#import bevy_pbr::ssao_utils::ssao_multibounce
#endif

/// From a pixel of the target to one of the view's own textures, which cover its main pass viewport alone.
fn view_pixel(pixel: vec2<i32>) -> vec2<i32> {
    return pixel - vec2<i32>(view.main_pass_viewport.xy);
}

/// The surface at a pixel of the target, as bevy_pbr/src/deferred/deferred_lighting.wgsl prepares it.
fn load_pbr_input(pixel: vec2<i32>) -> PbrInput {
    // Bevy's functions take coordinates of the viewport; the main pass may have drawn fewer pixels.
    let scale = view.viewport.zw / view.main_pass_viewport.zw;
    let origin = view.viewport.xy;
    let position = origin + (vec2<f32>(pixel) + 0.5 - origin) * scale;
    let depth = prepass_utils::prepass_depth(vec4<f32>(vec2<f32>(pixel), 0.0, 0.0), 0u);
    let gbuffer = textureLoad(deferred_prepass_texture, pixel, 0);
    var surface = pbr_input_from_deferred_gbuffer(vec4<f32>(position, depth, 0.0), gbuffer);

#ifdef SCREEN_SPACE_AMBIENT_OCCLUSION
    let ssao = textureLoad(screen_space_ambient_occlusion_texture, view_pixel(pixel), 0).r;
    let multibounce = ssao_multibounce(ssao, surface.material.base_color.rgb);
    surface.diffuse_occlusion = min(surface.diffuse_occlusion, multibounce);
    // Lagarde and de Rousiers 2014, "Moving Frostbite to Physically Based Rendering", listing 26.
    let n_dot_v = max(dot(surface.N, surface.V), 0.0001);
    let roughness = lighting::perceptualRoughnessToRoughness(surface.material.perceptual_roughness);
    surface.specular_occlusion = saturate(pow(n_dot_v + ssao, exp2(-16.0 * roughness - 1.0)) - 1.0 + ssao);
#endif

    return surface;
}

/// Diffuse albedo.
fn diffuse_color(surface: PbrInput) -> vec3<f32> {
    return calculate_diffuse_color(
        surface.material.base_color.rgb,
        surface.material.metallic,
        surface.material.specular_transmission,
        surface.material.diffuse_transmission,
    );
}
