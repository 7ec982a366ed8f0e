// Lists of the triangles in each voxel: see `lists.wgsl`.
//
// A thread takes a triangle; one whose box holds more than `INLINE_VOXELS` goes to the queue as bricks, as in `avg/voxelize.wgsl`. Of nested
// grids each has its own lists. What there is no room for is left out: paths meet it by its voxels alone.
//
// Cost, once a frame: a test of about 60 operations for each voxel in a triangle's box, of large ones in the bricks that they touch, and two
// atomics for each that it touches.

#import bevy_bounce::avg::queue::{QueueEntry, enqueue, queue_entry}
#import bevy_bounce::shared::columns::{turn_voxel, turn_back, column_axis}
#import bevy_bounce::shared::grid::{Grid, GridLevel, grid_level, level_of_brick, brick_index, brick_place, BRICK}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::overlap::touches_cube
#import bevy_bounce::shared::scene::{Chunk, Scene, CHUNK_TRIANGLES}
#import bevy_bounce::shared::triangles::{Triangle, load_triangle}
#import bevy_bounce::vpl::lists::{first_entry, list_of, ENTRY_WORDS}

@group(0) @binding(4) var<uniform> grid: Grid;
@group(0) @binding(5) var<uniform> scene: Scene;
@group(0) @binding(6) var<storage, read> chunks: array<Chunk>;
// Binding 7: the queue.
@group(0) @binding(8) var<storage, read_write> lists: array<atomic<u32>>;

// The grid whose lists are filled; positions in its voxels.
var<private> level: GridLevel;

/// Voxels in a triangle's box up to which its thread does it all.
const INLINE_VOXELS: i32 = 64;
const EDGE: i32 = i32(BRICK);
// Voxels; covers the rounding of where paths go from voxel to voxel.
const SLACK: f32 = 1e-3;

fn triangle_of(triangle: u32) -> Triangle {
    let chunk = chunks[triangle / CHUNK_TRIANGLES];
    return load_triangle(chunk.instance, chunk.first_triangle + triangle % CHUNK_TRIANGLES, level.origin, level.voxel_size);
}

fn box_low(t: Triangle) -> vec3<i32> {
    return max(vec3<i32>(floor(min(t.a, min(t.b, t.c)) - SLACK)), vec3<i32>(0));
}

fn box_high(t: Triangle) -> vec3<i32> {
    return min(vec3<i32>(floor(max(t.a, max(t.b, t.c)) + SLACK)), vec3<i32>(level.dims) - 1);
}

fn list_in(t: Triangle, triangle: u32, voxel: vec3<i32>) {
    if !touches_cube(t, vec3<f32>(voxel) + 0.5, 0.5 + SLACK) {
        return;
    }
    let word = first_entry(grid) + atomicAdd(&lists[0], 1u) * ENTRY_WORDS;
    if word + ENTRY_WORDS <= arrayLength(&lists) {
        atomicStore(&lists[word], triangle);
        atomicStore(&lists[word + 1u], atomicExchange(&lists[list_of(level, voxel)], word));
    }
}

fn list_in_box(t: Triangle, triangle: u32, low: vec3<i32>, high: vec3<i32>) {
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                list_in(t, triangle, vec3<i32>(x, y, z));
            }
        }
    }
}

fn enqueue_bricks(t: Triangle, triangle: u32, low: vec3<i32>, high: vec3<i32>) {
    let first = low / EDGE;
    let last = high / EDGE;
    for (var z = first.z; z <= last.z; z++) {
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                let brick = vec3<i32>(x, y, z);
                let half = 0.5 * f32(EDGE);
                if touches_cube(t, vec3<f32>(brick * EDGE) + half, half + SLACK)
                    && !enqueue(QueueEntry(triangle, brick_index(level, vec3<u32>(brick)))) {
                    list_in_box(t, triangle, max(brick * EDGE, low), min(brick * EDGE + (EDGE - 1), high));
                }
            }
        }
    }
}

@compute @workgroup_size(64)
fn list_triangles(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    if index >= scene.chunk_count {
        return;
    }
    let triangle = index * CHUNK_TRIANGLES + lane;
    for (var i = 0u; i <= grid.further_count; i++) {
        level = grid_level(grid, i);
        let t = triangle_of(triangle);
        let low = box_low(t);
        let high = box_high(t);
        if !t.valid || any(low > high) {
            continue;
        }
        let extent = high - low + 1;
        if extent.x * extent.y * extent.z > INLINE_VOXELS {
            enqueue_bricks(t, triangle, low, high);
        } else {
            list_in_box(t, triangle, low, high);
        }
    }
}

// A thread takes the column across the triangle, so that all have about as much.
@compute @workgroup_size(64)
fn list_bricks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = queue_entry(group.x);
    level = grid_level(grid, level_of_brick(grid, entry.brick));
    let t = triangle_of(entry.triangle);
    let axis = column_axis(t.normal);
    let corner = turn_voxel(vec3<i32>(brick_place(level, entry.brick)) * EDGE, axis);
    let low = turn_voxel(box_low(t), axis);
    let high = turn_voxel(box_high(t), axis);
    let column = corner.xy + vec2<i32>(i32(lane) % EDGE, i32(lane) / EDGE);
    if any(column < low.xy) || any(column > high.xy) {
        return;
    }
    for (var z = max(corner.z, low.z); z <= min(corner.z + (EDGE - 1), high.z); z++) {
        list_in(t, entry.triangle, turn_back(vec3<i32>(column, z), axis));
    }
}
