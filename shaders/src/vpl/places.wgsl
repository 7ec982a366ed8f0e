// From where paths met the grid, or a triangle (`settle.wgsl`), to vertices: paths are reflected there, by the albedo
// of the cell that looks their way, or end.
//
// Cost: one thread a path that goes on; the cells of a voxel in each grid and group that it is in.

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{GridLevel, level_of, to_level, voxel_index, voxel_facings, cell_area, CELL_MASK}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::rays::{grid, voxels, cells, voxel_groups}
#import bevy_bounce::shared::sampling::sample_square
#import bevy_bounce::shared::voxel_groups::{group_level, to_group, normal_to_group}
#import bevy_bounce::vpl::types::{
    Vpl, VplParameters, Path, MET, UNSETTLED, ON_TRIANGLE, NO_CELL, NO_PATH, DIMENSION_BOUNCE, vertex_slot,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<storage, read_write> paths: array<Path>;
@group(0) @binding(2) var<storage, read_write> vertices: array<Vpl>;

// A cell, and the cosine between its normal and that of a surface that was met by its triangle.
struct Match {
    cell: u32,
    cosine: f32,
}

// The better of a match and of what a voxel has.
fn match_voxel(best: Match, level: GridLevel, place: vec3<f32>, normal: vec3<f32>) -> Match {
    var found = best;
    let voxel = vec3<i32>(floor(place));
    if any(voxel < vec3<i32>(0)) || any(voxel >= vec3<i32>(level.dims)) {
        return found;
    }
    let word = voxels[voxel_index(level, voxel)];
    let first = level.first_cell + (word & CELL_MASK);
    for (var i = 0u; i < countOneBits(voxel_facings(word)); i++) {
        let cosine = dot(decode_unit(cells[first + i].normal), normal);
        if cosine > found.cosine && cell_area(cells[first + i]) > 0.0 {
            found = Match(first + i, cosine);
        }
    }
    return found;
}

// The cell of that surface, whichever grid it is in; `otherwise` where none looks its way.
fn cell_at(position: vec3<f32>, normal: vec3<f32>, otherwise: u32) -> u32 {
    let level = level_of(grid, position);
    var best = match_voxel(Match(otherwise, 0.0), level, to_level(level, position), normal);
    for (var i = 0u; is_within(i, voxel_groups.count, position.x); i++) {
        let group = voxel_groups.groups[i];
        best = match_voxel(best, group_level(group), to_group(group, position), normal_to_group(group, normal));
    }
    return best.cell;
}

@compute @workgroup_size(64)
fn set_vertices(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.path_count {
        return;
    }
    let path = paths[id.x].alive;
    if path == NO_PATH || (paths[path].first & UNSETTLED) == 0u {
        return;
    }
    let count = paths[path].length;
    let left = paths[path].first & ~(UNSETTLED | ON_TRIANGLE);
    let is_on_triangle = (paths[path].first & ON_TRIANGLE) != 0u;
    paths[path].first = 0u;
    let bounce = count + paths[path].first_bounce;
    let slot = vertex_slot(parameters, path, count);
    let vertex = vertices[slot];
    var cell = vertex.bounce_met;
    if is_on_triangle {
        cell = cell_at(vertex.position, vertex.normal, cell);
    }
    if cell == NO_CELL {
        return;
    }
    if count > 0u {
        vertices[slot - 1u].bounce_met |= MET;
    }
    let albedo = unpack4x8unorm(cells[cell].albedo).rgb;
    let survival = max(albedo.r, max(albedo.g, albedo.b));
    if sample_square(vertex.sample, DIMENSION_BOUNCE + 2u * bounce).x >= survival {
        return;
    }
    vertices[slot].flux *= albedo / survival;
    // Where the last one's light goes is not looked at.
    vertices[slot].bounce_met = bounce | select(0u, MET, left == 1u);
    paths[path].length = count + 1u;
    paths[path].first = left - 1u;
}
