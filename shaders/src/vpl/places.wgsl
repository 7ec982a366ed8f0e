// From where paths met the grid to vertices: `file_ways` files the stretches of each path on which triangles may be met under the
// blocks that they go through (`ways.wgsl`); `set_vertices` sets the vertex on the first that was met (`settle.wgsl`), or leaves it on the
// plane of its voxel, and reflects the path there, or ends it.
//
// Cost: one thread a path; up to ten atomic exchanges, and the cells of a voxel in each grid and group that it is in.

#import bevy_bounce::shared::grid::{
    GridLevel, grid_level, level_at, to_level, voxel_index, voxel_facings, cell_area, CELL_MASK,
}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::rays::{grid, voxels, cells, voxel_groups}
#import bevy_bounce::shared::sampling::sample_square
#import bevy_bounce::shared::voxel_groups::{group_level, to_group, normal_to_group}
#import bevy_bounce::vpl::types::{
    Vpl, VplParameters, Path, MET, UNSETTLED, NO_CELL, MEETING_NONE, DIMENSION_BOUNCE, vertex_slot, meeting_distance, meeting_normal,
}
#import bevy_bounce::vpl::ways::{
    Way, way_from_start, way_at_hit, walk_along, advance, block_index, MEETING_WORDS, MEETING_HIT, MEETING_START, MEETING_SLOT,
    MEETING_HIT_BLOCKS, MEETING_START_BLOCKS, HIT_BLOCKS, START_BLOCKS,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<storage, read_write> paths: array<Path>;
@group(0) @binding(2) var<storage, read_write> vertices: array<Vpl>;
// By block of the grid, the first of the ways that are filed under it: a word of `meetings`, counted from 1.
@group(0) @binding(3) var<storage, read_write> way_heads: array<atomic<u32>>;
// `MEETING_WORDS` a path.
@group(0) @binding(4) var<storage, read_write> meetings: array<u32>;

fn is_unsettled(path: u32) -> bool {
    return path < parameters.path_count && (paths[path].first & UNSETTLED) != 0u;
}

fn level_of(position: vec3<f32>) -> GridLevel {
    return grid_level(grid, level_at(grid, position));
}

fn file_way(way: Way, level: GridLevel, first_word: u32, most: u32) {
    var walk = walk_along(way);
    var distance = 0.0;
    for (var word = first_word; word < first_word + most && distance <= way.length; word++) {
        meetings[word] = atomicExchange(&way_heads[block_index(level, walk.block)], word + 1u);
        distance = advance(&walk, way);
    }
}

@compute @workgroup_size(64)
fn file_ways(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x;
    if !is_unsettled(path) {
        return;
    }
    let words = path * MEETING_WORDS;
    let slot = vertex_slot(parameters, path, paths[path].length);
    let vertex = vertices[slot];
    meetings[words + MEETING_HIT] = MEETING_NONE;
    meetings[words + MEETING_START] = MEETING_NONE;
    meetings[words + MEETING_SLOT] = slot;
    if vertex.bounce_met != NO_CELL {
        let level = level_of(vertex.position);
        file_way(way_at_hit(level, vertex.position, vertex.incoming), level, words + MEETING_HIT_BLOCKS, HIT_BLOCKS);
    }
    if paths[path].length > 0u {
        let start = vertices[slot - 1u];
        let level = level_of(start.position);
        file_way(way_from_start(level, start, vertex.incoming), level, words + MEETING_START_BLOCKS, START_BLOCKS);
    }
}

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
    let level = level_of(position);
    var best = match_voxel(Match(otherwise, 0.0), level, to_level(level, position), normal);
    for (var i = 0u; i < voxel_groups.count; i++) {
        let group = voxel_groups.groups[i];
        best = match_voxel(best, group_level(group), to_group(group, position), normal_to_group(group, normal));
    }
    return best.cell;
}

struct Place {
    position: vec3<f32>,
    normal: vec3<f32>,
    cell: u32,
}

fn place_on(way: Way, level: GridLevel, meeting: u32, otherwise: u32) -> Place {
    let place = way.start + way.direction * meeting_distance(meeting);
    let position = level.origin + place * level.voxel_size;
    let normal = meeting_normal(meeting);
    return Place(position, normal, cell_at(position, normal, otherwise));
}

// Where the path is reflected next.
fn place_of(path: u32, slot: u32) -> Place {
    let vertex = vertices[slot];
    let from_start = meetings[path * MEETING_WORDS + MEETING_START];
    if from_start != MEETING_NONE {
        let level = level_of(vertices[slot - 1u].position);
        return place_on(way_from_start(level, vertices[slot - 1u], vertex.incoming), level, from_start, vertex.bounce_met);
    }
    let at_hit = meetings[path * MEETING_WORDS + MEETING_HIT];
    if at_hit != MEETING_NONE {
        let level = level_of(vertex.position);
        return place_on(way_at_hit(level, vertex.position, vertex.incoming), level, at_hit, vertex.bounce_met);
    }
    return Place(vertex.position, vertex.normal, vertex.bounce_met);
}

@compute @workgroup_size(64)
fn set_vertices(@builtin(global_invocation_id) id: vec3<u32>) {
    let path = id.x;
    if !is_unsettled(path) {
        return;
    }
    let count = paths[path].length;
    let left = paths[path].first & ~UNSETTLED;
    let bounce = count + paths[path].first_bounce;
    let slot = vertex_slot(parameters, path, count);
    let place = place_of(path, slot);
    paths[path].first = 0u;
    if place.cell == NO_CELL {
        return;
    }
    if count > 0u {
        vertices[slot - 1u].bounce_met |= MET;
    }
    let albedo = unpack4x8unorm(cells[place.cell].albedo).rgb;
    let survival = max(albedo.r, max(albedo.g, albedo.b));
    if sample_square(vertices[slot].sample, DIMENSION_BOUNCE + 2u * bounce).x >= survival {
        return;
    }
    vertices[slot].position = place.position;
    vertices[slot].normal = place.normal;
    vertices[slot].flux *= albedo / survival;
    // Where the last one's light goes is not looked at.
    vertices[slot].bounce_met = bounce | select(0u, MET, left == 1u);
    paths[path].length = count + 1u;
    paths[path].first = left - 1u;
}
