// Stretches of paths on which they are tested against triangles: near where a path starts, and near where it met the grid. Each is filed
// under the blocks of 2^3 voxels that it goes through (`places.wgsl`), and triangles look into those that they lie in (`settle.wgsl`).
//
// Lengths are in voxels of the grid that a way is in.

#define_import_path bevy_bounce::vpl::ways

#import bevy_bounce::shared::grid::{GridLevel, leap_dims, to_level, LEAP_BLOCK}
#import bevy_bounce::vpl::types::{Vpl, SETTLE_RANGE, incoming_direction, incoming_reach}

/// Words a path has for what it met: distance and normal of what was first where it met the grid, the same near its start; the slot
/// of its vertex; then for each block of either way what else is filed under it: a word of this buffer, counted from 1.
const MEETING_WORDS: u32 = MEETING_START_BLOCKS + START_BLOCKS;
const MEETING_HIT: u32 = 0u;
const MEETING_START: u32 = 1u;
const MEETING_SLOT: u32 = 2u;
const MEETING_HIT_BLOCKS: u32 = 3u;
const MEETING_START_BLOCKS: u32 = MEETING_HIT_BLOCKS + HIT_BLOCKS;
/// Blocks that ways of 2 and of 1 `SETTLE_RANGE` go through at most.
const HIT_BLOCKS: u32 = 6u;
const START_BLOCKS: u32 = 4u;

struct Way {
    start: vec3<f32>,
    direction: vec3<f32>,
    length: f32,
    // Of the surface that it starts on; zero in the air.
    normal: vec3<f32>,
}

/// From the surface that a path starts on.
fn way_from_start(level: GridLevel, start: Vpl, incoming: u32) -> Way {
    return Way(to_level(level, start.position), incoming_direction(incoming), SETTLE_RANGE, start.normal);
}

/// Before and behind where a path met the grid.
fn way_at_hit(level: GridLevel, position: vec3<f32>, incoming: u32) -> Way {
    let direction = incoming_direction(incoming);
    let before = incoming_reach(incoming);
    return Way(to_level(level, position) - direction * before, direction, before + SETTLE_RANGE, vec3<f32>(0.0));
}

/// From block to block along a way. Amanatides & Woo 1987.
struct Walk {
    block: vec3<i32>,
    // Distances at which it leaves the block along each axis, and between two such.
    leave: vec3<f32>,
    step: vec3<f32>,
}

fn walk_along(way: Way) -> Walk {
    let edge = f32(LEAP_BLOCK);
    let block = floor(way.start / edge);
    let speed = max(abs(way.direction), vec3<f32>(1e-6));
    let into = way.start - block * edge;
    let ahead = select(into, edge - into, way.direction > vec3<f32>(0.0));
    return Walk(vec3<i32>(block), ahead / speed, edge / speed);
}

/// To the next block; returns the distance at which it begins.
fn advance(walk: ptr<function, Walk>, way: Way) -> f32 {
    let leave = (*walk).leave;
    let distance = min(leave.x, min(leave.y, leave.z));
    var along = vec3<f32>(0.0, 0.0, 1.0);
    if leave.x == distance {
        along = vec3<f32>(1.0, 0.0, 0.0);
    } else if leave.y == distance {
        along = vec3<f32>(0.0, 1.0, 0.0);
    }
    (*walk).block += vec3<i32>(along * sign(way.direction));
    (*walk).leave += along * (*walk).step;
    return distance;
}

/// Index of a block; outside the grid, of the nearest.
fn block_index(level: GridLevel, block: vec3<i32>) -> u32 {
    let dims = leap_dims(level);
    let b = vec3<u32>(clamp(block, vec3<i32>(0), vec3<i32>(dims) - 1));
    return level.first_block + (b.z * dims.y + b.y) * dims.x + b.x;
}
