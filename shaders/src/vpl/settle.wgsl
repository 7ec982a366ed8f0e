// What each path met first, near where it met the grid and near where it started: a voxel knows only the mean of the surfaces in it,
// behind which lights would be buried by every ledge and fold, and which tells nothing of what is next to a surface in a corner.
//
// Either way goes from voxel to voxel, through the lists of the triangles in these (`triangle_lists.wgsl`).
//
// Cost, a bounce: one thread a path that goes on; up to fourteen voxels, and for each triangle in their lists about 30 loads and 80
// operations, but for those that were among the last four; as much again for each hole that it passes, and once the triangle's loads and
// a texel for what it is reflected by.

#import bevy_bounce::shared::chunks::triangle_of
#import bevy_bounce::shared::grid::{Grid, GridLevel, to_level}
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::triangles::{Triangle, surface_albedo, surface_cover}
#import bevy_bounce::vpl::triangle_lists::list_of
#import bevy_bounce::vpl::types::{
    Vpl, VplParameters, Path, UNSETTLED, ON_TRIANGLE, NO_CELL, NO_PATH, SETTLE_RANGE, vertex_slot, settle_level, incoming_direction,
    incoming_reach,
}

@group(0) @binding(4) var<uniform> parameters: VplParameters;
@group(0) @binding(5) var<uniform> grid: Grid;
// Binding 6: chunks.
@group(0) @binding(7) var<storage, read> lists: array<u32>;
@group(0) @binding(8) var<storage, read_write> vertices: array<Vpl>;
@group(0) @binding(9) var<storage, read_write> paths: array<Path>;

/// Voxels from its plane within which a way starts on the triangle, where both look the same way: packed directions point below it.
const OWN_PLANE: f32 = 0.01;
const SAME_WAY: f32 = 0.99;
const NO_TRIANGLE: u32 = 0xffffffffu;
/// Voxels that a way of 2 `SETTLE_RANGE` goes through at most.
const MOST_VOXELS: u32 = 8u;

// A stretch of a path, in voxels of the grid that it is in.
struct Way {
    level: GridLevel,
    start: vec3<f32>,
    direction: vec3<f32>,
    length: f32,
    // Of the surface that it starts on; zero in the air.
    normal: vec3<f32>,
}

struct Meeting {
    found: bool,
    distance: f32,
    normal: vec3<f32>,
    triangle: u32,
}

// From the surface that the path started on.
fn way_from_start(start: Vpl, incoming: u32) -> Way {
    let level = settle_level(grid, start.position);
    return Way(level, to_level(level, start.position), incoming_direction(incoming), SETTLE_RANGE, start.normal);
}

// Before and behind where it met the grid.
fn way_at_hit(vertex: Vpl) -> Way {
    let level = settle_level(grid, vertex.position);
    let direction = incoming_direction(vertex.incoming);
    let before = incoming_reach(vertex.incoming);
    let start = to_level(level, vertex.position) - direction * before;
    return Way(level, start, direction, before + SETTLE_RANGE, vec3<f32>(0.0));
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
    if abs(dot(t.normal, from_a)) < OWN_PLANE && abs(dot(t.normal, way.normal)) > SAME_WAY {
        return -1.0;
    }
    let q = cross(from_a, ab);
    let place = vec3<f32>(dot(from_a, p), dot(way.direction, q), dot(ac, q)) / determinant;
    let inside = place.x >= 0.0 && place.y >= 0.0 && place.x + place.y <= 1.0 && place.z <= way.length;
    return select(-1.0, place.z, inside);
}

// Whether one comes before another. Of two at once, that with the lower number: lists are in no order.
fn is_before(distance: f32, triangle: u32, other: Meeting) -> bool {
    return distance < other.distance || (distance == other.distance && triangle < other.triangle);
}

// The first of a meeting and of that with a triangle, after another.
fn meet_triangle(best: Meeting, after: Meeting, way: Way, triangle: u32) -> Meeting {
    let t = triangle_of(triangle, way.level);
    let distance = meet(way, t);
    if distance < 0.0 || !is_before(distance, triangle, best) || is_before(distance, triangle, after) || triangle == after.triangle {
        return best;
    }
    return Meeting(true, distance, t.normal * -sign(dot(t.normal, way.direction)), triangle);
}

fn first_entry_in(level: GridLevel, voxel: vec3<i32>) -> u32 {
    if any(voxel < vec3<i32>(0)) || any(voxel >= vec3<i32>(level.dims)) {
        return 0u;
    }
    return lists[list_of(level, voxel)];
}

// From voxel to voxel along the way. Amanatides & Woo 1987. What is done for each triangle stands outside of the loop that looks for the
// next, so that threads in step come to it together.
fn next_meeting(way: Way, after: Meeting) -> Meeting {
    var best = Meeting(false, way.length, vec3<f32>(0.0), NO_TRIANGLE);
    let speed = max(abs(way.direction), vec3<f32>(1e-6));
    let into = fract(way.start);
    var voxel = vec3<i32>(floor(way.start));
    var leave = select(into, 1.0 - into, way.direction > vec3<f32>(0.0)) / speed;
    var entry = first_entry_in(way.level, voxel);
    // The last that were looked at: large ones are in the lists of many voxels.
    var known = vec4<u32>(NO_TRIANGLE);
    var voxels_left = MOST_VOXELS;
    loop {
        var triangle = NO_TRIANGLE;
        while triangle == NO_TRIANGLE && voxels_left > 0u {
            if entry != 0u {
                let listed = lists[entry];
                triangle = select(listed, NO_TRIANGLE, any(known == vec4<u32>(listed)));
                entry = lists[entry + 1u];
            } else {
                let enter = min(leave.x, min(leave.y, leave.z));
                let is_x = leave.x == enter;
                let is_y = !is_x && leave.y == enter;
                let along = vec3<f32>(vec3<bool>(is_x, is_y, !is_x && !is_y));
                voxel += vec3<i32>(along * sign(way.direction));
                leave += along / speed;
                entry = first_entry_in(way.level, voxel);
                voxels_left = select(0u, voxels_left - 1u, enter <= best.distance);
            }
        }
        if triangle == NO_TRIANGLE {
            break;
        }
        best = meet_triangle(best, after, way, triangle);
        known = vec4<u32>(triangle, known.xyz);
    }
    return best;
}

// The first that is not with a hole; `threshold`: share of a surface up to which the path takes it for one.
fn first_meeting(way: Way, threshold: f32) -> Meeting {
    var meeting = Meeting(false, -1.0, vec3<f32>(0.0), NO_TRIANGLE);
    loop {
        meeting = next_meeting(way, meeting);
        if !meeting.found {
            break;
        }
        let t = triangle_of(meeting.triangle, way.level);
        if surface_cover(t, way.start + way.direction * meeting.distance) > threshold {
            break;
        }
    }
    return meeting;
}

@compute @workgroup_size(64)
fn meet_triangles(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.path_count {
        return;
    }
    let path = paths[id.x].alive;
    if path == NO_PATH || (paths[path].first & UNSETTLED) == 0u {
        return;
    }
    let count = paths[path].length;
    let slot = vertex_slot(parameters, path, count);
    let vertex = vertices[slot];
    let threshold = unit_float(hash(vertex.sample));
    var meeting = Meeting();
    var way = Way();
    // From where it started first. A loop, so that what it calls is there once.
    for (var i = 0u; i < 2u && !meeting.found; i++) {
        let is_start = i == 0u;
        if is_start && count > 0u {
            way = way_from_start(vertices[slot - 1u], vertex.incoming);
        } else if !is_start && vertex.bounce_met != NO_CELL {
            way = way_at_hit(vertex);
        } else {
            continue;
        }
        meeting = first_meeting(way, threshold);
    }
    if meeting.found {
        let place = way.start + way.direction * meeting.distance;
        let albedo = surface_albedo(triangle_of(meeting.triangle, way.level), place);
        vertices[slot].bounce_met = pack4x8unorm(vec4<f32>(albedo, 0.0));
        vertices[slot].position = way.level.origin + place * way.level.voxel_size;
        vertices[slot].normal = meeting.normal;
        paths[path].first |= ON_TRIANGLE;
    }
}
