// Chebyshev distance of every 2^3 block of voxels to the nearest that has a marked one, so that rays leap over empty space:
// one axis at a time, each pass the smallest max(step, distance so far) along its axis.
//
// Cost: every voxel is read once; then three passes over an eighth as many blocks, two reads per unit of their distance.

#import bevy_bounce::shared::grid::{
    Grid, GridLevel, grid_level, level_of_block, voxel_index, voxel_facings, leap_dims, DISTANCE_SHIFT, MAX_DISTANCE, LEAP_BLOCK,
}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read_write> voxels: array<u32>;
@group(0) @binding(2) var<storage, read_write> occupied: array<u32>;
@group(0) @binding(3) var<storage, read_write> along_x: array<u32>;
@group(0) @binding(4) var<storage, read_write> along_y: array<u32>;

// The grid of the thread's block.
var<private> level: GridLevel;

// The block of a thread; false for one that has none.
fn start(group: vec3<u32>, lane: u32, index: ptr<function, u32>, block: ptr<function, vec3<i32>>) -> bool {
    *index = folded_index(group) * 64u + lane;
    level = grid_level(grid, level_of_block(grid, *index));
    let dims = leap_dims(level);
    let place = *index - level.first_block;
    *block = vec3<i32>(vec3<u32>(place % dims.x, (place / dims.x) % dims.y, place / (dims.x * dims.y)));
    return place < dims.x * dims.y * dims.z;
}

// Position of a block in the buffers; the second is false outside of the grid.
fn find(block: vec3<i32>) -> vec2<u32> {
    let dims = vec3<i32>(leap_dims(level));
    if any(block < vec3<i32>(0)) || any(block >= dims) {
        return vec2<u32>(0u, 0u);
    }
    return vec2<u32>(level.first_block + u32((block.z * dims.y + block.y) * dims.x + block.x), 1u);
}

fn distance_x(block: vec3<i32>) -> u32 {
    let place = find(block);
    return select(MAX_DISTANCE, 0u, place.y == 1u && occupied[place.x] != 0u);
}

fn distance_y(block: vec3<i32>) -> u32 {
    let place = find(block);
    return select(MAX_DISTANCE, along_x[place.x], place.y == 1u);
}

fn distance_z(block: vec3<i32>) -> u32 {
    let place = find(block);
    return select(MAX_DISTANCE, along_y[place.x], place.y == 1u);
}

fn voxel_in(block: vec3<i32>, corner: u32) -> vec3<i32> {
    return block * i32(LEAP_BLOCK) + vec3<i32>(vec3<u32>(corner, corner >> 1u, corner >> 2u) & vec3<u32>(1u));
}

fn is_voxel(voxel: vec3<i32>) -> bool {
    return all(voxel < vec3<i32>(level.dims));
}

@compute @workgroup_size(64)
fn find_occupied(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var index: u32;
    var block: vec3<i32>;
    if !start(group, lane, &index, &block) {
        return;
    }
    var any_facing = 0u;
    for (var corner = 0u; corner < 8u; corner++) {
        let voxel = voxel_in(block, corner);
        if is_voxel(voxel) {
            any_facing |= voxel_facings(voxels[voxel_index(level, voxel)]);
        }
    }
    occupied[index] = any_facing;
}

@compute @workgroup_size(64)
fn pass_x(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var index: u32;
    var block: vec3<i32>;
    if !start(group, lane, &index, &block) {
        return;
    }
    var best = distance_x(block);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(i32(step), 0, 0);
        best = min(best, max(step, min(distance_x(block - offset), distance_x(block + offset))));
    }
    along_x[index] = best;
}

@compute @workgroup_size(64)
fn pass_y(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var index: u32;
    var block: vec3<i32>;
    if !start(group, lane, &index, &block) {
        return;
    }
    var best = distance_y(block);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(0, i32(step), 0);
        best = min(best, max(step, min(distance_y(block - offset), distance_y(block + offset))));
    }
    along_y[index] = best;
}

@compute @workgroup_size(64)
fn pass_z(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    var index: u32;
    var block: vec3<i32>;
    if !start(group, lane, &index, &block) {
        return;
    }
    var best = distance_z(block);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(0, 0, i32(step));
        best = min(best, max(step, min(distance_z(block - offset), distance_z(block + offset))));
    }
    for (var corner = 0u; corner < 8u; corner++) {
        let voxel = voxel_in(block, corner);
        if is_voxel(voxel) {
            voxels[voxel_index(level, voxel)] |= best << DISTANCE_SHIFT;
        }
    }
}
