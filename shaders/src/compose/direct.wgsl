// Direct light by Bevy's own lighting and shadow functions, and its diffuse part once more by itself.
//
// This is `apply_pbr_lighting` of bevy_pbr/src/render/pbr_functions.wgsl for the deferred G-buffer, without what bounced light
// replaces (ambient light, irradiance volumes, of environment maps the diffuse part) and without emission, which `compose.wgsl` adds. All
// targets are pre-exposed.
//
// Of lights it knows the kinds that there are (`POINT_LIGHTS`, `SPOT_LIGHTS`, `DIRECTIONAL_LIGHTS`, `RECT_LIGHTS`): what a shader could
// do holds registers, whether it does it or not.
//
// Where the sky's light bounces (`SKY`), what surfaces mirror of it goes into a target of its own, for `compose.wgsl` to shadow. What
// reflection probes show of their surroundings is with it, and is left as it is. Where ambient light is the sky (`AMBIENT`), what they
// mirror of that is what Bevy's `ambient_light` has them mirror.

#import bevy_pbr::clustered_forward as clustering
#import bevy_pbr::lighting
#import bevy_pbr::lighting::{LAYER_BASE, LAYER_CLEARCOAT}
#import bevy_pbr::mesh_types::MESH_FLAGS_SHADOW_RECEIVER_BIT
#import bevy_pbr::mesh_view_bindings as view_bindings
#import bevy_pbr::mesh_view_types
#import bevy_pbr::pbr_functions
#import bevy_pbr::pbr_types::PbrInput
#import bevy_pbr::shadows
#import bevy_bounce::compose::gbuffer::{load_pbr_input, diffuse_color}
#import bevy_bounce::compose::marks::LIT
#import bevy_bounce::compose::mirrored::pack_mirrored
#import bevy_bounce::shared::control::is_within

#ifdef ENVIRONMENT_MAP
#import bevy_pbr::environment_map
#endif
#ifdef SKY
#import bevy_pbr::light_probe
#endif
#ifdef AMBIENT
#import bevy_bounce::shared::sky::{Sky, AMBIENT_SHARE}
#endif

@group(2) @binding(0) var surface_texture: texture_2d<u32>;
#ifdef AMBIENT
@group(2) @binding(1) var<uniform> sky: Sky;
#endif

/// Largest finite half float.
const HALF_MAX: f32 = 65504.0;

struct Targets {
    /// Alpha: see marks.wgsl.
    @location(0) light: vec4<f32>,
    @location(1) diffuse: vec4<f32>,
#ifdef SKY
    /// What is mirrored of the sky and of reflection probes; alpha: `pack_mirrored` of how wide the lobe is, 0 for one as narrow as
    /// `mirrored_lobe` of interleaved/sky.wgsl, 1 for one as wide as the cosine's, and of the probes' share.
    @location(2) sky: vec4<f32>,
#endif
}

/// What Bevy's light functions want to know of a surface.
fn lighting_input(surface: PbrInput) -> lighting::LightingInput {
    let material = surface.material;
    let n_dot_v = max(dot(surface.N, surface.V), 0.0001);
    var input: lighting::LightingInput;
    input.layers[LAYER_BASE].NdotV = n_dot_v;
    input.layers[LAYER_BASE].N = surface.N;
    input.layers[LAYER_BASE].R = reflect(-surface.V, surface.N);
    input.layers[LAYER_BASE].perceptual_roughness = material.perceptual_roughness;
    input.layers[LAYER_BASE].roughness = lighting::perceptualRoughnessToRoughness(material.perceptual_roughness);
    input.P = surface.world_position.xyz;
    input.V = surface.V;
    input.diffuse_color = diffuse_color(surface);
    input.metallic = material.metallic;
    input.F0_dielectric = pbr_functions::calculate_F0_dielectric(material.reflectance);
    input.F0_metallic = material.base_color.rgb;
    input.F_ab = lighting::F_AB(material.perceptual_roughness, n_dot_v);
#ifdef STANDARD_MATERIAL_CLEARCOAT
    let roughness = material.clearcoat_perceptual_roughness;
    input.layers[LAYER_CLEARCOAT].NdotV = max(dot(surface.clearcoat_N, surface.V), 0.0001);
    input.layers[LAYER_CLEARCOAT].N = surface.clearcoat_N;
    input.layers[LAYER_CLEARCOAT].R = reflect(-surface.V, surface.clearcoat_N);
    input.layers[LAYER_CLEARCOAT].perceptual_roughness = roughness;
    input.layers[LAYER_CLEARCOAT].roughness = lighting::perceptualRoughnessToRoughness(roughness);
    input.clearcoat_strength = material.clearcoat;
#endif
    return input;
}

/// `shadow`, and where the light asks for it the shadow of what is near on the screen.
fn with_contact_shadow(surface: PbrInput, to_light: vec3<f32>, enabled: bool, shadow: f32) -> f32 {
#ifdef CONTACT_SHADOWS
#ifdef DEPTH_PREPASS
    let steps = view_bindings::contact_shadows_settings.linear_steps;
    if steps > 0u && enabled && shadow > 0.0 && (surface.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) != 0u {
        return shadow * pbr_functions::calculate_contact_shadow(
            surface.world_position.xyz,
            surface.frag_coord.xy,
            to_light,
            steps,
        );
    }
#endif
#endif
    return shadow;
}

fn with_contact_shadow_of_clustered(surface: PbrInput, light_id: u32, shadow: f32) -> f32 {
    let light = &view_bindings::clustered_lights.data[light_id];
    return with_contact_shadow(
        surface,
        normalize((*light).position_radius.xyz - surface.world_position.xyz),
        ((*light).flags & mesh_view_types::POINT_LIGHT_FLAGS_CONTACT_SHADOWS_ENABLED_BIT) != 0u,
        shadow,
    );
}

/// Whether a point or spot light has a shadow map that this surface shows.
fn is_shadowed_clustered(surface: PbrInput, light_id: u32) -> bool {
    let flags = view_bindings::clustered_lights.data[light_id].flags;
    return (surface.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) != 0u
        && (flags & mesh_view_types::POINT_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u;
}

fn exposed(light: vec3<f32>, alpha: f32) -> vec4<f32> {
    return vec4<f32>(clamp(light * view_bindings::view.exposure, vec3<f32>(0.0), vec3<f32>(HALF_MAX)), alpha);
}

#ifdef SKY
/// How much of what environment maps show at a point is from reflection probes, as `compute_radiances` of
/// bevy_pbr/src/light_probe/environment_map.wgsl weighs them.
fn share_of_probes(position: vec3<f32>, ranges: ptr<function, clustering::ClusterableObjectIndexRanges>) -> f32 {
    var share = 0.0;
#ifdef MULTIPLE_LIGHT_PROBES_IN_ARRAY
    var probes = light_probe::light_probe_iterator_new(position, false, ranges);
    var probe = light_probe::light_probe_iterator_next(&probes);
    while probe.texture_index >= 0 {
        share += probe.weight;
        probe = light_probe::light_probe_iterator_next(&probes);
    }
#endif
    return min(share, 1.0);
}

/// From 0 for the lobe of `mirrored_lobe` of interleaved/sky.wgsl to 1 for the cosine's. `roughness`: squared.
fn lobe_width(roughness: f32) -> f32 {
    return saturate(2.0 * roughness - 1.0);
}
#endif

#ifdef AMBIENT
/// What is mirrored of ambient light, as in bevy_pbr/src/render/pbr_ambient.wgsl. The sky is as bright as diffuse surfaces show that.
fn mirrored_ambient(surface: PbrInput, input: lighting::LightingInput) -> vec3<f32> {
    let ambient = sky.radiance / AMBIENT_SHARE;
    let f_zero = mix(input.F0_dielectric, input.F0_metallic, input.metallic);
    let occlusion = saturate(dot(f_zero, vec3<f32>(50.0 * 0.33)));
    return lighting::EnvBRDFApprox(f_zero, input.F_ab) * occlusion * ambient * surface.diffuse_occlusion;
}
#endif

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> Targets {
    var targets: Targets;
    if textureLoad(surface_texture, vec2<i32>(position.xy), 0).x == 0u {
        return targets;
    }
    let surface = load_pbr_input(vec2<i32>(position.xy) + vec2<i32>(view_bindings::view.main_pass_viewport.xy));
    var input = lighting_input(surface);
    let view_z = (view_bindings::view.view_from_world * surface.world_position).z;
    let cluster = clustering::view_fragment_cluster_index(surface.frag_coord.xy, view_z, surface.is_orthographic);
    var ranges = clustering::unpack_clusterable_object_index_ranges(cluster);

    // Bevy's functions return diffuse and specular light in one; their `enable_diffuse` tells the two apart, and what both
    // calls have in common is computed once after inlining.
    var light = vec3<f32>(0.0);
    var diffuse = vec3<f32>(0.0);

#ifdef POINT_LIGHTS
    for (var i = ranges.first_point_light_index_offset; i < ranges.first_spot_light_index_offset; i += 1u) {
        let id = clustering::get_clusterable_object_id(i);
        var shadow = 1.0;
        if is_shadowed_clustered(surface, id) {
            shadow = shadows::fetch_point_shadow(id, surface.world_position, surface.world_normal, surface.frag_coord.xy);
        }
        shadow = with_contact_shadow_of_clustered(surface, id, shadow);
        let both = lighting::point_light(id, &input, true, true);
        light += both * shadow;
        diffuse += (both - lighting::point_light(id, &input, false, true)) * shadow;
    }
#endif

#ifdef SPOT_LIGHTS
    for (var i = ranges.first_spot_light_index_offset; i < ranges.first_reflection_probe_index_offset; i += 1u) {
        let id = clustering::get_clusterable_object_id(i);
        var shadow = 1.0;
        if is_shadowed_clustered(surface, id) {
            shadow = shadows::fetch_spot_shadow(
                id,
                surface.world_position,
                surface.world_normal,
                view_bindings::clustered_lights.data[id].shadow_map_near_z,
                surface.frag_coord.xy,
            );
        }
        shadow = with_contact_shadow_of_clustered(surface, id, shadow);
        let both = lighting::spot_light(id, &input, true);
        light += both * shadow;
        diffuse += (both - lighting::spot_light(id, &input, false)) * shadow;
    }
#endif

#ifdef DIRECTIONAL_LIGHTS
    for (var id = 0u; is_within(id, view_bindings::lights.n_directional_lights, view_z); id += 1u) {
        let flags = view_bindings::lights.directional_lights[id].flags;
        var shadow = 1.0;
        if (surface.flags & MESH_FLAGS_SHADOW_RECEIVER_BIT) != 0u
            && (flags & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_SHADOWS_ENABLED_BIT) != 0u {
            shadow = shadows::fetch_directional_shadow(
                id,
                surface.world_position,
                surface.world_normal,
                view_z,
                surface.frag_coord.xy,
            );
        }
        shadow = with_contact_shadow(
            surface,
            view_bindings::lights.directional_lights[id].direction_to_light,
            (flags & mesh_view_types::DIRECTIONAL_LIGHT_FLAGS_CONTACT_SHADOWS_ENABLED_BIT) != 0u,
            shadow,
        );
        let both = lighting::directional_light(id, &input, true);
        light += both * shadow;
        diffuse += (both - lighting::directional_light(id, &input, false)) * shadow;
    }
#endif

#ifdef RECT_LIGHTS
#ifdef AREA_LIGHT_LUTS
    for (var id = 0u; is_within(id, view_bindings::lights.n_rect_lights, view_z); id += 1u) {
        let both = lighting::rect_light(id, &input, true);
        light += both;
        diffuse += both - lighting::rect_light(id, &input, false);
    }
#endif
#endif

    var mirrored = vec3<f32>(0.0);
    var probes = 0.0;
#ifdef ENVIRONMENT_MAP
#ifdef SKY
    // The sky's light by the diffuse colour is with what bounces; what metals reflect after several bounces in their relief is not.
    input.diffuse_color = vec3<f32>(0.0);
#endif
    let environment = environment_map::environment_map_light(&input, &ranges, false);
    mirrored = environment.specular * surface.specular_occlusion;
#ifdef SCREEN_SPACE_REFLECTIONS
#ifndef SKY
    // Bevy's screen-space reflections add it, whatever the roughness; under a sky that bounces they do not.
    mirrored = vec3<f32>(0.0);
#endif
#endif
#ifdef SKY
#ifndef COMPOSE_GLOSSY
    // With it goes where screen-space reflections meet something, though they lack it.
    mirrored += environment.diffuse * surface.diffuse_occlusion;
#endif
    probes = share_of_probes(surface.world_position.xyz, &ranges);
#else
    light += mirrored + environment.diffuse * surface.diffuse_occlusion;
#endif
#endif

#ifdef AMBIENT
    let ambient = mirrored_ambient(surface, input);
    probes *= dot(mirrored, vec3<f32>(1.0)) / max(dot(mirrored + ambient, vec3<f32>(1.0)), 1e-20);
    mirrored += ambient;
#endif
#ifdef SKY
    targets.sky = exposed(mirrored, pack_mirrored(lobe_width(input.layers[LAYER_BASE].roughness), probes));
#endif

    targets.light = exposed(light, LIT);
    targets.diffuse = exposed(diffuse, LIT);
    return targets;
}
