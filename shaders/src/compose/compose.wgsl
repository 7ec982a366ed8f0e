// Direct light, bounced light and emission into the picture, and fog over all three.

#import bevy_pbr::lighting
#import bevy_pbr::mesh_view_bindings as view_bindings
#import bevy_pbr::pbr_functions
#import bevy_pbr::pbr_functions::main_pass_post_lighting_processing
#import bevy_pbr::pbr_types::{PbrInput, STANDARD_MATERIAL_FLAGS_UNLIT_BIT}
#import bevy_bounce::compose::gbuffer::{load_pbr_input, diffuse_color, view_pixel}
#import bevy_bounce::compose::marks::share_of_bounced_light
#import bevy_bounce::compose::mirrored::unpack_mirrored

/// Bevy's `PbrDeferredLightingDepthId`: which deferred pixels are lit as standard materials.
@group(2) @binding(0) var<uniform> lighting_pass_id: u32;
/// Layer 0: direct light, alpha as marks.wgsl says; layer 1: irradiance of bounced light over pi; then, each where
/// there is such light: what is mirrored of the sky, and what of the sky is seen, two layers; bounced light convolved
/// with the surface's lobe, and with its clearcoat's. All light is pre-exposed.
@group(2) @binding(1) var light_texture: texture_2d_array<f32>;

const SKY_LAYER: i32 = 2;
#ifdef COMPOSE_SKY
const GLOSSY_LAYER: i32 = 4;
#else
const GLOSSY_LAYER: i32 = 2;
#endif
#ifdef COMPOSE_COAT
const COAT_LAYER: i32 = GLOSSY_LAYER + 1;
#endif

/// A triangle over the whole target, at the depth that stands for the lighting pass id (`DeferredLightingIdDepthTexture`).
@vertex
fn vertex(@builtin(vertex_index) index: u32) -> @builtin(position) vec4<f32> {
    let uv = vec2<f32>(f32(index >> 1u), f32(index & 1u)) * 2.0;
    return vec4<f32>(uv * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0), f32(lighting_pass_id) / 255.0, 1.0);
}

/// Irradiance over pi of the bounced light that a surface lets in; none where a lightmap has it.
fn diffuse_irradiance(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
    let share = share_of_bounced_light(textureLoad(light_texture, pixel, 0, 0).a);
    return textureLoad(light_texture, pixel, 1, 0).rgb * surface.diffuse_occlusion * share;
}

#ifdef COMPOSE_GLOSSY
/// What of bounced light the surface reflects: at once, after several bounces in its relief, and what is left for its
/// diffuse colour. Fdez-Aguera 2019, "A Multiple-Scattering Microfacet Model for Real-Time Image-Based Lighting", as
/// Bevy lights by environment maps.
struct Reflected {
    once: vec3<f32>,
    often: vec3<f32>,
    left: vec3<f32>,
}

fn reflected(f_zero: vec3<f32>, f_ab: vec2<f32>) -> Reflected {
    // Bevy's: no material reflects less than two percent, and what says so is to reflect nothing.
    let occlusion = saturate(dot(f_zero, vec3<f32>(50.0 * 0.33)));
    let once = (f_zero * f_ab.x + f_ab.y) * occlusion;
    let lost = 1.0 - (f_ab.x + f_ab.y);
    let mean = f_zero + (1.0 - f_zero) / 21.0;
    let often = once * mean / (1.0 - lost * mean) * lost;
    return Reflected(once, often, 1.0 - (once + often));
}

/// Bounced light that the surface sends on.
fn indirect_light(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
    let irradiance = diffuse_irradiance(surface, pixel);
    let radiance = glossy_radiance(surface, pixel);
    return reflected_light(surface, irradiance, radiance) + coat_light(surface, pixel);
}

/// What a clearcoat reflects: Filament's, as Bevy lights it by environment maps.
fn coat_share(surface: PbrInput) -> f32 {
#ifdef COMPOSE_COAT
    let n_dot_v = max(dot(surface.clearcoat_N, surface.V), 0.0001);
    return surface.material.clearcoat * lighting::F_Schlick(0.04, 1.0, n_dot_v);
#else
    return 0.0;
#endif
}

/// Bounced light that a clearcoat reflects.
fn coat_light(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
#ifdef COMPOSE_COAT
    return textureLoad(light_texture, pixel, COAT_LAYER, 0).rgb * (coat_share(surface) * surface.specular_occlusion);
#else
    return vec3<f32>(0.0);
#endif
}

/// Bounced light convolved with the surface's lobe.
fn glossy_radiance(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
    return textureLoad(light_texture, pixel, GLOSSY_LAYER, 0).rgb * surface.specular_occlusion;
}

fn reflected_light(surface: PbrInput, irradiance: vec3<f32>, radiance: vec3<f32>) -> vec3<f32> {
    let material = surface.material;
    let f_ab = lighting::F_AB(material.perceptual_roughness, max(dot(surface.N, surface.V), 0.0001));
    let dielectric = reflected(pbr_functions::calculate_F0_dielectric(material.reflectance), f_ab);
    let metallic = reflected(material.base_color.rgb, f_ab);
    let once = mix(dielectric.once, metallic.once, material.metallic);
    let often = mix(dielectric.often, metallic.often, material.metallic);
    // Through the coat once for diffuse light, in and out for what is mirrored.
    let through = 1.0 - coat_share(surface);
    let diffuse = (often + diffuse_color(surface) * dielectric.left) * irradiance;
    return once * radiance * (through * through) + diffuse * through;
}
#else
/// Bounced light that the surface sends on.
fn indirect_light(surface: PbrInput, pixel: vec2<i32>) -> vec3<f32> {
    return diffuse_irradiance(surface, pixel) * diffuse_color(surface);
}
#endif

/// What the surface mirrors of the sky, but for what stands in the sky's way, and of reflection probes.
fn mirrored_sky(pixel: vec2<i32>) -> vec3<f32> {
#ifdef COMPOSE_SKY
    let mirrored = textureLoad(light_texture, pixel, SKY_LAYER, 0);
    let seen = textureLoad(light_texture, pixel, SKY_LAYER + 1, 0);
    let width_and_probes = unpack_mirrored(mirrored.a);
    return mirrored.rgb * mix(min(mix(seen.y, seen.x, width_and_probes.x), 1.0), 1.0, width_and_probes.y);
#else
    return vec3<f32>(0.0);
#endif
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
        var light = textureLoad(light_texture, pixel, 0, 0).rgb + mirrored_sky(pixel) + emitted_light(surface);
#ifdef COMPOSE_INDIRECT
        light += indirect_light(surface, pixel);
#endif
        color = vec4<f32>(light, color.a);
    }
    return main_pass_post_lighting_processing(surface, color);
}

const BLACK: vec4<f32> = vec4<f32>(0.0, 0.0, 0.0, 1.0);

fn is_lit(pixel: vec2<i32>) -> bool {
    return textureLoad(light_texture, pixel, 0, 0).a != 0.0;
}

/// Bounced light alone; black where nothing is lit.
@fragment
fn isolate_indirect(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let target_pixel = vec2<i32>(position.xy);
    let pixel = view_pixel(target_pixel);
    if !is_lit(pixel) {
        return BLACK;
    }
    return vec4<f32>(indirect_light(load_pbr_input(target_pixel), pixel), 1.0);
}

/// The same, with a line between the halves of the picture.
@fragment
fn isolate_halves(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let target_pixel = vec2<i32>(position.xy);
    let pixel = view_pixel(target_pixel);
    if pixel.x == i32(view_bindings::view.main_pass_viewport.z) / 2 {
        return vec4<f32>(1.0);
    }
    if !is_lit(pixel) {
        return BLACK;
    }
    return vec4<f32>(indirect_light(load_pbr_input(target_pixel), pixel), 1.0);
}

/// Glossy bounced light alone.
@fragment
fn isolate_glossy(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let target_pixel = vec2<i32>(position.xy);
    let pixel = view_pixel(target_pixel);
    var color = BLACK;
#ifdef COMPOSE_GLOSSY
    if is_lit(pixel) {
        let surface = load_pbr_input(target_pixel);
        let base = reflected_light(surface, vec3<f32>(0.0), glossy_radiance(surface, pixel));
        color = vec4<f32>(base + coat_light(surface, pixel), 1.0);
    }
#endif
    return color;
}

/// Bounced light as it falls on surfaces.
@fragment
fn isolate_irradiance(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = view_pixel(vec2<i32>(position.xy));
    return vec4<f32>(select(vec3<f32>(0.0), textureLoad(light_texture, pixel, 1, 0).rgb, is_lit(pixel)), 1.0);
}

/// What was drawn over the bounced light.
@fragment
fn isolate_picture(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(textureLoad(light_texture, view_pixel(vec2<i32>(position.xy)), 1, 0).rgb, 1.0);
}
