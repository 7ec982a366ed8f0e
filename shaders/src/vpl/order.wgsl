// Vertices of the paths, in an order in which neighbours are neighbours in space and look the same way: of nested grids by the
// one they are in, then by facing, then along a Hilbert curve. Here the keys; the sort is `sort/radix.wgsl`.
//
// Cost: a vertex is read once; one workgroup adds up the lengths of the paths.

#import bevy_bounce::shared::grid::{Grid, grid_level, level_at, facing_of}
#import bevy_bounce::shared::groups::{exclusive_scan, stretch_of}
#import bevy_bounce::shared::hilbert::{hilbert_index, HILBERT_BITS}
#import bevy_bounce::vpl::types::{Vpl, Path, VplParameters, first_key_of_grid, vertex_slot}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertices: array<Vpl>;
@group(0) @binding(3) var<storage, read_write> paths: array<Path>;
// Vertices of all paths, in the first word.
@group(0) @binding(4) var<storage, read_write> vertex_count: array<u32>;
// Key, slot of the vertex.
@group(0) @binding(5) var<storage, read_write> pairs: array<vec2<u32>>;

const GROUP: u32 = 256u;

@compute @workgroup_size(256)
fn scan_paths(@builtin(local_invocation_index) lane: u32) {
    let stretch = stretch_of(lane, parameters.path_count);
    var sum = 0u;
    for (var path = stretch.x; path < stretch.y; path++) {
        sum += paths[path].length;
    }
    var first = exclusive_scan(sum, lane);
    for (var path = stretch.x; path < stretch.y; path++) {
        paths[path].first = first;
        first += paths[path].length;
    }
    if lane == GROUP - 1u {
        vertex_count[0] = first;
    }
}

fn key(vpl: Vpl) -> u32 {
    let index = level_at(grid, vpl.position);
    let level = grid_level(grid, index);
    let edge = f32(max(level.dims.x, max(level.dims.y, level.dims.z))) * level.voxel_size;
    let cells = f32(1u << HILBERT_BITS);
    var cell = clamp((vpl.position - level.origin) / edge * cells, vec3<f32>(0.0), vec3<f32>(cells - 1.0));
    if index < grid.further_count {
        // What moves with the camera: cells that stay where they are in the world, on a curve that begins anew after two edges, so
        // that it brings nothing together that lies apart.
        cell = floor(fract(vpl.position / (2.0 * edge)) * cells);
    }
    let place = hilbert_index(vec3<u32>(cell));
    return first_key_of_grid(index) + ((facing_of(vpl.normal) << (3u * HILBERT_BITS)) | place);
}

@compute @workgroup_size(64)
fn write_pairs(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= parameters.path_count {
        return;
    }
    let path = paths[id.x];
    for (var i = 0u; i < path.length; i++) {
        let slot = vertex_slot(parameters, id.x, i);
        pairs[path.first + i] = vec2<u32>(key(vertices[slot]), slot);
    }
}
