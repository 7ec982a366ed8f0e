// Direct light into the texels of baked objects, with Bevy's units, cones and ranges. Shadows are those of the objects: of its
// own by the texel's cube map, of others by their maps from outside from places all over the texel: as an object moves, its shadow does so
// by less than a texel.
//
// Cost: one thread a texel; a query of visibility for each light that it faces (four for a rect light), and sixteen for
// each other object on the way.

#import bevy_bounce::cssm::query::{between_candidates, is_hidden, is_shaded, is_seen_from_outside, sight, STRAIGHT}
#import bevy_bounce::cssm::texels::{
    bakes, half_side, load_texel, object_of, reflectance, scale_of, to_object, to_world, turn_to_object, turn_to_world, Texel,
}
#import bevy_bounce::cssm::types::CssmGather
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::lights::{range_window, spot_window, rect_part, rect_part_form_factor, RECT_PARTS}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene, LIGHT_SPOT, LIGHT_DIRECTIONAL, LIGHT_RECT}

@group(0) @binding(2) var<uniform> scene: Scene;
@group(0) @binding(3) var<storage, read> lights: array<Light>;
@group(0) @binding(4) var<uniform> settings: CssmGather;
// Of each texel, radiance without bounces, cd/m^2: emission before, with reflected direct light after; share reflected at the surface.
@group(0) @binding(5) var<storage, read_write> sources: array<vec4<f32>>;

/// Beyond everything, world units.
const FAR: f32 = 1e6;
/// Places along a side of a texel from which other objects are asked.
const PLACES: u32 = 4u;
/// Prime to their number.
const STRIDE: u32 = 7u;

// A texel in the world.
struct Place {
    object: u32,
    texel: Texel,
    position: vec3<f32>,
    normal: vec3<f32>,
    /// From its middle to the middles of two sides.
    across: vec3<f32>,
    up: vec3<f32>,
}

// One of a grid of points in the square from -1 to 1.
fn point_of(part: u32) -> vec2<f32> {
    return (2.0 * vec2<f32>(vec2<u32>(part % PLACES, part / PLACES)) + 1.0) / f32(PLACES) - 1.0;
}

// One of the places of a texel that stand for equal parts of it.
fn part_of(place: Place, part: u32) -> vec3<f32> {
    let at = point_of(part);
    return place.position + place.across * at.x + place.up * at.y;
}

// Which map from outside is asked from there: from one place to the next another one, so that all of them together ask the maps
// around the direction as much as they are near to it, and no shadow jumps as that turns.
fn aside(part: u32) -> vec2<f32> {
    return 0.5 * point_of(part * STRIDE % (PLACES * PLACES));
}

// Share of a texel that other objects leave to a directional light.
fn share_along(place: Place, direction: vec3<f32>) -> f32 {
    let radius = length(place.across + place.up);
    let between = between_candidates(place.position, place.position - direction * FAR, radius, place.object, place.object);
    if (between.words[0] | between.words[1]) == 0u {
        return 1.0;
    }
    var seen = 0.0;
    for (var part = 0u; part < PLACES * PLACES; part++) {
        seen += select(1.0, 0.0, is_shaded(part_of(place, part), direction, between, aside(part)));
    }
    return seen / f32(PLACES * PLACES);
}

fn directional(place: Place, light: Light) -> vec3<f32> {
    let cosine = -dot(place.normal, light.direction);
    let turned = turn_to_object(place.object, light.direction);
    if cosine <= 0.0 || !is_seen_from_outside(place.object, place.texel.position, turned, STRAIGHT) {
        return vec3<f32>(0.0);
    }
    return light.color * (cosine * share_along(place, light.direction));
}

// How much of a point is seen.
fn visible(place: Place, point: vec3<f32>) -> f32 {
    let own = sight(place.object, place.texel, to_object(place.object, point), settings.filtered != 0u);
    let radius = length(place.across + place.up);
    let between = between_candidates(place.position, point, radius, place.object, place.object);
    if own <= 0.0 || (between.words[0] | between.words[1]) == 0u {
        return own;
    }
    var seen = 0.0;
    for (var part = 0u; part < PLACES * PLACES; part++) {
        seen += select(1.0, 0.0, is_hidden(part_of(place, part), point, between, aside(part)));
    }
    return own * seen / f32(PLACES * PLACES);
}

fn punctual(place: Place, light: Light) -> vec3<f32> {
    let way = light.position - place.position;
    let square = max(dot(way, way), 1e-12);
    let direction = way * inverseSqrt(square);
    var strength = max(dot(place.normal, direction), 0.0) / square * range_window(light.range, square);
    if light.kind == LIGHT_SPOT {
        strength *= spot_window(light, -direction);
    }
    if strength <= 0.0 {
        return vec3<f32>(0.0);
    }
    return light.color * (strength * visible(place, light.position));
}

fn from_rect(place: Place, light: Light) -> vec3<f32> {
    var sum = 0.0;
    for (var part = 0u; part < RECT_PARTS * RECT_PARTS; part++) {
        let point = rect_part(light, part);
        let form_factor = rect_part_form_factor(light, point - place.position, place.normal);
        if form_factor > 0.0 {
            sum += form_factor * visible(place, point);
        }
    }
    let middle = light.position - place.position;
    return light.color * (sum * range_window(light.range, dot(middle, middle)));
}

@compute @workgroup_size(64)
fn direct(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let at = folded_index(group) * 64u + lane;
    if at >= bakes.lights {
        return;
    }
    let object = object_of(at);
    let texel = load_texel(object, at - bakes.objects[object].first_light);
    let across = half_side(texel.normal, texel.area);
    let half = length(across) * scale_of(object);
    let place = Place(
        object,
        texel,
        to_world(object, texel.position),
        turn_to_world(object, texel.normal),
        turn_to_world(object, across) * half,
        turn_to_world(object, cross(texel.normal, across)) * half,
    );
    var irradiance = vec3<f32>(0.0);
    for (var i = 0u; is_within(i, scene.light_count, half); i++) {
        let light = lights[i];
        if light.kind == LIGHT_DIRECTIONAL {
            irradiance += directional(place, light);
        } else if light.kind == LIGHT_RECT {
            irradiance += from_rect(place, light);
        } else {
            irradiance += punctual(place, light);
        }
    }
    sources[at] += vec4<f32>(reflectance(texel, sources[at].w) * irradiance / PI, 0.0);
}
