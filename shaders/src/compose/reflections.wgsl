// What Bevy's screen-space reflections take the place of: where their ray meets something, they show the light that caches and the sky
// would. Before they run, this takes that share from both. The ray is theirs: the same functions, the same random numbers.
// bevy_pbr/src/ssr/ssr.wgsl.
//
// A fragment pass over the view, blended: targets times 1 - alpha. As much as Bevy's own pass without its environment maps.

#import bevy_pbr::lighting::perceptualRoughnessToRoughness
#import bevy_pbr::mesh_view_bindings::{view, globals, deferred_prepass_texture, ssr_settings}
#import bevy_pbr::pbr_deferred_functions::pbr_input_from_deferred_gbuffer
#import bevy_pbr::pbr_functions::calculate_F0
#import bevy_pbr::prepass_utils::prepass_depth
#import bevy_pbr::ssr::{evaluate_ssr, sample_specular_brdf, stbn_texture}
#import bevy_pbr::utils::{rand_f, rand_vec2f}
#import bevy_pbr::view_transformations::{frag_coord_to_ndc, ndc_to_uv}
#import bevy_render::maths::orthonormalize

struct Targets {
    @location(0) first: vec4<f32>,
#ifdef SECOND_TARGET
    @location(1) second: vec4<f32>,
#endif
}

/// From 0 at `start` to 1 at `end`; a step where they are in no order.
fn fade_in(start: f32, end: f32, value: f32) -> f32 {
    if start >= end {
        return step(start, value);
    }
    return smoothstep(start, end, value);
}

/// How much of the light of a surface is from the screen where its ray meets something there: less on what is very smooth or rough, and
/// towards the picture's edges.
fn weight(roughness: f32, uv: vec2<f32>) -> f32 {
    let settings = ssr_settings;
    let smoothest = fade_in(settings.min_perceptual_roughness, settings.min_perceptual_roughness_fully_active, roughness);
    var roughest = step(roughness, settings.max_perceptual_roughness);
    if settings.max_perceptual_roughness_starts_to_fade < settings.max_perceptual_roughness {
        roughest = 1.0 - smoothstep(settings.max_perceptual_roughness_starts_to_fade, settings.max_perceptual_roughness, roughness);
    }
    let from_edge = min(uv, 1.0 - uv);
    let outer = settings.edge_fadeout_no_longer_active;
    let inner = settings.edge_fadeout_fully_active;
    return smoothest * roughest * fade_in(outer, inner, from_edge.x) * fade_in(outer, inner, from_edge.y);
}

/// Random numbers of a pixel in this frame: two for the direction, one for the first step.
fn random(pixel: vec2<u32>) -> vec3<f32> {
    let size = textureDimensions(stbn_texture);
    if all(size > vec2<u32>(1u)) {
        let layer = globals.frame_count % textureNumLayers(stbn_texture);
        return textureLoad(stbn_texture, pixel % size, layer, 0).xyz;
    }
    var state = (pixel.x * 2131358057u) ^ (pixel.y * 3416869721u) ^ (globals.frame_count * 1199786941u);
    let direction = rand_vec2f(&state);
    return vec3<f32>(direction, rand_f(&state));
}

/// Share of the light that is taken. `position`: of the pixel in the target.
fn taken(position: vec2<f32>) -> f32 {
    let depth = prepass_depth(vec4<f32>(position, 0.0, 0.0), 0u);
    if depth == 0.0 {
        return 0.0;
    }
    let coordinates = vec4<f32>(position, depth, 0.0);
    let surface = pbr_input_from_deferred_gbuffer(coordinates, textureLoad(deferred_prepass_texture, vec2<i32>(position), 0));
    let material = surface.material;
    let weight = weight(material.perceptual_roughness, ndc_to_uv(frag_coord_to_ndc(coordinates).xy));
    if weight == 0.0 {
        return 0.0;
    }
    let random = random(vec2<u32>(position));
    let from_tangent = orthonormalize(surface.N);
    let lobe = sample_specular_brdf(
        surface.V * from_tangent,
        perceptualRoughnessToRoughness(material.perceptual_roughness),
        calculate_F0(material.base_color.rgb, material.metallic, material.reflectance),
        random.xy,
        vec3<f32>(0.0, 0.0, 1.0),
    );
    // Alpha: 0 where something is met.
    let missed = evaluate_ssr(from_tangent * lobe.wi, surface.world_position.xyz, random.z).a;
    return weight * (1.0 - missed);
}

@fragment
fn take(@builtin(position) position: vec4<f32>) -> Targets {
    let share = vec4<f32>(0.0, 0.0, 0.0, taken(position.xy + view.main_pass_viewport.xy));
    var targets: Targets;
    targets.first = share;
#ifdef SECOND_TARGET
    targets.second = share;
#endif
    return targets;
}
