// What a pixel of the last frame showed, in one word, and how the passes of the history are told of that frame.
//
// | bits | hold |
// |---|---|
// | 12 to 31 | reverse-z depth: five bits of the exponent, fifteen of the mantissa of a float from 2^-32 up; at most 2^-16 of it off |
// | 0 to 11 | normal, octahedral, 6 bits each: three degrees off at most |
//
// 0 stands for nothing that is lit.

#define_import_path bevy_bounce::history::surfaces

#import bevy_bounce::shared::octahedral::{unit_to_octahedral, octahedral_to_unit}

struct HistoryParameters {
    // Of the last frame, as it was drawn: jittered where the camera is.
    previous_clip_from_world: mat4x4<f32>,
    previous_world_from_clip: mat4x4<f32>,
    // Of the last frame, as motion vectors count: without jitter.
    previous_unjittered_clip_from_world: mat4x4<f32>,
    // This frame's exposure over the last one's.
    exposure: f32,
    // Frames over which light is averaged at most.
    frames: f32,
    // Whether there is a last frame.
    valid: u32,
    // 0, or up to 1 after a budget has changed how many lights there are: how much further off history may be.
    leniency: f32,
}

/// Bits of the least depth that is told from none.
const LEAST_DEPTH: u32 = 0x2f800000u;
/// Bits of the mantissa that are left out.
const DEPTH_SHIFT: u32 = 8u;
const DEPTH_MAX: u32 = 0xfffffu;
const NORMAL_BITS: u32 = 12u;
const NORMAL_MAX: f32 = 31.0;

fn pack_seen(depth: f32, normal: vec3<f32>) -> u32 {
    if depth <= 0.0 {
        return 0u;
    }
    let steps = (max(bitcast<u32>(depth), LEAST_DEPTH) - LEAST_DEPTH + (1u << (DEPTH_SHIFT - 1u))) >> DEPTH_SHIFT;
    let corner = clamp(unit_to_octahedral(normal), vec2<f32>(-1.0), vec2<f32>(1.0));
    let place = vec2<u32>(vec2<i32>(round(corner * NORMAL_MAX)) + 32);
    return (min(steps, DEPTH_MAX) << NORMAL_BITS) | (place.x << 6u) | place.y;
}

fn seen_depth(word: u32) -> f32 {
    return bitcast<f32>(((word >> NORMAL_BITS) << DEPTH_SHIFT) + LEAST_DEPTH);
}

fn seen_normal(word: u32) -> vec3<f32> {
    let place = vec2<f32>(f32((word >> 6u) & 63u), f32(word & 63u)) - 32.0;
    return octahedral_to_unit(place / NORMAL_MAX);
}
