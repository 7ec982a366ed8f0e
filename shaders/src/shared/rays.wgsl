// Rays through the voxel grid.
//
// A facing of a voxel stands for one piece of plane: the mean of the surfaces in the voxel that look that way. A ray meets
// it where it crosses the plane from the front, within the bounds of those surfaces. Flat walls are therefore met where they are, not where
// their voxels begin, and a surface never blocks a ray that leaves it. As in Bevy's shadow maps, a one-sided surface lets
// pass what comes from behind.
//
// What is masked stops the share of the rays that its cell says: in each of `MASK_PLACES`^3 places of a voxel all or none of them, by
// a hash of the place in its grid, so that holes stay where they are for as long as the grid does; those of nested grids move with it.
// Stochastic transparency, Enderton, Sintorn, Shirley and Luebke 2010.
//
// Groups of meshes with a grid of their own are met in it, whatever way they are turned, and the nearest hit of all grids counts.
//
// All lengths are in voxels of the finest grid; what is left out near a ray's ends is in voxels of the grid that the ray is in.
//
// Cost: one word a step. The distance stored in empty voxels lets a step cross all that is known to be empty; in an occupied
// voxel each facing costs four words more; each group some ten operations, fifty more and steps of its own where the ray comes near.

#define_import_path bevy_bounce::shared::rays

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{
    Grid, GridLevel, Cell, grid_level, to_level, voxel_index, voxel_facings, voxel_distance, cell_plane, cell_area, cell_cover,
    bounds_low, bounds_high, CELL_MASK, LEAP_BLOCK,
}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::voxel_groups::{
    VoxelGroup, VoxelGroups, group_level, comes_near, to_group, way_to_group, normal_to_group, normal_from_group,
}

@group(1) @binding(0) var<uniform> grid: Grid;
@group(1) @binding(1) var<storage, read> voxels: array<u32>;
@group(1) @binding(2) var<storage, read> cells: array<Cell>;
@group(1) @binding(3) var<uniform> voxel_groups: VoxelGroups;

/// Voxels. A ray that enters a voxel behind the plane by less than this has met it all the same: the planes of neighbouring
/// voxels need not meet on a curved surface.
const THICKNESS: f32 = 0.0;
/// Voxels by which the bounds of a voxel's surfaces are widened, for the same reason.
const BOUNDS_SLACK: f32 = 0.05;
/// Voxels around an end of a ray within which surfaces that look the same way may be the one it stands on.
const OWN_SURFACE: f32 = 6.0;
/// Voxels from the plane of such a surface within which the end has to be: what relief there is within a voxel.
const OWN_RELIEF: f32 = 1.0;
/// Places along a voxel's edge, in each of which a masked surface is or is not.
const MASK_PLACES: f32 = 16.0;
/// Steps before a ray gives up: longer than any path through the grid, whatever rounding does.
const MAX_STEPS: u32 = 1024u;
/// Voxels a step goes beyond the boundary it ends at; and the share of the way so far that it goes at least, for
/// less is lost where floats are no finer.
const NUDGE: f32 = 1e-3;
const LEAST_NUDGE: f32 = 2.5e-7;

const LEAP: f32 = f32(LEAP_BLOCK);

struct Ray {
    // Voxels from the grid's origin.
    origin: vec3<f32>,
    // Unit length.
    direction: vec3<f32>,
    // Voxels.
    length: f32,
    // Normals of the surfaces at its ends; zero where there is none.
    start_normal: vec3<f32>,
    end_normal: vec3<f32>,
    // Voxels from its ends within which nothing blocks.
    gap: f32,
}

struct Hit {
    found: bool,
    // Voxels along the ray.
    t: f32,
    cell: u32,
    // Of the surface, world.
    normal: vec3<f32>,
    // The group that it belongs to, counted from 1; 0 for what is voxelised with the world.
    group: u32,
    // Voxels and empty cubes that the ray went through.
    steps: u32,
}

fn to_grid(position: vec3<f32>) -> vec3<f32> {
    return (position - grid.origin) / grid.voxel_size;
}

fn to_world(position: vec3<f32>) -> vec3<f32> {
    return position * grid.voxel_size + grid.origin;
}

// Whether a surface met at `t` is the one that the ray starts or ends on, or its other side: it is near, looks the same way,
// and that end lies near its plane. `height` is that of the ray's start over the plane.
fn is_own_surface(ray: Ray, t: f32, normal: vec3<f32>, height: f32, slope: f32) -> bool {
    let from_end = ray.length - t;
    let end_height = height + slope * ray.length;
    return min(t, from_end) < ray.gap
        || (t < OWN_SURFACE && abs(height) < OWN_RELIEF && abs(dot(normal, ray.start_normal)) > 0.5)
        || (from_end < OWN_SURFACE && abs(end_height) < OWN_RELIEF && dot(normal, ray.end_normal) > 0.5);
}

// Whether a cell's surface is there at a place, in voxels from the grid's origin.
fn is_there(cell: Cell, p: vec3<f32>) -> bool {
    let cover = cell_cover(cell);
    if cover == 255u {
        return true;
    }
    let place = vec3<u32>(vec3<i32>(floor(p * MASK_PLACES)));
    return unit_float(hash(place.x ^ hash(place.y ^ hash(place.z)))) * 255.0 < f32(cover);
}

// The nearest plane met in an occupied voxel between `enter` and `leave`.
fn hit_voxel(ray: Ray, word: u32, first_cell: u32, voxel: vec3<f32>, enter: f32, leave: f32) -> Hit {
    var nearest = Hit(false, leave, 0u, vec3<f32>(0.0), 0u, 0u);
    let from_center = ray.origin - voxel - 0.5;
    let first = first_cell + (word & CELL_MASK);
    let count = countOneBits(voxel_facings(word));
    for (var i = 0u; i < count; i++) {
        let cell = cells[first + i];
        let normal = decode_unit(cell.normal);
        let slope = dot(normal, ray.direction);
        if slope >= -1e-4 || cell_area(cell) <= 0.0 {
            continue;
        }
        let height = dot(normal, from_center) - cell_plane(cell);
        if height + slope * enter < -THICKNESS || height + slope * leave > 0.0 {
            continue;
        }
        let t = clamp(-height / slope, enter, leave);
        let p = from_center + ray.direction * t + 0.5;
        let within = all(p >= bounds_low(cell.bounds) - BOUNDS_SLACK) && all(p <= bounds_high(cell.bounds) + BOUNDS_SLACK);
        if within && t <= nearest.t && !is_own_surface(ray, t, normal, height, slope) && is_there(cell, voxel + p) {
            nearest = Hit(true, t, first + i, normal, 0u, 0u);
        }
    }
    return nearest;
}

// Where along the ray a box of voxels from the origin begins and ends.
fn clip_to_grid(ray: Ray, inverse: vec3<f32>, dims: vec3<u32>) -> vec2<f32> {
    let a = (vec3<f32>(0.0) - ray.origin) * inverse;
    let b = (vec3<f32>(dims) - ray.origin) * inverse;
    let low = min(a, b);
    let high = max(a, b);
    return vec2<f32>(max(max(low.x, low.y), max(low.z, 0.0)), min(min(high.x, high.y), min(high.z, ray.length)));
}

// The ray in voxels of a coarser grid, so many of which are a voxel of the finest.
fn in_level(ray: Ray, level: GridLevel, ratio: f32) -> Ray {
    var coarse = ray;
    coarse.origin = to_level(level, to_world(ray.origin));
    coarse.length = ray.length * ratio;
    return coarse;
}

// The first surface met between two places in one grid, all in its voxels. What is done in an occupied voxel stands outside of the loop
// that looks for the next, so that threads in step come to it together.
fn walk(ray: Ray, safe: vec3<f32>, inverse: vec3<f32>, level: GridLevel, from_t: f32, end: f32) -> Hit {
    let ahead = select(vec3<f32>(0.0), vec3<f32>(1.0), safe > vec3<f32>(0.0));
    var enter = from_t;
    var t = from_t;
    var step = 0u;
    loop {
        var word = 0u;
        var voxel = vec3<f32>(0.0);
        while step < MAX_STEPS && t < end && voxel_facings(word) == 0u {
            step++;
            enter = t;
            let nudge = max(NUDGE, LEAST_NUDGE * t);
            voxel = floor(ray.origin + safe * (t + nudge));
            if any(voxel < vec3<f32>(0.0)) || any(voxel >= vec3<f32>(level.dims)) {
                // On the boundary, by rounding.
                t += nudge;
                continue;
            }
            word = voxels[voxel_index(level, vec3<i32>(voxel))];
            // Edge of the empty cube around the voxel's block, or of the voxel, along the ray.
            let distance = f32(voxel_distance(word));
            let block = floor(voxel / LEAP) * LEAP;
            let reach = vec3<f32>((distance - 1.0) * LEAP);
            let leap = block + ahead * LEAP + select(-reach, reach, safe > vec3<f32>(0.0));
            let boundary = select(voxel + ahead, leap, distance > 0.0);
            let exits = (boundary - ray.origin) * inverse;
            t = max(min(exits.x, min(exits.y, exits.z)), t + nudge);
        }
        if voxel_facings(word) == 0u {
            break;
        }
        let hit = hit_voxel(ray, word, level.first_cell, voxel, enter, t);
        if hit.found && hit.t < end {
            return Hit(true, hit.t, hit.cell, hit.normal, 0u, step);
        }
    }
    return Hit(false, ray.length, 0u, vec3<f32>(0.0), 0u, step);
}

fn without_zeros(direction: vec3<f32>) -> vec3<f32> {
    let tiny = vec3<f32>(1e-6);
    return select(direction, select(-tiny, tiny, direction >= vec3<f32>(0.0)), abs(direction) < tiny);
}

// The first surface of the world's own grids. Of nested grids each is entered where the next
// coarser one is left for it, and left for that again: the way in and the way out of so many boxes within each other.
fn trace_world(ray: Ray) -> Hit {
    let safe = without_zeros(ray.direction);
    let inverse = 1.0 / safe;
    let coarsest = i32(grid.further_count);
    var done = 0.0;
    var steps = 0u;
    for (var i = 0u; is_within(i, 2u * grid.further_count + 1u, ray.origin.x); i++) {
        let stage = i32(i) - coarsest;
        let index = u32(abs(stage));
        let level = grid_level(grid, index);
        var ratio = 1.0;
        var own = ray;
        if index > 0u {
            ratio = grid.voxel_size / level.voxel_size;
            own = in_level(ray, level, ratio);
        }
        let span = clip_to_grid(own, inverse, level.dims) / ratio;
        var end = span.y;
        if stage < 0 {
            let finer = grid_level(grid, index - 1u);
            let within = in_level(ray, finer, grid.voxel_size / finer.voxel_size);
            let inner = clip_to_grid(within, inverse, finer.dims) * (finer.voxel_size / grid.voxel_size);
            end = select(end, min(end, inner.x), inner.x < inner.y);
        }
        let hit = walk(own, safe, inverse, level, max(done, span.x) * ratio, end * ratio);
        steps += hit.steps;
        if hit.found {
            return Hit(true, hit.t / ratio, hit.cell, hit.normal, 0u, steps);
        }
        done = max(done, end);
    }
    return Hit(false, ray.length, 0u, vec3<f32>(0.0), 0u, steps);
}

// The first surface of a group up to a place on the ray.
fn trace_group(ray: Ray, index: u32, end: f32) -> Hit {
    let group = voxel_groups.groups[index];
    let start = to_world(ray.origin);
    if !comes_near(group, start, ray.direction, end * grid.voxel_size, group.radius) {
        return Hit(false, ray.length, 0u, vec3<f32>(0.0), 0u, 0u);
    }
    let along = way_to_group(group, ray.direction) * grid.voxel_size;
    let ratio = length(along);
    var own = ray;
    own.origin = to_group(group, start);
    own.direction = along / ratio;
    own.length = ray.length * ratio;
    let safe = without_zeros(own.direction);
    let inverse = 1.0 / safe;
    let span = clip_to_grid(own, inverse, group.dims);
    let own_end = min(span.y, end * ratio);
    if !(span.x < own_end) {
        return Hit(false, ray.length, 0u, vec3<f32>(0.0), 0u, 0u);
    }
    own.start_normal = normal_to_group(group, ray.start_normal);
    own.end_normal = normal_to_group(group, ray.end_normal);
    let hit = walk(own, safe, inverse, group_level(group), span.x, own_end);
    return Hit(hit.found, hit.t / ratio, hit.cell, normal_from_group(group, hit.normal), index + 1u, hit.steps);
}

/// The first surface that faces the ray, other than those it stands on.
fn trace(ray: Ray) -> Hit {
    var nearest = trace_world(ray);
    for (var i = 0u; is_within(i, voxel_groups.count, ray.origin.x); i++) {
        let hit = trace_group(ray, i, nearest.t);
        let steps = nearest.steps + hit.steps;
        if hit.found {
            nearest = hit;
        }
        nearest.steps = steps;
    }
    return nearest;
}

/// Whether anything that faces the ray, other than what it stands on, is in its way.
fn is_blocked(ray: Ray) -> bool {
    if trace_world(ray).found {
        return true;
    }
    for (var i = 0u; is_within(i, voxel_groups.count, ray.origin.x); i++) {
        if trace_group(ray, i, ray.length).found {
            return true;
        }
    }
    return false;
}
