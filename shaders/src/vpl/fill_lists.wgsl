// Lists of the triangles in each voxel: see `triangle_lists.wgsl`.
//
// A thread takes a triangle; one whose box holds more than `INLINE_VOXELS` goes to the queue as bricks, as in `avg/voxelize.wgsl`.
// Nested grids have lists where paths look into theirs: not where a finer one is looked into. What there is no room for is left out,
// whichever comes last: paths meet it by its voxels alone.
//
// Cost, once a frame: a test of about 60 operations for each voxel in a triangle's box, of large ones in the bricks that they touch, and
// two atomics for each that it touches.

#import bevy_bounce::avg::queue::{QueueEntry, enqueue, queue_entry}
#import bevy_bounce::shared::chunks::triangle_of
#import bevy_bounce::shared::columns::{turn_voxel, turn_back, column_axis}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{Grid, GridLevel, grid_level, level_of_brick, to_level, brick_index, brick_place, BRICK}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::overlap::{touches_cube, box_low, box_high}
#import bevy_bounce::shared::scene::{Scene, CHUNK_TRIANGLES}
#import bevy_bounce::shared::triangles::Triangle
#import bevy_bounce::vpl::triangle_lists::{first_entry, list_of, LIST_ENTRY_WORDS}
#import bevy_bounce::vpl::types::SETTLE_RANGE

@group(0) @binding(4) var<uniform> grid: Grid;
@group(0) @binding(5) var<uniform> scene: Scene;
// Bindings 6 and 7: chunks, the queue.
@group(0) @binding(8) var<storage, read_write> lists: array<atomic<u32>>;

// The grid whose lists are filled; positions in its voxels.
var<private> level: GridLevel;
// Where paths look into a finer one.
var<private> finer: Box;

struct Box {
    low: vec3<f32>,
    high: vec3<f32>,
}

/// Voxels in a triangle's box up to which its thread does it all.
const INLINE_VOXELS: i32 = 64;
const EDGE: i32 = i32(BRICK);
// Voxels; covers the rounding of where paths go from voxel to voxel.
const SLACK: f32 = 1e-3;

fn choose_level(index: u32) {
    level = grid_level(grid, index);
    finer = Box();
    if index > 0u {
        let inner = grid_level(grid, index - 1u);
        let edge = inner.voxel_size / level.voxel_size;
        let low = to_level(level, inner.origin);
        let reach = SETTLE_RANGE * (edge + 1.0);
        finer = Box(low + reach, low + vec3<f32>(inner.dims) * edge - reach);
    }
}

fn list_in(t: Triangle, triangle: u32, voxel: vec3<i32>) {
    let low = vec3<f32>(voxel);
    let is_in_finer = all(low >= finer.low) && all(low + 1.0 <= finer.high);
    if is_in_finer || !touches_cube(t, low + 0.5, 0.5 + SLACK) {
        return;
    }
    let word = first_entry(grid) + atomicAdd(&lists[0], 1u) * LIST_ENTRY_WORDS;
    if word + LIST_ENTRY_WORDS <= arrayLength(&lists) {
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
    for (var i = 0u; is_within(i, grid.further_count + 1u, f32(triangle)); i++) {
        choose_level(i);
        let t = triangle_of(triangle, level);
        let low = box_low(t, SLACK);
        let high = box_high(t, SLACK, level.dims);
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
    choose_level(level_of_brick(grid, entry.brick));
    let t = triangle_of(entry.triangle, level);
    let axis = column_axis(t.normal);
    let corner = turn_voxel(vec3<i32>(brick_place(level, entry.brick)) * EDGE, axis);
    let low = turn_voxel(box_low(t, SLACK), axis);
    let high = turn_voxel(box_high(t, SLACK, level.dims), axis);
    let column = corner.xy + vec2<i32>(i32(lane) % EDGE, i32(lane) / EDGE);
    if any(column < low.xy) || any(column > high.xy) {
        return;
    }
    for (var z = max(corner.z, low.z); z <= min(corner.z + (EDGE - 1), high.z); z++) {
        list_in(t, entry.triangle, turn_back(vec3<i32>(column, z), axis));
    }
}
