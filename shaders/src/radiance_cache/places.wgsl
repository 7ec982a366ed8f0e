// The list of filled voxels: where each cell of the grid is; and the light that a mean surface of the scene would send, which
// all stored radiance is relative to, so that a half float holds it whatever the scene's units.
//
// Groups with a grid of their own have places for each of them, behind the world's: those that share a grid have their own light.
//
// Cost: one word a voxel, one a cell.

#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::grid::{Grid, voxel_facings, CELL_MASK}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene, CHUNK_TRIANGLES}
#import bevy_bounce::shared::voxel_groups::{VoxelGroups, GROUP_VOXELS, GROUP_CELLS}
#import bevy_bounce::vpl::types::Emitter

@group(0) @binding(0) var<uniform> grid: Grid;
@group(0) @binding(1) var<uniform> scene: Scene;
@group(0) @binding(2) var<storage, read> voxels: array<u32>;
@group(0) @binding(3) var<storage, read> emitters: array<Emitter>;
// Voxel of each cell, and PLACE_VALID; 0 for a cell that is not in use.
@group(0) @binding(4) var<storage, read_write> places: array<u32>;
// Radiance that counts as 1, cd/m^2.
@group(0) @binding(5) var<storage, read_write> unit: array<f32>;
@group(0) @binding(6) var<storage, read> lights: array<Light>;

@group(0) @binding(7) var<uniform> volume: LightVolume;
@group(0) @binding(8) var<uniform> voxel_groups: VoxelGroups;

const PLACE_VALID: u32 = 0x80000000u;

// Notes the voxel of the cells of its word, in places that begin there.
fn note(word: u32, voxel: u32, first: u32) {
    let count = countOneBits(voxel_facings(word));
    for (var i = 0u; i < count; i++) {
        places[first + (word & CELL_MASK) + i] = voxel | PLACE_VALID;
    }
}

@compute @workgroup_size(64)
fn list_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let voxel = folded_index(group) * 64u + lane;
    if voxel >= grid.dims.x * grid.dims.y * grid.dims.z {
        return;
    }
    note(voxels[voxel], voxel, 0u);
}

@compute @workgroup_size(64)
fn list_group_places(@builtin(workgroup_id) work: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let thread = folded_index(work) * 64u + lane;
    let index = thread / GROUP_VOXELS;
    let voxel = thread % GROUP_VOXELS;
    if index >= voxel_groups.count {
        return;
    }
    let group = voxel_groups.groups[index];
    if voxel < group.dims.x * group.dims.y * group.dims.z {
        note(voxels[group.first_voxel + voxel], voxel, volume.first_group_cell + index * GROUP_CELLS);
    }
}

@compute @workgroup_size(1)
fn measure_unit() {
    var power = scene.light_power;
    if scene.emissive_chunk_count > 0u {
        power += emitters[scene.emissive_chunk_count * CHUNK_TRIANGLES - 1u].cumulative_power;
    }
    if scene.sky_count > 0u {
        power += lights[scene.light_count + scene.sky_count - 1u].cumulative_power;
    }
    let size = scene.regions[0].max - scene.regions[0].min;
    let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
    let mean = power / max(PI * area, 1e-20);
    // Also where it is not a number.
    unit[0] = select(1.0, clamp(mean, 1e-12, 1e12), mean > 0.0);
}
