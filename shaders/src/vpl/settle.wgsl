// What each path met first, near where it met the grid and near where it started: a voxel knows only the mean of the surfaces in it,
// behind which lights would be buried by every ledge and fold, and which tells nothing of what is next to a surface in a corner.
//
// Each triangle of the scene looks for the ways that are filed under the blocks it lies in (see `ways.wgsl`).
//
// Of nested grids each has its own ways, and its own voxels for their reach: triangles look for them in each.
//
// Cost, a bounce: one thread a triangle, for each grid about 20 operations for each brick in its box and each block of those that its
// plane goes through, a load for each block that it goes through, four loads and as many operations for each way in these, and
// about 60 more for each way that lies in the triangle's box.

#import bevy_bounce::shared::grid::{Grid, GridLevel, grid_level, leap_dims, BRICK, LEAP_BLOCK}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::scene::{Chunk, Scene}
#import bevy_bounce::shared::triangles::{Triangle, load_triangle, surface_cover}
#import bevy_bounce::vpl::types::{Vpl, SETTLE_RANGE, pack_meeting}
#import bevy_bounce::vpl::ways::{
    Way, way_from_start, way_at_hit, block_index, MEETING_WORDS, MEETING_HIT, MEETING_START, MEETING_SLOT, MEETING_START_BLOCKS,
}

@group(0) @binding(4) var<uniform> grid: Grid;
@group(0) @binding(5) var<uniform> scene: Scene;
@group(0) @binding(6) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(7) var<storage, read> vertices: array<Vpl>;
// By block of the grid, the first of the ways that are filed under it: a word of `meetings`, counted from 1.
@group(0) @binding(8) var<storage, read> way_heads: array<u32>;
// `MEETING_WORDS` a path.
@group(0) @binding(9) var<storage, read_write> meetings: array<atomic<u32>>;

// The grid that ways are looked for in; positions in its voxels.
var<private> level: GridLevel;
// Whether the triangle is: ways beside the grid are filed under its outermost blocks.
var<private> is_beside: bool;

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

/// Voxels from its plane within which a way starts on the triangle, where both look the same way: packed directions point below it.
const OWN_PLANE: f32 = 0.01;
const SAME_WAY: f32 = 0.99;
// Voxels; covers the rounding of where ways go from block to block.
const SLACK: f32 = 1e-3;

// Distance along the way at which it meets the triangle; negative where it does not. Moeller & Trumbore 1997.
fn meet(way: Way, t: Triangle) -> f32 {
    let ab = t.b - t.a;
    let ac = t.c - t.a;
    let p = cross(way.direction, ac);
    let determinant = dot(ab, p);
    if determinant == 0.0 || (!t.two_sided && dot(t.normal, way.direction) >= 0.0) {
        return -1.0;
    }
    let from_a = way.start - t.a;
    if abs(dot(t.normal, from_a)) < OWN_PLANE && abs(dot(t.normal, way.normal)) > SAME_WAY {
        return -1.0;
    }
    let q = cross(from_a, ab);
    let place = vec3<f32>(dot(from_a, p), dot(way.direction, q), dot(ac, q)) / determinant;
    let inside = place.x >= 0.0 && place.y >= 0.0 && place.x + place.y <= 1.0 && place.z <= way.length;
    return select(-1.0, place.z, inside);
}

fn try_way(slot: u32, meeting: u32, way: Way, t: Triangle, box: Box) {
    let end = way.start + way.direction * way.length;
    if any(max(way.start, end) < box.low) || any(min(way.start, end) > box.high) {
        return;
    }
    let distance = meet(way, t);
    if distance < 0.0 {
        return;
    }
    if surface_cover(t, way.start + way.direction * distance) <= unit_float(hash(vertices[slot].sample)) {
        return;
    }
    let normal = t.normal * -sign(dot(t.normal, way.direction));
    atomicMin(&meetings[meeting], pack_meeting(distance, normal));
}

fn try_block(block: vec3<i32>, t: Triangle, box: Box) {
    var next = way_heads[block_index(level, block)];
    while next != 0u {
        let path = (next - 1u) / MEETING_WORDS * MEETING_WORDS;
        let slot = atomicLoad(&meetings[path + MEETING_SLOT]);
        let incoming = vertices[slot].incoming;
        if next - 1u - path >= MEETING_START_BLOCKS {
            try_way(slot, path + MEETING_START, way_from_start(level, vertices[slot - 1u], incoming), t, box);
        } else {
            try_way(slot, path + MEETING_HIT, way_at_hit(level, vertices[slot].position, incoming), t, box);
        }
        next = atomicLoad(&meetings[next - 1u]);
    }
}

// Whether the triangle's plane goes through a cube of that edge, counted in such.
fn is_near_plane(t: Triangle, cube: vec3<i32>, edge: f32) -> bool {
    if is_beside {
        return true;
    }
    let center = (vec3<f32>(cube) + 0.5) * edge;
    let n = abs(t.normal);
    return abs(dot(t.normal, center - t.a)) <= (0.5 * edge + SLACK) * (n.x + n.y + n.z);
}

fn try_brick(brick: vec3<i32>, t: Triangle, low_block: vec3<i32>, high_block: vec3<i32>, box: Box) {
    let edge = f32(LEAP_BLOCK);
    let across = i32(BRICK / LEAP_BLOCK);
    let low = max(low_block, brick * across);
    let high = min(high_block, brick * across + across - 1);
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let block = vec3<i32>(x, y, z);
                if is_near_plane(t, block, edge) {
                    try_block(block, t, box);
                }
            }
        }
    }
}

fn look_for_ways(t: Triangle) {
    let box = Box(min(t.a, min(t.b, t.c)) - SLACK, max(t.a, max(t.b, t.c)) + SLACK);
    let dims = vec3<f32>(level.dims);
    if any(box.high < vec3<f32>(-SETTLE_RANGE)) || any(box.low > dims + SETTLE_RANGE) {
        return;
    }
    is_beside = any(box.high < vec3<f32>(0.0)) || any(box.low > dims);
    let last = vec3<i32>(leap_dims(level)) - 1;
    let low_block = clamp(vec3<i32>(floor(box.low / f32(LEAP_BLOCK))), vec3<i32>(0), last);
    let high_block = clamp(vec3<i32>(floor(box.high / f32(LEAP_BLOCK))), vec3<i32>(0), last);
    let low = low_block / i32(BRICK / LEAP_BLOCK);
    let high = high_block / i32(BRICK / LEAP_BLOCK);
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                let brick = vec3<i32>(x, y, z);
                if is_near_plane(t, brick, f32(BRICK)) {
                    try_brick(brick, t, low_block, high_block, box);
                }
            }
        }
    }
}

@compute @workgroup_size(64)
fn meet_triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    if index >= scene.chunk_count {
        return;
    }
    let chunk = chunks[index];
    for (var i = 0u; i <= grid.further_count; i++) {
        level = grid_level(grid, i);
        let t = load_triangle(chunk.instance, chunk.first_triangle + lane, level.origin, level.voxel_size);
        if t.valid {
            look_for_ways(t);
        }
    }
}
