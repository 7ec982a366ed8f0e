// The list of filled voxels: where each cell of the grid is; and the light that a mean surface of the scene would send, which
// all stored radiance is relative to, so that a half float holds it whatever the scene's units.
//
// Cost: one word a voxel, one a cell.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::grid::{Grid, voxel_facings, CELL_MASK}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene, CHUNK_TRIANGLES}
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

const PLACE_VALID: u32 = 0x80000000u;

@compute @workgroup_size(64)
fn list_places(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let voxel = folded_index(group) * 64u + lane;
    if voxel >= grid.dims.x * grid.dims.y * grid.dims.z {
        return;
    }
    let word = voxels[voxel];
    var facings = voxel_facings(word);
    var cell = word & CELL_MASK;
    while facings != 0u {
        places[cell] = voxel | PLACE_VALID;
        facings &= facings - 1u;
        cell++;
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
