// Surfaces of groups with a grid of their own, as area in the bricks of the world's grids: what virtual lights lie on counts
// wherever it is voxelised.
//
// Cost: one thread a voxel of a group; for each of its cells four words and an addition a grid.

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{
    GridLevel, grid_level, level_at, brick_at, voxel_index, voxel_facings, cell_plane, cell_area, CELL_MASK, COUNTER_AREA,
    COUNTER_AREA_STEPS,
}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::rays::{grid, voxels, cells, voxel_groups}
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::voxel_groups::{VoxelGroup, from_group, face_from_group, GROUP_VOXELS}
#import bevy_bounce::vpl::types::{BRICK_WORDS, BRICK_AREA, BRICK_AREA_STEPS}

// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(0) var<storage, read_write> bricks: array<atomic<u32>>;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;

// Square world units. Steps are rounded up as often as their fractions say: sums of however small areas are right in the mean.
fn add_area(position: vec3<f32>, area: f32, cell: u32) {
    let chance = unit_float(hash(cell));
    for (var i = level_at(grid, position); is_within(i, grid.further_count + 1u, position.x); i++) {
        let level = grid_level(grid, i);
        let faces = area / (level.voxel_size * level.voxel_size);
        atomicAdd(&bricks[brick_at(level, position) * BRICK_WORDS + BRICK_AREA], u32(faces * BRICK_AREA_STEPS + chance));
        if i == 0u {
            atomicAdd(&counters[COUNTER_AREA], u32(faces * COUNTER_AREA_STEPS + chance));
        }
    }
}

@compute @workgroup_size(64)
fn add_group_areas(@builtin(workgroup_id) work: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(work) * 64u + lane;
    if index >= voxel_groups.count * GROUP_VOXELS {
        return;
    }
    let group = voxel_groups.groups[index / GROUP_VOXELS];
    let place = index % GROUP_VOXELS;
    if place >= group.dims.x * group.dims.y * group.dims.z {
        return;
    }
    let word = voxels[group.first_voxel + place];
    let count = countOneBits(voxel_facings(word));
    let voxel = vec3<u32>(place % group.dims.x, (place / group.dims.x) % group.dims.y, place / (group.dims.x * group.dims.y));
    for (var i = 0u; i < count; i++) {
        let at = group.first_cell + (word & CELL_MASK) + i;
        let cell = cells[at];
        if cell_area(cell) > 0.0 {
            let normal = decode_unit(cell.normal);
            let position = from_group(group, vec3<f32>(voxel) + 0.5 + normal * cell_plane(cell));
            add_area(position, cell_area(cell) * length(face_from_group(group, normal)), at);
        }
    }
}
