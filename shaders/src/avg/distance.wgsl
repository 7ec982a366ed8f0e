// Chebyshev distance of every voxel to the nearest marked one, so that rays leap over empty space: one axis at a time, each
// pass the smallest max(step, distance so far) along its axis.
//
// Cost: three passes; a voxel reads two neighbours per unit of its distance.

#import bevy_bounce::shared::grid::{Grid, voxel_index, voxel_count, voxel_facings, DISTANCE_SHIFT, MAX_DISTANCE}

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read_write> voxels: array<u32>;
// Along x in the low half word.
@group(0) @binding(2) var<storage, read_write> along_x: array<u32>;
@group(0) @binding(3) var<storage, read_write> along_y: array<u32>;

const MAX_WORKGROUPS: u32 = 65535u;

fn voxel_of(index: u32) -> vec3<i32> {
    return vec3<i32>(vec3<u32>(index % grid.dims.x, (index / grid.dims.x) % grid.dims.y, index / (grid.dims.x * grid.dims.y)));
}

fn inside(voxel: vec3<i32>) -> bool {
    return all(voxel >= vec3<i32>(0)) && all(voxel < vec3<i32>(grid.dims));
}

fn thread_index(group: vec3<u32>, lane: u32) -> u32 {
    return (group.x + group.y * MAX_WORKGROUPS) * 64u + lane;
}

fn distance_x(voxel: vec3<i32>) -> u32 {
    if !inside(voxel) {
        return MAX_DISTANCE;
    }
    return select(MAX_DISTANCE, 0u, voxel_facings(voxels[voxel_index(grid, voxel)]) != 0u);
}

fn distance_y(voxel: vec3<i32>) -> u32 {
    if !inside(voxel) {
        return MAX_DISTANCE;
    }
    return along_x[voxel_index(grid, voxel)];
}

fn distance_z(voxel: vec3<i32>) -> u32 {
    if !inside(voxel) {
        return MAX_DISTANCE;
    }
    return along_y[voxel_index(grid, voxel)];
}

@compute @workgroup_size(64)
fn pass_x(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = thread_index(group, lane);
    if index >= voxel_count(grid) {
        return;
    }
    let voxel = voxel_of(index);
    var best = distance_x(voxel);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(i32(step), 0, 0);
        best = min(best, max(step, min(distance_x(voxel - offset), distance_x(voxel + offset))));
    }
    along_x[index] = best;
}

@compute @workgroup_size(64)
fn pass_y(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = thread_index(group, lane);
    if index >= voxel_count(grid) {
        return;
    }
    let voxel = voxel_of(index);
    var best = distance_y(voxel);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(0, i32(step), 0);
        best = min(best, max(step, min(distance_y(voxel - offset), distance_y(voxel + offset))));
    }
    along_y[index] = best;
}

@compute @workgroup_size(64)
fn pass_z(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = thread_index(group, lane);
    if index >= voxel_count(grid) {
        return;
    }
    let voxel = voxel_of(index);
    var best = distance_z(voxel);
    for (var step = 1u; step < best; step++) {
        let offset = vec3<i32>(0, 0, i32(step));
        best = min(best, max(step, min(distance_z(voxel - offset), distance_z(voxel + offset))));
    }
    voxels[index] |= best << DISTANCE_SHIFT;
}
