// Holes of masked triangles in the shadow maps of virtual lights.
//
// A triangle is 16 parts, its edges in quarters, each of which knows how much of it is there. A texel that shows a part shows it with that
// probability, by a hash of light, texel and triangle: the same every frame, and in the mean over texels and lights what holes let
// through. Stochastic transparency, Enderton, Sintorn, Shirley and Luebke 2010.

#define_import_path bevy_bounce::shadow_atlas::masks

#import bevy_bounce::shared::sampling::{hash, unit_float}

/// Parts along an edge.
const PARTS: u32 = 4u;
/// Parts of a triangle.
const PART_COUNT: u32 = 16u;
/// Steps of the share of a part that is there, of the largest one; and of that.
const SHARE_STEPS: u32 = 3u;
const MOST_STEPS: f32 = 255.0;

// How much of a triangle with holes is there.
struct Cover {
    // Of the part of which most is, in `MOST_STEPS`; 0 where nothing is.
    most: u32,
    // Of each, in `SHARE_STEPS` of that, 2 bits each.
    parts: u32,
}

/// The part of a triangle at a point of it, by the weights of its second and third corner: row by row from the edge between the first
/// two, those that stand on it and those that hang between them in turn.
fn part_at(weights: vec2<f32>) -> u32 {
    let place = clamp(weights, vec2<f32>(0.0), vec2<f32>(1.0)) * f32(PARTS);
    let row = min(u32(place.y), PARTS - 1u);
    let column = min(u32(place.x), PARTS - 1u - row);
    let along = place - vec2<f32>(vec2<u32>(column, row));
    let hangs = u32(along.x + along.y > 1.0 && row + column + 1u < PARTS);
    return row * (2u * PARTS - row) + 2u * column + hangs;
}

/// By the share of each part. What rounding takes from one the next ones get.
fn pack_cover(shares: array<f32, PART_COUNT>) -> Cover {
    var left = shares;
    var largest = 0.0;
    for (var part = 0u; part < PART_COUNT; part++) {
        largest = max(largest, left[part]);
    }
    let most = ceil(largest * MOST_STEPS - 0.01);
    if most <= 0.0 {
        return Cover(0u, 0u);
    }
    var word = 0u;
    var rest = 0.0;
    for (var part = 0u; part < PART_COUNT; part++) {
        let wanted = left[part] * f32(SHARE_STEPS) * (MOST_STEPS / most) + rest;
        let steps = clamp(round(wanted), 0.0, f32(SHARE_STEPS));
        rest = wanted - steps;
        word |= u32(steps) << (2u * part);
    }
    return Cover(u32(most), word);
}

/// Whether a part of a triangle is there for one texel of one light; `chance` is the hash of all three.
fn is_there(cover: Cover, part: u32, chance: u32) -> bool {
    let steps = (cover.parts >> (2u * part)) & SHARE_STEPS;
    return unit_float(chance) * f32(SHARE_STEPS) * MOST_STEPS < f32(steps * cover.most);
}
