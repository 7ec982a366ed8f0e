// The bounced light of a pixel, averaged with that of the last frames as far as these still hold.
//
// What the last frames say may be off this frame's light by `TOLERANCE` of it, and by a part of the standard deviation of the pixels
// around that show the same surface. Salvi 2016, "An Excursion in Temporal Supersampling", clips history to the range that these span;
// here its weight falls with the square of how far it is off, and at the end of the range it is forgotten. So a light that is switched
// shows in that frame, and no pixel is ever further off its own frame's light than 2 / sqrt(27) of the range: 2.4 percent where light
// is even, 4.1 percent where it is not. After a budget has changed how many lights there are, the light is the same but for where these
// lie: then the range is `LENIENT` times as wide at first and within it hardly any weight is lost, so that the new lights are faded in.
//
// Cost: what `recall.wgsl` costs; where history of eight frames is more than about 2 percent off, nine texels of light
// and of surfaces besides.

#import bevy_bounce::history::recall::{view, parameters, surface_texture, recall, is_finite}
#import bevy_bounce::interleaved::surface::{
    Surface, lens_of, surface_of, unpack_surface, is_same_surface,
}

@group(0) @binding(6) var light_texture: texture_2d<f32>;
/// Light, and over how many frames it is averaged: 0 where it is not to be recalled.
@group(0) @binding(7) var output: texture_storage_2d<rgba16float, write>;

/// Share of the light by which history may be off it.
const TOLERANCE: f32 = 0.06;
/// Standard deviations by which it may be off besides, and share of the light that these are at most.
const DEVIATIONS: f32 = 0.25;
const LARGEST_DEVIATION: f32 = 0.04;
/// Times the range is as wide at full leniency.
const LENIENT: f32 = 16.0;
/// Share of a half float that takes it to the next one.
const HALF_STEP: f32 = 0.0005;
/// Pre-exposed light below what any display shows.
const BLACK: f32 = 1e-6;

/// Standard deviation of the light around a pixel on its surface.
fn deviation_around(center: Surface, pixel: vec2<i32>, light: vec3<f32>) -> vec3<f32> {
    let size = vec2<i32>(textureDimensions(surface_texture));
    let lens = lens_of(view, textureDimensions(surface_texture));
    var sum = vec3<f32>(0.0);
    var squares = vec3<f32>(0.0);
    var count = 1.0;
    for (var i = 0; i < 9; i++) {
        let other = pixel + vec2<i32>(i % 3, i / 3) - 1;
        if i == 4 || any(other < vec2<i32>(0)) || any(other >= size) {
            continue;
        }
        let texel = textureLoad(surface_texture, other, 0).xy;
        let difference = textureLoad(light_texture, other, 0).rgb - light;
        if is_same_surface(center, surface_of(lens, texel, vec2<u32>(other))) && is_finite(difference) {
            sum += difference;
            squares += difference * difference;
            count += 1.0;
        }
    }
    let offset = sum / count;
    return sqrt(max(squares / count - offset * offset, vec3<f32>(0.0)));
}

// How much of history is lost that lies so far off, over the range in which it may.
fn loss_of(off: vec3<f32>, range: vec3<f32>) -> f32 {
    let part = off / (range * mix(1.0, LENIENT, parameters.leniency) + BLACK);
    let worst = min(max(part.x, max(part.y, part.z)), 1.0);
    let square = worst * worst;
    // Evenly, while lights are faded in.
    return mix(square, square * square * square * square, parameters.leniency);
}

// This frame's light and that of the last ones.
fn averaged(surface: Surface, pixel: vec2<u32>, light: vec3<f32>, past: vec4<f32>) -> vec4<f32> {
    if past.a < 1.0 {
        return vec4<f32>(light, 1.0);
    }
    // Of both, so that what grows is let go as readily as what shrinks.
    let middle = 0.5 * (past.rgb + light);
    let off = abs(past.rgb - light);
    let least = 1.0 / min(past.a + 1.0, parameters.frames);
    var loss = loss_of(off, TOLERANCE * middle);
    // Where it is lost no faster than it is replaced, a wider range changes nothing.
    if loss > least {
        let deviation = DEVIATIONS * deviation_around(surface, vec2<i32>(pixel), light);
        loss = loss_of(off, TOLERANCE * middle + min(deviation, LARGEST_DEVIATION * middle));
    }
    let weight = clamp(loss, least, 1.0);
    // By a step of a half float at least, so that what stands still arrives.
    let step = min(off, max(weight * off, HALF_STEP * past.rgb));
    return vec4<f32>(past.rgb + sign(light - past.rgb) * step, 1.0 / weight);
}

@compute @workgroup_size(8, 8)
fn average(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
    let light = textureLoad(light_texture, id.xy, 0).rgb;
    var result = vec4<f32>(0.0);
    if surface.valid {
        result = recall(surface, id.xy);
        if is_finite(light) {
            result = averaged(surface, id.xy, light, result);
        }
    }
    textureStore(output, id.xy, result);
}
