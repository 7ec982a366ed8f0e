// From the order of the vertices to the list of virtual lights.
//
// Many more vertices are traced than the list holds. In an order in which neighbours are neighbours in space, they are cut
// into as many runs as there is room for (`cuts.wgsl`); a run becomes one light, with all its flux, at one of its vertices, chosen in
// proportion to flux: the same one as long as it is in the run. What a light carries is thus an average over many paths.
//
// Light k of the order belongs to subset k mod 16: each of the sixteen subsets has lights from everywhere.
//
// How many lights there are in a brick of the grid is told by their vertices, each its part of one; of nested grids, in each that
// holds it.
//
// Cost: a thread a light; two loads a vertex, and an atomic addition for each grid that holds it.

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{Grid, grid_level, level_at, brick_at}
#import bevy_bounce::shared::sampling::waiting_time
#import bevy_bounce::vpl::types::{
    Vpl, VplHeader, VplParameters, SUBSETS, BRICK_WORDS, BRICK_LIGHTS, LIGHT_SHIFT, MET, vertex_slot, luminance,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertices: array<Vpl>;
// Key, slot of the vertex, sorted by key.
@group(0) @binding(3) var<storage, read> pairs: array<vec2<u32>>;
// First vertex of each light, and the end of the last.
@group(0) @binding(4) var<storage, read> firsts: array<u32>;
@group(0) @binding(5) var<storage, read> header: VplHeader;
@group(0) @binding(6) var<storage, read_write> vpls: array<Vpl>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(7) var<storage, read_write> bricks: array<atomic<u32>>;

fn count_in_bricks(position: vec3<f32>, part: u32) {
    for (var level = level_at(grid, position); is_within(level, grid.further_count + 1u, position.x); level++) {
        atomicAdd(&bricks[brick_at(grid_level(grid, level), position) * BRICK_WORDS + BRICK_LIGHTS], part);
    }
}

// The chance belongs to the vertex, whatever run it is in and whatever else shines. What is emitted comes after the last bounce, so that
// no two of a path share one.
fn name_of(vertex: Vpl) -> u32 {
    let bounces = parameters.max_bounces + 1u;
    let bounce = vertex.bounce_met & ~MET;
    return vertex_slot(parameters, vertex.sample, (bounce + bounces - 1u) % bounces);
}

@compute @workgroup_size(64)
fn build_list(@builtin(global_invocation_id) id: vec3<u32>) {
    let light = id.x;
    if light >= header.count {
        return;
    }
    let first = firsts[light];
    let end = firsts[light + 1u];
    let part = (1u << LIGHT_SHIFT) / (end - first);
    var flux = vec3<f32>(0.0);
    var chosen = pairs[first].y;
    var least = 1e38;
    for (var i = first; i < end; i++) {
        let slot = pairs[i].y;
        let own = vertices[slot].flux;
        count_in_bricks(vertices[slot].position, part);
        let wait = waiting_time(name_of(vertices[slot]), luminance(own));
        chosen = select(chosen, slot, wait < least);
        least = min(least, wait);
        flux += own;
    }
    var vpl = vertices[chosen];
    vpl.flux = flux / f32(header.path_count);
    vpls[header.subset_start[light % SUBSETS] + light / SUBSETS] = vpl;
}
