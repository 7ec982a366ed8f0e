// The finest level of the light volume: what the cells send, and how much of a voxel's face they cover.
//
// A texel is written for every voxel and facing, dark and clear where nothing is: radiance times coverage, relative to the
// scene's unit, and coverage. Coverage is the area projected onto the voxel's face: that of a closed surface, added up along
// a column of voxels, is one, however it lies. A slanted cell covers faces of two or three axes. Further bounces are the mean over the 4x4
// cells of the same facing around, which have all sixteen subsets of the virtual lights.
//
// Groups with a grid of their own have a cube of texels each (`GROUPS`), one behind the other along z, in the
// directions of their grids; there is no gap between the halves.
//
// Cost: one thread a voxel; for each of its cells sixteen voxels and a cell's words of those that are filled.

#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::control::holds
#import bevy_bounce::shared::grid::{
    Grid, GridLevel, Cell, grid_level, voxel_index, voxel_facings, cell_index, cell_area, AREA_ONE,
}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::Scene
#import bevy_bounce::shared::voxel_groups::{VoxelGroups, group_level, GROUP_CELLS, GROUP_EDGE}

@group(0) @binding(0) var<uniform> volume: LightVolume;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<uniform> scene: Scene;
@group(0) @binding(3) var<storage, read> voxels: array<u32>;
@group(0) @binding(4) var<storage, read> cells: array<Cell>;
@group(0) @binding(5) var<storage, read> irradiance: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read> emission_sums: array<u32>;
@group(0) @binding(7) var<storage, read> unit: array<f32>;
@group(0) @binding(8) var level_x: texture_storage_3d<rgba16float, write>;
@group(0) @binding(9) var level_y: texture_storage_3d<rgba16float, write>;
@group(0) @binding(10) var level_z: texture_storage_3d<rgba16float, write>;

@group(0) @binding(11) var<uniform> voxel_groups: VoxelGroups;

// The grid of the thread's voxel, where the light of its cells begins, and what their emission is a part of.
var<private> level: GridLevel;
var<private> first_light: u32;
var<private> max_emission: f32;

/// Cosine between the normals of cells that are one surface.
const SAME_SURFACE: f32 = 0.5;

fn word_at(voxel: vec3<i32>) -> u32 {
    if any(voxel < vec3<i32>(0)) || any(voxel >= vec3<i32>(level.dims)) {
        return 0u;
    }
    return voxels[voxel_index(level, voxel)];
}

// The cell of that facing in the voxel, counted from the grid's first, or in one of those before and behind it along the facing's axis.
fn find_cell(voxel: vec3<i32>, axis: u32, facing: u32) -> i32 {
    for (var i = 0; i < 3; i++) {
        var at = voxel;
        at[axis] += (i + 1) % 3 - 1;
        let word = word_at(at);
        if (voxel_facings(word) & (1u << facing)) != 0u {
            return i32(cell_index(word, facing));
        }
    }
    return -1;
}

// Mean irradiance by virtual lights around a cell.
fn further_light(voxel: vec3<i32>, facing: u32, normal: vec3<f32>) -> vec3<f32> {
    let axis = facing / 2u;
    var sum = vec4<f32>(0.0);
    for (var i = 0; i < 16; i++) {
        var at = voxel;
        at[(axis + 1u) % 3u] += (i & 3) - 2;
        at[(axis + 2u) % 3u] += (i >> 2u) - 2;
        let cell = find_cell(at, axis, facing);
        if cell >= 0 && dot(decode_unit(cells[level.first_cell + u32(cell)].normal), normal) > SAME_SURFACE {
            sum += vec4<f32>(irradiance[2u * (first_light + u32(cell)) + 1u].rgb, 1.0);
        }
    }
    return sum.rgb / max(sum.w, 1.0);
}

// Light that a cell sends, cd/m^2.
fn radiance_of(voxel: vec3<i32>, facing: u32, index: u32, normal: vec3<f32>, area: f32) -> vec3<f32> {
    var light = irradiance[2u * (first_light + index)].rgb;
    if holds(volume.further != 0u, area) {
        light += further_light(voxel, facing, normal);
    }
    var radiance = unpack4x8unorm(cells[level.first_cell + index].albedo).rgb * light / PI;
    if holds(max_emission > 0.0, area) {
        let first = 3u * (level.first_cell + index);
        let sums = vec3<u32>(emission_sums[first], emission_sums[first + 1u], emission_sums[first + 2u]);
        radiance += min(vec3<f32>(sums) / (area * AREA_ONE), vec3<f32>(1.0)) * max_emission;
    }
    return min(radiance / unit[0], vec3<f32>(6e4));
}

// Covers no more than all of a face.
fn closed(sum: vec4<f32>) -> vec4<f32> {
    return sum / max(sum.a, 1.0);
}

@compute @workgroup_size(4, 4, 4)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
#ifdef GROUPS
    let index = id.z / GROUP_EDGE;
    if index >= voxel_groups.count || any(id.xy >= vec2<u32>(GROUP_EDGE)) {
        return;
    }
    let group = voxel_groups.groups[index];
    level = group_level(group);
    first_light = volume.first_group_cell + index * GROUP_CELLS;
    max_emission = group.max_emission;
    let voxel = vec3<i32>(vec3<u32>(id.xy, id.z % GROUP_EDGE));
    let other = vec3<i32>(id) + vec3<i32>(i32(GROUP_EDGE), 0, 0);
#else
    if any(id >= volume.dims) {
        return;
    }
    level = grid_level(grid, 0u);
    max_emission = select(0.0, scene.max_emission, scene.world_emissive_chunk_count > 0u);
    let voxel = vec3<i32>(id);
    let other = voxel + vec3<i32>(i32(volume.dims.x + volume.gap), 0, 0);
#endif
    let word = word_at(voxel);
    // By axis: what faces up it, what faces down.
    var up = array<vec4<f32>, 3>();
    var down = array<vec4<f32>, 3>();
    var facings = voxel_facings(word);
    while facings != 0u {
        let facing = firstTrailingBit(facings);
        facings &= facings - 1u;
        let index = cell_index(word, facing);
        let cell = cells[level.first_cell + index];
        let area = cell_area(cell);
        if area <= 0.0 {
            continue;
        }
        let normal = decode_unit(cell.normal);
        let light = vec4<f32>(radiance_of(voxel, facing, index, normal, area), 1.0) * area;
        for (var axis = 0; axis < 3; axis++) {
            up[axis] += light * max(normal[axis], 0.0);
            down[axis] += light * max(-normal[axis], 0.0);
        }
    }
    textureStore(level_x, id, closed(up[0]));
    textureStore(level_x, vec3<u32>(other), closed(down[0]));
    textureStore(level_y, id, closed(up[1]));
    textureStore(level_y, vec3<u32>(other), closed(down[1]));
    textureStore(level_z, id, closed(up[2]));
    textureStore(level_z, vec3<u32>(other), closed(down[2]));
}
