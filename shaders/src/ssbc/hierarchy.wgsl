// A texel of the hierarchy: what its pixels show, in four words. A pixel is one of level 0, and a plane.
//
// | word | a plane | an edge |
// |---|---|---|
// | x | bits of the mean reverse-z depth | nearest and farthest depth, 16 bits each |
// | y | mean normal, octahedral | the same |
// | z | low half: area over that of the texel seen head-on, f16; 0 where nothing is seen | the same, and the highest bit |
// | w | mean radiance, rgb9e5, pre-exposed | the same |
//
// The mean of reverse-z depths is the depth of the plane at the texel's middle. The bit of the edge is the discontinuity
// buffer: the pixels do not lie in one plane, and the range of their depths says how far apart they may be.
// Nichols et al. 2009, "Hierarchical Image-Space Radiosity for Interactive Global Illumination".

#define_import_path bevy_bounce::ssbc::hierarchy

#import bevy_pbr::rgb9e5::{vec3_to_rgb9e5_, rgb9e5_to_vec3_}
#import bevy_bounce::interleaved::surface::Lens
#import bevy_bounce::shared::octahedral::{encode_unit, decode_unit}
#import bevy_bounce::ssbc::common::texel_at

/// Levels above the pixels.
const SSBC_LEVELS: u32 = 6u;
const EDGE: u32 = 0x80000000u;
/// A depth in 16 bits: five of the exponent, eleven of the mantissa of a float from 2^-32 up.
const LOWEST_DEPTH: u32 = 0x2f800000u;
const RANGE_SHIFT: u32 = 12u;
/// Most that depth may vary from pixel to pixel, over that depth: at the horizon it would reach to infinity.
const MOST_STEP: f32 = 0.25;
/// Largest finite half float.
const HALF_MAX: f32 = 65504.0;

struct Node {
    // Reverse-z: mean, nearest, farthest.
    depth: f32,
    near: f32,
    far: f32,
    // World units; 0 where nothing is seen.
    area: f32,
    normal: vec3<f32>,
    edge: bool,
    radiance: vec3<f32>,
}

// By how much the depth of a plane through the middle of a texel may differ at its corners. Next to the receiver it may go on to the
// middles of the pixels around the texel: see `near.wgsl`.
fn depth_range(lens: Lens, normal: vec3<f32>, position: vec3<f32>, depth: f32, level: u32) -> f32 {
    let across = abs(dot(normal, lens.right)) + abs(dot(normal, lens.down));
    let along = abs(dot(normal, lens.depth.xyz) - dot(normal, position) * lens.depth.w);
    let step = min(across / max(along, 1e-30), MOST_STEP * depth);
    return 0.5 * (f32(1u << level) + 1.0) * step;
}

fn encode_range(near: f32, far: f32) -> u32 {
    let steps = max(bitcast<vec2<u32>>(vec2<f32>(near, far)), vec2<u32>(LOWEST_DEPTH)) - LOWEST_DEPTH;
    return min((steps.x >> RANGE_SHIFT) + 1u, 0xffffu) | (min(steps.y >> RANGE_SHIFT, 0xffffu) << 16u);
}

fn decode_range(word: u32) -> vec2<f32> {
    return bitcast<vec2<f32>>((vec2<u32>(word, word >> 16u) & vec2<u32>(0xffffu)) * (1u << RANGE_SHIFT) + LOWEST_DEPTH);
}

// Never 0: what is seen stays seen.
fn pack_area(ratio: f32) -> u32 {
    return pack2x16float(vec2<f32>(clamp(ratio, 1e-4, HALF_MAX), 0.0));
}

/// A pixel, from its texel of the surface texture.
fn encode_pixel(surface: vec2<u32>, area_ratio: f32, radiance: vec3<f32>) -> vec4<u32> {
    return vec4<u32>(surface, pack_area(area_ratio), vec3_to_rgb9e5_(radiance));
}

fn encode_node(lens: Lens, node: Node, texel: vec2<i32>, level: u32) -> vec4<u32> {
    if node.area <= 0.0 {
        return vec4<u32>(0u);
    }
    var depth = bitcast<u32>(node.depth);
    var middle = node.depth;
    if node.edge {
        depth = encode_range(node.near, node.far);
        let range = decode_range(depth);
        middle = 0.5 * (range.x + range.y);
    }
    let edge = texel_at(lens, texel, level, middle).w;
    return vec4<u32>(
        depth,
        encode_unit(node.normal),
        pack_area(node.area / (edge * edge)) | select(0u, EDGE, node.edge),
        vec3_to_rgb9e5_(node.radiance),
    );
}

fn decode_node(lens: Lens, words: vec4<u32>, texel: vec2<i32>, level: u32) -> Node {
    var node: Node;
    let ratio = unpack2x16float(words.z & 0xffffu).x;
    if ratio == 0.0 {
        return node;
    }
    node.edge = (words.z & EDGE) != 0u;
    node.normal = decode_unit(words.y);
    if node.edge {
        let range = decode_range(words.x);
        node.near = range.x;
        node.far = range.y;
        node.depth = 0.5 * (range.x + range.y);
    } else {
        node.depth = bitcast<f32>(words.x);
    }
    let position = texel_at(lens, texel, level, node.depth);
    if !node.edge {
        let range = depth_range(lens, node.normal, position.xyz, node.depth, level);
        node.near = node.depth + range;
        node.far = max(node.depth - range, 0.0);
    }
    node.area = ratio * position.w * position.w;
    node.radiance = rgb9e5_to_vec3_(words.w);
    return node;
}
