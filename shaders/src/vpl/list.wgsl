// From paths to the list of virtual lights.
//
// Many more vertices are traced than the list holds. In an order in which neighbours are neighbours in space, they are cut
// into as many runs as there is room for; a run becomes one light, with all its flux, at one of its vertices, chosen in
// proportion to flux: the same one as long as it is in the run, so that lights keep their places where runs shift by a few
// vertices. What a light carries is thus an average over many paths. A vertex counts towards the length of its run
// by the inverse cube root of how many there are around (in the same brick of the grid): where light is rare, it comes from
// more and weaker lights than its share of the flux would give it. One whose light goes on into the open counts a fifth: a
// roof in the sun does not take the lights from the rooms below it.
//
// Light k of the order belongs to subset k mod 16: each of the sixteen subsets has lights from everywhere.
//
// Cost: one workgroup adds up the weights, four loads and an atomic addition a vertex; then a thread a light, two loads a vertex.

#import bevy_bounce::shared::groups::exclusive_scan
#import bevy_bounce::shared::grid::{Grid, grid_level, level_at, brick_at, COUNTER_AREA}
#import bevy_bounce::shared::sampling::waiting_time
#import bevy_bounce::vpl::types::{
    Vpl, VplParameters, VplHeader, SUBSETS, MET, BRICK_WORDS, BRICK_VERTICES, BRICK_LIGHTS, LIGHT_SHIFT,
    luminance,
}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertices: array<Vpl>;
@group(0) @binding(3) var<storage, read> vertex_count: array<u32>;
// Key, slot of the vertex, sorted by key.
@group(0) @binding(4) var<storage, read> pairs: array<vec2<u32>>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(5) var<storage, read_write> bricks: array<atomic<u32>>;
@group(0) @binding(6) var<storage, read> counters: array<u32>;
// Weight of each vertex; then the weights of those before it, lights in fixed point.
@group(0) @binding(7) var<storage, read_write> starts: array<u32>;
@group(0) @binding(8) var<storage, read_write> header: VplHeader;
@group(0) @binding(9) var<storage, read_write> vpls: array<Vpl>;

const GROUP: u32 = 256u;
/// What a vertex counts whose light meets nothing.
const OPEN_WEIGHT: f32 = 0.2;

var<workgroup> float_scratch: array<f32, GROUP>;

fn total(value: f32, lane: u32) -> f32 {
    float_scratch[lane] = value;
    workgroupBarrier();
    for (var step = GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            float_scratch[lane] += float_scratch[lane + step];
        }
        workgroupBarrier();
    }
    return float_scratch[0];
}

// First word of what is known of the brick of a grid that a vertex is in.
fn brick_of(vertex: Vpl, level: u32) -> u32 {
    return brick_at(grid_level(grid, level), vertex.position) * BRICK_WORDS;
}

fn weight_of(vertex: Vpl, level: u32) -> f32 {
    let around = f32(atomicLoad(&bricks[brick_of(vertex, level) + BRICK_VERTICES]));
    let onward = select(OPEN_WEIGHT, 1.0, (vertex.bounce_met & MET) != 0u);
    return onward * pow(max(around, 1.0), -1.0 / 3.0);
}

// See `bound.wgsl`; here for the lights and the area of the whole of the finest grid.
fn mean_bound(count: f32) -> f32 {
    let area = f32(counters[COUNTER_AREA]) / 256.0 * grid.voxel_size * grid.voxel_size;
    return parameters.bound_scale * count / max(area, 1e-12);
}

// `finest`: what part of the lights is in the finest grid.
fn write_header(count: u32, finest: f32) {
    for (var subset = 0u; subset <= SUBSETS; subset++) {
        header.subset_start[subset] = subset * (count / SUBSETS) + min(subset, count % SUBSETS);
    }
    header.count = count;
    header.path_count = parameters.path_count;
    header.geometry_bound = mean_bound(f32(count) * finest);
}

@compute @workgroup_size(256)
fn scan_weights(@builtin(local_invocation_index) lane: u32) {
    let count = vertex_count[0];
    let chunk = (count + GROUP - 1u) / GROUP;
    let first = min(lane * chunk, count);
    let end = min(first + chunk, count);
    var weight = 0.0;
    var finest = 0.0;
    for (var i = first; i < end; i++) {
        let vertex = vertices[pairs[i].y];
        let level = level_at(grid, vertex.position);
        let own = weight_of(vertex, level);
        starts[i] = bitcast<u32>(own);
        weight += own;
        finest += select(0.0, own, level == 0u);
    }
    let whole = max(total(weight, lane), 1e-30);
    workgroupBarrier();
    let finest_part = total(finest, lane) / whole;
    // One place is left for what rounding adds.
    let scale = f32((parameters.capacity - 1u) << LIGHT_SHIFT) / whole;
    var sum = 0u;
    for (var i = first; i < end; i++) {
        let own = u32(min(bitcast<f32>(starts[i]) * scale, f32(1u << LIGHT_SHIFT)));
        let vertex = vertices[pairs[i].y];
        for (var level = level_at(grid, vertex.position); level <= grid.further_count; level++) {
            atomicAdd(&bricks[brick_of(vertex, level) + BRICK_LIGHTS], own);
        }
        starts[i] = sum;
        sum += own;
    }
    let before = exclusive_scan(sum, lane);
    for (var i = first; i < end; i++) {
        starts[i] += before;
    }
    if lane == 0u && count == 0u {
        write_header(0u, 1.0);
    } else if end == count && first < end {
        write_header(min((starts[count - 1u] >> LIGHT_SHIFT) + 1u, parameters.capacity), finest_part);
    }
}

// The first vertex of the order that belongs to that light or a later one.
fn first_vertex(light: u32) -> u32 {
    var low = 0u;
    var high = vertex_count[0];
    while low < high {
        let middle = (low + high) / 2u;
        if (starts[middle] >> LIGHT_SHIFT) < light {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

@compute @workgroup_size(64)
fn build_list(@builtin(global_invocation_id) id: vec3<u32>) {
    let light = id.x;
    if light >= header.count {
        return;
    }
    let first = first_vertex(light);
    let end = first_vertex(light + 1u);
    var flux = vec3<f32>(0.0);
    var chosen = pairs[first].y;
    var least = 1e38;
    for (var i = first; i < end; i++) {
        let slot = pairs[i].y;
        let own = vertices[slot].flux;
        // The chance belongs to the vertex of the path, whatever run it is in.
        let wait = waiting_time(slot, luminance(own));
        chosen = select(chosen, slot, wait < least);
        least = min(least, wait);
        flux += own;
    }
    var vpl = vertices[chosen];
    vpl.flux = flux / f32(parameters.path_count);
    vpls[header.subset_start[light % SUBSETS] + light / SUBSETS] = vpl;
}
