// From marked voxels to cells: a prefix sum gives every marked facing its cell, and once the sums are in they become means.
//
// Cost: reads each voxel three times, each cell once.

#import bevy_bounce::shared::grid::{
    Grid, Cell, voxel_count, voxel_facings, facing_of, pack_bounds, CELL_BITS, AREA_ONE, BOUND_ONE, SUM_WORDS, SUM_MASKED,
    SUM_FRONT, COUNTER_CELLS, COUNTER_OVERFLOW, COUNTER_AREA, COUNTER_AREA_STEPS, COUNTER_FINEST,
}
#import bevy_bounce::shared::groups::{folded_index, exclusive_scan, scan_total}
#import bevy_bounce::shared::octahedral::encode_unit

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<storage, read_write> voxels: array<u32>;
// One word a block: its marked facings, then the sum of the blocks before it.
@group(0) @binding(2) var<storage, read_write> blocks: array<u32>;
@group(0) @binding(3) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read> sums: array<i32>;
@group(0) @binding(5) var<storage, read_write> cells: array<Cell>;

const GROUP: u32 = 256u;
const PER_THREAD: u32 = 4u;
const BLOCK: u32 = 1024u;

fn marked(voxel: u32) -> u32 {
    if voxel >= voxel_count(grid) {
        return 0u;
    }
    return countOneBits(voxel_facings(voxels[voxel]));
}

@compute @workgroup_size(256)
fn count_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = folded_index(group);
    let first = block * BLOCK + lane * PER_THREAD;
    let count = marked(first) + marked(first + 1u) + marked(first + 2u) + marked(first + 3u);
    exclusive_scan(count, lane);
    if lane == GROUP - 1u && block < arrayLength(&blocks) {
        blocks[block] = scan_total();
    }
}

@compute @workgroup_size(256)
fn scan_blocks(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&blocks);
    var before = 0u;
    for (var base = 0u; base < count; base += GROUP) {
        let block = base + lane;
        var value = 0u;
        if block < count {
            value = blocks[block];
        }
        let sum = exclusive_scan(value, lane);
        if block < count {
            blocks[block] = before + sum;
        }
        before += scan_total();
        workgroupBarrier();
    }
    if lane == 0u {
        atomicStore(&counters[COUNTER_CELLS], min(before, grid.cell_capacity));
        atomicStore(&counters[COUNTER_OVERFLOW], before - min(before, grid.cell_capacity));
        atomicStore(&counters[COUNTER_AREA], 0u);
        atomicStore(&counters[COUNTER_FINEST], min(before, grid.cell_capacity));
    }
}

@compute @workgroup_size(256)
fn assign_cells(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = folded_index(group);
    let first = block * BLOCK + lane * PER_THREAD;
    let count = marked(first) + marked(first + 1u) + marked(first + 2u) + marked(first + 3u);
    let lower = exclusive_scan(count, lane);
    if block >= arrayLength(&blocks) {
        return;
    }
    var cell = blocks[block] + lower;
    for (var i = 0u; i < PER_THREAD; i++) {
        let voxel = first + i;
        if voxel >= voxel_count(grid) {
            return;
        }
        if grid.further_count > 0u && voxel == grid.further[0].first_voxel {
            atomicStore(&counters[COUNTER_FINEST], min(cell, grid.cell_capacity));
        }
        let facings = voxel_facings(voxels[voxel]);
        let next = cell + countOneBits(facings);
        // Without room the voxel counts as empty.
        voxels[voxel] = select(0u, (facings << CELL_BITS) | cell, facings != 0u && next <= grid.cell_capacity);
        cell = next;
    }
}

// From an area and what was weighted by it.
fn mean_of(sum: u32) -> vec3<f32> {
    return vec3<f32>(vec3<i32>(sums[sum + 1u], sums[sum + 2u], sums[sum + 3u])) / f32(sums[sum]);
}

// The albedo of what is seen of a cell: that of all its surfaces as long as they have room side by side across the
// facing's axis, of those in front the more of them lie behind each other.
fn albedo_of(sum: u32, size: vec3<f32>) -> vec3<f32> {
    let normal = vec3<f32>(vec3<i32>(sums[sum + 4u], sums[sum + 5u], sums[sum + 6u])) / AREA_ONE;
    let axis = facing_of(normal) / 2u;
    let face = max((size.yzx * size.zxy)[axis], 1.0 / AREA_ONE);
    let hidden = clamp(abs(normal)[axis] / face - 1.0, 0.0, 1.0);
    return mix(mean_of(sum), mean_of(sum + SUM_FRONT), hidden);
}

// Share of the rays through a cell's bounds that its surfaces stop. What has holes stops as many as it has area for across the facing's
// axis, as if no part of it were behind another; anything else stops all.
fn cover_of(sum: u32, normal: vec3<f32>, size: vec3<f32>) -> f32 {
    if sums[sum + SUM_MASKED] < sums[sum] {
        return 1.0;
    }
    let axis = facing_of(normal) / 2u;
    let area = f32(sums[sum]) / AREA_ONE * abs(normal)[axis];
    let face = (size.yzx * size.zxy)[axis];
    return clamp(area / max(face, 1.0 / AREA_ONE), 1.0 / 255.0, 1.0);
}

@compute @workgroup_size(64)
fn resolve(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let cell = folded_index(group) * 64u + lane;
    if cell >= atomicLoad(&counters[COUNTER_CELLS]) {
        return;
    }
    let o = cell * SUM_WORDS;
    let weight = sums[o];
    var mean = Cell(0u, 0u, 0u, 0u);
    if weight > 0 {
        let inv = 1.0 / f32(weight);
        let normal = normalize(vec3<f32>(vec3<i32>(sums[o + 4u], sums[o + 5u], sums[o + 6u])) + vec3<f32>(0.0, 1e-3, 0.0));
        let position = vec3<f32>(vec3<i32>(sums[o + 7u], sums[o + 8u], sums[o + 9u])) * inv;
        mean.normal = encode_unit(normal);
        let area = f32(weight) / AREA_ONE;
        // The smallest half float above 0 stands for what is only touched.
        mean.plane_area = pack2x16float(vec2<f32>(dot(position, normal), clamp(area, 1e-4, 6e4)));
        let low = 1.0 - vec3<f32>(vec3<i32>(sums[o + 10u], sums[o + 11u], sums[o + 12u])) / BOUND_ONE;
        let high = vec3<f32>(vec3<i32>(sums[o + 13u], sums[o + 14u], sums[o + 15u])) / BOUND_ONE;
        mean.bounds = pack_bounds(low, high);
        mean.albedo = pack4x8unorm(vec4<f32>(albedo_of(o, high - low), cover_of(o, normal, high - low)));
        if cell < atomicLoad(&counters[COUNTER_FINEST]) {
            atomicAdd(&counters[COUNTER_AREA], u32(round(area * COUNTER_AREA_STEPS)));
        }
    }
    cells[cell] = mean;
}
