// From the order of the vertices to the list of virtual lights.
//
// Many more vertices are traced than the list holds. In an order in which neighbours are neighbours in space, they are cut
// into as many runs as there is room for (`cuts.wgsl`); a run becomes one light, with all its flux. What a light carries is thus an
// average over many paths.
//
// It stands at one of its vertices. One is drawn in proportion to flux, the same as long as it is in the run, and the light is at
// the vertex nearest to half the way from there to the middle of all: what a light is off the middle of what it stands for is noise in
// the picture, and half of that is a quarter of its variance. At the middle itself there may be nothing; half the way, of a run that
// lies on two things, is on the side of the one that was drawn, which each is in proportion to its flux.
//
// The surface that it stands for is as large as the disc over which points would be as far apart as its vertices are; these and one more
// that lies as far off as lights are apart in the mean.
//
// How many lights there are in a brick of the grid is told by their vertices, each its part of one; of nested grids, in each that
// holds it.
//
// Cost: a thread a light; four loads a vertex, and an atomic addition for each grid that holds it.

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{Grid, grid_level, level_at, brick_at}
#import bevy_bounce::shared::sampling::{waiting_time, PI}
#import bevy_bounce::vpl::compact::{CompactVpl, compact}
#import bevy_bounce::vpl::types::{
    Vpl, VplHeader, VplParameters, BRICK_WORDS, BRICK_LIGHTS, LIGHT_SHIFT, MET, vertex_slot, luminance,
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
// By light of the order: its place in the list. See `cuts.wgsl`.
@group(0) @binding(8) var<storage, read> nodes: array<u32>;
// The list once more.
@group(0) @binding(9) var<storage, read_write> compact_vpls: array<CompactVpl>;

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

// Where the vertices of a light lie, weighted by flux: sums of weights, of offsets from the first, and of their squares.
struct Spread {
    weight: f32,
    offset: vec3<f32>,
    square: f32,
}

fn middle_of(spread: Spread) -> vec3<f32> {
    return spread.offset / max(spread.weight, 1e-30);
}

fn area_of(spread: Spread, count: u32) -> f32 {
    let middle = middle_of(spread);
    let variance = max(spread.square / max(spread.weight, 1e-30) - dot(middle, middle), 0.0);
    return 2.0 * PI * variance + 1.0 / (max(header.geometry_bound, 1e-12) * f32(count));
}

// Of some vertices, the one nearest to a point.
fn nearest_slot(first: u32, end: u32, point: vec3<f32>) -> u32 {
    var nearest = pairs[first].y;
    var least = 1e38;
    for (var i = first; i < end; i++) {
        let slot = pairs[i].y;
        let off = distance(vertices[slot].position, point);
        nearest = select(nearest, slot, off < least);
        least = min(least, off);
    }
    return nearest;
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
    let origin = vertices[pairs[first].y].position;
    var flux = vec3<f32>(0.0);
    var spread = Spread();
    var drawn = origin;
    var least = 1e38;
    for (var i = first; i < end; i++) {
        let slot = pairs[i].y;
        let own = vertices[slot].flux;
        let position = vertices[slot].position;
        let weight = luminance(own);
        let offset = position - origin;
        flux += own;
        spread = Spread(spread.weight + weight, spread.offset + weight * offset, spread.square + weight * dot(offset, offset));
        count_in_bricks(position, part);
        let wait = waiting_time(name_of(vertices[slot]), weight);
        drawn = select(drawn, position, wait < least);
        least = min(least, wait);
    }
    let middle = origin + middle_of(spread);
    var vpl = vertices[nearest_slot(first, end, 0.5 * (drawn + middle))];
    vpl.flux = flux / f32(header.path_count);
    vpl.incoming = bitcast<u32>(area_of(spread, end - first));
    vpls[nodes[light]] = vpl;
    compact_vpls[nodes[light]] = compact(vpl);
}
