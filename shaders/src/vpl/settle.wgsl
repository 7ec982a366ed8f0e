// What each virtual light's path met first, near where it met the grid: a voxel knows only the mean of the surfaces in it,
// behind which lights would be buried by every ledge and fold.
//
// Each triangle of the scene looks for the lights of the bricks around it (see `places.wgsl`).
//
// Of nested grids each has its own lights, and its own voxels for their reach: triangles look for them in each.
//
// Cost: one thread a triangle, for each grid a load and about 20 operations for each brick within reach, as much for each light in
// these, and about 60 more for each whose stretch of path lies in the triangle's box.

#import bevy_bounce::shared::grid::{Grid, GridLevel, BRICK, grid_level, to_level, brick_dims, brick_index}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::scene::{Chunk, Scene}
#import bevy_bounce::shared::triangles::{Triangle, load_triangle, surface_cover}
#import bevy_bounce::vpl::types::{
    Vpl, BRICK_WORDS, BRICK_FIRST, MEETING_WORDS, SETTLE_RANGE, incoming_direction, incoming_reach, pack_meeting,
}

@group(0) @binding(4) var<uniform> grid: Grid;
@group(0) @binding(5) var<uniform> scene: Scene;
@group(0) @binding(6) var<storage, read> chunks: array<Chunk>;
@group(0) @binding(7) var<storage, read> vpls: array<Vpl>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(8) var<storage, read> bricks: array<u32>;
// `MEETING_WORDS` a light: the nearest meeting, the next light of its brick.
@group(0) @binding(9) var<storage, read_write> meetings: array<atomic<u32>>;

// The grid that lights are looked for in; positions in its voxels.
var<private> level: GridLevel;

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

// The stretch of a light's path on which it is set.
struct Way {
    start: vec3<f32>,
    direction: vec3<f32>,
    length: f32,
}

fn way_of(vpl: Vpl) -> Way {
    let direction = incoming_direction(vpl.incoming);
    let before = incoming_reach(vpl.incoming);
    let start = to_level(level, vpl.position) - direction * before;
    return Way(start, direction, before + SETTLE_RANGE);
}

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
    let q = cross(from_a, ab);
    let place = vec3<f32>(dot(from_a, p), dot(way.direction, q), dot(ac, q)) / determinant;
    let inside = place.x >= 0.0 && place.y >= 0.0 && place.x + place.y <= 1.0 && place.z <= way.length;
    return select(-1.0, place.z, inside);
}

fn try_light(light: u32, t: Triangle, box: Box) {
    let way = way_of(vpls[light]);
    let end = way.start + way.direction * way.length;
    if any(max(way.start, end) < box.low) || any(min(way.start, end) > box.high) {
        return;
    }
    let distance = meet(way, t);
    if distance < 0.0 || surface_cover(t, way.start + way.direction * distance) <= unit_float(hash(vpls[light].sample)) {
        return;
    }
    let normal = t.normal * -sign(dot(t.normal, way.direction));
    atomicMin(&meetings[light * MEETING_WORDS], pack_meeting(distance, normal));
}

// Whether the triangle's plane comes within reach of a light of that brick.
fn is_near_plane(t: Triangle, brick: vec3<i32>) -> bool {
    let half = 0.5 * f32(BRICK) + SETTLE_RANGE;
    let center = (vec3<f32>(brick) + 0.5) * f32(BRICK);
    let n = abs(t.normal);
    return abs(dot(t.normal, center - t.a)) <= half * (n.x + n.y + n.z);
}

fn try_brick(brick: vec3<i32>, t: Triangle, box: Box) {
    var next = bricks[brick_index(level, vec3<u32>(brick)) * BRICK_WORDS + BRICK_FIRST];
    while next != 0u {
        try_light(next - 1u, t, box);
        next = atomicLoad(&meetings[(next - 1u) * MEETING_WORDS + 1u]);
    }
}

fn look_for_lights(t: Triangle) {
    let box = Box(min(t.a, min(t.b, t.c)), max(t.a, max(t.b, t.c)));
    let last = vec3<i32>(brick_dims(level)) - 1;
    let from_brick = clamp(vec3<i32>(floor((box.low - SETTLE_RANGE) / f32(BRICK))), vec3<i32>(0), last);
    let to_brick = clamp(vec3<i32>(floor((box.high + SETTLE_RANGE) / f32(BRICK))), vec3<i32>(0), last);
    for (var z = from_brick.z; z <= to_brick.z; z++) {
        for (var y = from_brick.y; y <= to_brick.y; y++) {
            for (var x = from_brick.x; x <= to_brick.x; x++) {
                let brick = vec3<i32>(x, y, z);
                if is_near_plane(t, brick) {
                    try_brick(brick, t, box);
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
            look_for_lights(t);
        }
    }
}
