// Direct light, bounced light and emission into the picture, and fog over all three.

#import bevy_bounce::compose::gbuffer::{load_pbr_input, diffuse_color, view_pixel}
#import bevy_pbr::lighting
#import bevy_pbr::pbr_functions::main_pass_post_lighting_processing
#import bevy_pbr::pbr_types::{PbrInput, STANDARD_MATERIAL_FLAGS_UNLIT_BIT}

/// Bevy's `PbrDeferredLightingDepthId`: which deferred pixels are lit as standard materials.
@group(2) @binding(0) var<uniform> lighting_pass_id: u32;
/// Layer 0: direct light; layer 1: irradiance of bounced light over pi. Both pre-exposed.
@group(2) @binding(1) var light_texture: texture_2d_array<f32>;

/// A triangle over the whole target, at the depth that stands for the lighting pass id (`DeferredLightingIdDepthTexture`).
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let uv = vec2<f32>(f32(index >> 1u), f32(index & 1u)) * 2.0;
    return vec4<f32>(uv * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0), f32(lighting_pass_id) / 255.0, 1.0);
}

/// Bounced light that the surface sends on.
fn indirect_light(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
    let irradiance = textureLoad(light_texture, pixel, 1, 0).rgb;
    return irradiance * diffuse_color(surface) * surface.diffuse_occlusion;
}

/// Emission as Bevy's deferred path shows it: without exposure, below the clearcoat.
fn emitted_light(surface: PbrInput) -> vec3<f32> {
    let n_dot_v = max(dot(surface.clearcoat_N, surface.V), 0.0001);
    let reflected = surface.material.clearcoat * lighting::F_Schlick(0.04, 1.0, n_dot_v);
    return surface.material.emissive.rgb * (1.0 - reflected);
}

@fragment
fn compose(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let target_pixel = vec2<i32>(position.xy);
    let pixel = view_pixel(target_pixel);
    let surface = load_pbr_input(target_pixel);
    var color = surface.material.base_color;
    if (surface.material.flags & STANDARD_MATERIAL_FLAGS_UNLIT_BIT) == 0u {
        var light = textureLoad(light_texture, pixel, 0, 0).rgb + emitted_light(surface);
#ifdef COMPOSE_INDIRECT
        light += indirect_light(surface, pixel);
#endif
        color = vec4<f32>(light, color.a);
    }
    return main_pass_post_lighting_processing(surface, color);
}

/// Bounced light alone; black where nothing is lit.
@fragment
fn isolate_indirect(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let target_pixel = vec2<i32>(position.xy);
    let pixel = view_pixel(target_pixel);
    if textureLoad(light_texture, pixel, 0, 0).a == 0.0 {
        return vec4<f32>(0.0, 0.0, 0.0, 1.0);
    }
    return vec4<f32>(indirect_light(load_pbr_input(target_pixel), pixel), 1.0);
}
