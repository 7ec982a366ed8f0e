// Direct light into the texels of a baked object, with Bevy's units, cones and ranges. Shadows are the object's own: of lights
// within its box by the texel's cube map, of those outside by the maps from outside.
//
// Cost: one thread a texel; a query of visibility for each light that it faces.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::cssm::query::{visibility, is_seen_from_outside}
#import bevy_bounce::cssm::texels::{bake, load_texel, to_object, to_world, turn_to_object, turn_to_world, Texel}
#import bevy_bounce::cssm::types::CssmGather
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene, LIGHT_SPOT, LIGHT_DIRECTIONAL}

@group(0) @binding(2) var<uniform> scene: Scene;
@group(0) @binding(3) var<storage, read> lights: array<Light>;
@group(0) @binding(4) var<uniform> settings: CssmGather;
// Of each texel, radiance without bounces, cd/m^2: emission before, with reflected direct light after.
@group(0) @binding(5) var<storage, read_write> sources: array<vec4<f32>>;


// Bevy's window: 1 near the light, 0 at its range. Karis 2013, "Real Shading in Unreal Engine 4".
fn range_window(range: f32, square: f32) -> f32 {
    if range <= 0.0 {
        return 1.0;
    }
    let f = square / (range * range);
    let window = clamp(1.0 - f * f, 0.0, 1.0);
    return window * window;
}

fn directional(texel: Texel, normal: vec3<f32>, light: Light) -> vec3<f32> {
    let cosine = -dot(normal, light.direction);
    if cosine <= 0.0 || !is_seen_from_outside(texel.position, turn_to_object(light.direction)) {
        return vec3<f32>(0.0);
    }
    return light.color * cosine;
}

fn punctual(texel: Texel, position: vec3<f32>, normal: vec3<f32>, light: Light) -> vec3<f32> {
    let way = light.position - position;
    let square = max(dot(way, way), 1e-12);
    let direction = way * inverseSqrt(square);
    var strength = max(dot(normal, direction), 0.0) / square * range_window(light.range, square);
    if light.kind == LIGHT_SPOT {
        let cone = clamp(-dot(direction, light.direction) * light.spot_scale + light.spot_offset, 0.0, 1.0);
        strength *= cone * cone;
    }
    if strength <= 0.0 {
        return vec3<f32>(0.0);
    }
    let place = to_object(light.position);
    if all(place >= bake.bounds_min) && all(place <= bake.bounds_max) {
        strength *= visibility(texel, place, settings.filtered != 0u);
    } else if !is_seen_from_outside(texel.position, texel.position - place) {
        strength = 0.0;
    }
    return light.color * strength;
}

@compute @workgroup_size(64)
fn direct(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * 64u + lane;
    if index >= bake.texel_count {
        return;
    }
    let texel = load_texel(index);
    let position = to_world(texel.position);
    let normal = normalize(turn_to_world(texel.normal));
    var irradiance = vec3<f32>(0.0);
    for (var i = 0u; i < scene.light_count; i++) {
        let light = lights[i];
        if light.kind == LIGHT_DIRECTIONAL {
            irradiance += directional(texel, normal, light);
        } else {
            irradiance += punctual(texel, position, normal, light);
        }
    }
    sources[index] += vec4<f32>(texel.diffuse * irradiance / PI, 0.0);
}
