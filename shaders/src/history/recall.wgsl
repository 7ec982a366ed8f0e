// What the last frames knew of the light where a pixel's surface was then.
//
// A surface that stands still is looked up by its position in the world, which holds for every projection, with jitter
// and without, and across cuts. What moves by itself is found by the part of its motion vector that is not the
// camera's. Each of the four pixels around that place counts only if it showed the same surface: in its plane, where
// the surface stands still; near by, where it moves.
//
// Cost: a motion vector, four words, and up to four texels of light.

#define_import_path bevy_bounce::history::recall

#import bevy_render::view::View
#import bevy_bounce::history::surfaces::{HistoryParameters, seen_depth, seen_normal}
#import bevy_bounce::interleaved::surface::{Surface, NORMAL_EDGE, PLANE_EDGE}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> parameters: HistoryParameters;
@group(0) @binding(2) var surface_texture: texture_2d<u32>;
@group(0) @binding(3) var motion_texture: texture_2d<f32>;
/// Light, and over how many frames it is averaged.
@group(0) @binding(4) var past_light: texture_2d<f32>;
@group(0) @binding(5) var past_surfaces: texture_2d<u32>;

/// Pixels a frame below which a surface stands still.
const STILL: f32 = 0.02;
/// Pixels off a pixel's middle below which its light is taken as it is.
const AT_REST: f32 = 0.002;
/// Relative rounding of the halves that hold motion vectors, and of their difference.
const HALF_ROUNDING: f32 = 0.001;
/// Pixels around what moves within which it is still itself, and pixels more for each that it moves.
const NEAR: vec2<f32> = vec2<f32>(4.0, 2.0);
/// Share of the weights below which the four pixels know too little.
const ENOUGH: f32 = 0.05;

fn is_finite(light: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(light) & vec3<u32>(0x7f800000u)) != vec3<u32>(0x7f800000u));
}

fn to_uv(clip: vec4<f32>) -> vec2<f32> {
    return clip.xy / clip.w * vec2<f32>(0.5, -0.5) + 0.5;
}

/// Motion of a surface that is its own, not the camera's: pixels; zero where it stands still.
fn own_motion(position: vec3<f32>, pixel: vec2<u32>, size: vec2<f32>) -> vec2<f32> {
    let seen = textureLoad(motion_texture, pixel + vec2<u32>(view.main_pass_viewport.xy), 0).xy;
    let now = to_uv(view.unjittered_clip_from_world * vec4<f32>(position, 1.0));
    let then = to_uv(parameters.previous_unjittered_clip_from_world * vec4<f32>(position, 1.0));
    let own = (seen - (now - then)) * size;
    let rounding = HALF_ROUNDING * abs(seen) * size;
    return select(vec2<f32>(0.0), own, any(abs(own) > STILL + rounding));
}

fn position_then(pixel: vec2<i32>, size: vec2<f32>, depth: f32) -> vec3<f32> {
    let uv = (vec2<f32>(pixel) + 0.5) / size;
    let p = parameters.previous_world_from_clip * vec4<f32>(uv * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0), depth, 1.0);
    return p.xyz / p.w;
}

/// How much a pixel of the last frame knows of the surface, 0 to 1.
fn kinship(surface: Surface, word: u32, there: vec3<f32>, own: vec2<f32>) -> f32 {
    let alike = (dot(surface.normal, seen_normal(word)) - NORMAL_EDGE) / (1.0 - NORMAL_EDGE);
    let apart = there - surface.position;
    let moved = length(own);
    let near = select(
        abs(dot(surface.normal, apart)) < PLANE_EDGE * surface.footprint,
        length(apart) < (NEAR.x + NEAR.y * moved) * surface.footprint,
        moved > 0.0,
    );
    return select(0.0, saturate(alike), near && word != 0u);
}

/// Light in this frame's exposure, and over how many frames it is averaged: 0 where nothing is known.
fn recall(surface: Surface, pixel: vec2<u32>) -> vec4<f32> {
    let size = vec2<f32>(textureDimensions(surface_texture));
    let own = own_motion(surface.position, pixel, size);
    let clip = parameters.previous_clip_from_world * vec4<f32>(surface.position, 1.0);
    let exact = to_uv(clip) * size - own - 0.5;
    // What stands still is found where it is, however numbers are rounded.
    let place = select(exact, round(exact), abs(exact - round(exact)) < vec2<f32>(AT_REST));
    // Also where it is not finite.
    if parameters.valid == 0u || clip.w <= 0.0 || !all(abs(place - 0.5 * size) < size) {
        return vec4<f32>(0.0);
    }
    let corner = floor(place);
    let part = place - corner;
    var sum = vec4<f32>(0.0);
    var weights = 0.0;
    for (var i = 0; i < 4; i++) {
        let offset = vec2<i32>(i & 1, i >> 1u);
        let texel = vec2<i32>(corner) + offset;
        let share = mix(1.0 - part, part, vec2<f32>(offset));
        if any(texel < vec2<i32>(0)) || any(texel >= vec2<i32>(size)) || share.x * share.y == 0.0 {
            continue;
        }
        let word = textureLoad(past_surfaces, texel, 0).x;
        let weight = share.x * share.y * kinship(surface, word, position_then(texel, size, seen_depth(word)), own);
        let light = textureLoad(past_light, texel, 0);
        if weight > 0.0 && light.a >= 1.0 && is_finite(light.rgb) {
            sum += weight * light;
            weights += weight;
        }
    }
    if weights < ENOUGH {
        return vec4<f32>(0.0);
    }
    return vec4<f32>(sum.rgb / weights * parameters.exposure, sum.a / weights);
}
