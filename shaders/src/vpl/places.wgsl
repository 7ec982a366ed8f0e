// From where paths met a triangle (`settle.wgsl`), or else the grid, to vertices: paths are reflected there, by the albedo
// of the triangle or of the cell, or end.
//
// Cost: one thread a path that goes on; a cell where no triangle was met.

#import bevy_bounce::shared::rays::cells
#import bevy_bounce::shared::sampling::sample_square
#import bevy_bounce::vpl::types::{
    Vpl, VplParameters, Path, MET, UNSETTLED, ON_TRIANGLE, NO_CELL, NO_PATH, DIMENSION_BOUNCE, vertex_slot,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<storage, read_write> paths: array<Path>;
@group(0) @binding(2) var<storage, read_write> vertices: array<Vpl>;

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
    var met = vertex.bounce_met;
    if !is_on_triangle {
        if met == NO_CELL {
            return;
        }
        met = cells[met].albedo;
    }
    if count > 0u {
        vertices[slot - 1u].bounce_met |= MET;
    }
    let albedo = unpack4x8unorm(met).rgb;
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
