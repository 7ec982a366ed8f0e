// Where the order of the vertices is cut into lights.
//
// The bits of a vertex's key lead down a binary tree over the space that the vertices are in. One light for all of a node puts their
// flux off by up to the node's edge: two neighbours of the order part where that error, weight times edge, of the least node that
// holds both is too large. So where light is rare it comes from more and weaker lights than its share of the flux would give it, and
// where a cut is depends on what lies in the few nodes around it: nothing that moves elsewhere shifts it, as it would the
// ends of runs of equal weight. Vertices of the same key part by their place in the order. Walter et al. 2005, "Lightcuts".
//
// `measure_nodes`: the error of the least node, in steps of a 32nd of an octave, and how often each step occurs. `cut`: the
// least step with no more cuts at it and above than there is room for lights, the first vertex of each light, and its place in the list.
//
// Sixteen subsets of the lights each light a sixteenth of the pixels. Lights of one block of space, which are neighbours of the order,
// go to one subset after the other, from one on that belongs to the block: each subset has lights from everywhere, and a light more or
// less moves only those behind it in its block to another subset. In one row through all, it would move half of all lights in
// the mean, and what that changes at edges, where a pixel is the mean of few, would be seen.
//
// Cost: a thread a vertex, two binary searches through the order; then one workgroup, two loads a vertex and three a light, and
// eighteen prefix sums.

#import bevy_bounce::shared::grid::{Grid, COUNTER_AREA, COUNTER_AREA_STEPS}
#import bevy_bounce::shared::groups::{exclusive_scan, folded_index, scan_total, stretch_of}
#import bevy_bounce::shared::hilbert::HILBERT_BITS
#import bevy_bounce::shared::sampling::hash
#import bevy_bounce::vpl::types::{VplParameters, VplHeader, SUBSETS, NODE_STEPS, first_key_of_grid}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertex_count: array<u32>;
// Key, slot of the vertex, sorted by key.
@group(0) @binding(3) var<storage, read> pairs: array<vec2<u32>>;
// Weights of the vertices before each, and of all.
@group(0) @binding(4) var<storage, read> starts: array<u32>;
@group(0) @binding(5) var<storage, read> counters: array<u32>;
// Step of the error of the least node that holds a vertex and the one before it; then, by light, its place in the list.
@group(0) @binding(6) var<storage, read_write> nodes: array<u32>;
// Vertices of each step.
@group(0) @binding(7) var<storage, read_write> steps: array<atomic<u32>, NODE_STEPS>;
// First vertex of each light, and the end of the last.
@group(0) @binding(8) var<storage, read_write> firsts: array<u32>;
@group(0) @binding(9) var<storage, read_write> header: VplHeader;

const GROUP: u32 = 256u;
/// Steps that a thread of `cut` adds up.
const STEPS_A_LANE: u32 = NODE_STEPS / GROUP;
/// From room for so many lights on, of all facings, and up to four times as many, a block is as large as the curve.
const LIGHTS_OF_ONE_BLOCK: u32 = 128u;

// The first vertex of the order with that key or a higher one.
fn first_at(key: u32) -> u32 {
    var low = 0u;
    var high = vertex_count[0];
    while low < high {
        let middle = (low + high) / 2u;
        if pairs[middle].x < key {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Weight times edge of the least node that holds a vertex and the one before it; edge in cells of the curve.
fn node_error(index: u32) -> f32 {
    let key = pairs[index].x;
    let differs = key ^ pairs[index - 1u].x;
    if differs != 0u {
        let bits = firstLeadingBit(differs) + 1u;
        let low = (key >> bits) << bits;
        let weight = starts[first_at(low + (1u << bits))] - starts[first_at(low)];
        return f32(weight) * exp2(f32(min(bits, 3u * HILBERT_BITS)) / 3.0);
    }
    let bits = firstLeadingBit(index ^ (index - 1u)) + 1u;
    let low = (index >> bits) << bits;
    return f32(starts[min(low + (1u << bits), first_at(key + 1u))] - starts[max(low, first_at(key))]);
}

// Exponent and the first five bits of the mantissa.
fn step_of(error: f32) -> u32 {
    return min((bitcast<u32>(max(error, 1.0)) - 0x3f800000u) >> 18u, NODE_STEPS - 1u);
}

@compute @workgroup_size(256)
fn measure_nodes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * GROUP + lane;
    if index >= vertex_count[0] {
        return;
    }
    var step = NODE_STEPS - 1u;
    if index > 0u {
        step = step_of(node_error(index));
    }
    nodes[index] = step;
    atomicAdd(&steps[step], 1u);
}

var<workgroup> least: u32;

// The least step of which there are no more vertices, with all above, than there is room for lights.
fn find_least(lane: u32) {
    var counts: array<u32, STEPS_A_LANE>;
    var sum = 0u;
    let highest = NODE_STEPS - 1u - lane * STEPS_A_LANE;
    for (var i = 0u; i < STEPS_A_LANE; i++) {
        counts[i] = atomicLoad(&steps[highest - i]);
        sum += counts[i];
    }
    if lane == 0u {
        least = 0u;
    }
    var above = exclusive_scan(sum, lane);
    if above <= parameters.capacity && above + sum > parameters.capacity {
        var step = highest;
        while above + counts[highest - step] <= parameters.capacity {
            above += counts[highest - step];
            step--;
        }
        least = step + 1u;
    }
    workgroupBarrier();
}

// See `bound.wgsl`; here for the lights and the area of the whole of the finest grid.
fn mean_bound(lights: u32) -> f32 {
    let area = f32(counters[COUNTER_AREA]) / COUNTER_AREA_STEPS * grid.voxel_size * grid.voxel_size;
    return parameters.bound_scale * f32(lights) / max(area, 1e-12);
}

// Bits of a key within a block. Surfaces are in four times as many where its edge is halved, and each leaves its last lights to some of the
// subsets: so that these are even, it is halved where there are four times as many lights.
fn block_bits() -> u32 {
    let levels = firstLeadingBit(max(parameters.capacity / LIGHTS_OF_ONE_BLOCK, 1u)) / 2u;
    return 3u * (HILBERT_BITS - min(levels, HILBERT_BITS));
}

// Of a light, by its first vertex.
fn block_of(light: u32) -> u32 {
    return pairs[firsts[light]].x >> block_bits();
}

// The first light of the block that one is in.
fn first_of_block(light: u32) -> u32 {
    let key = block_of(light) << block_bits();
    var low = 0u;
    var high = light;
    while low < high {
        let middle = (low + high) / 2u;
        if pairs[firsts[middle]].x < key {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low;
}

// Places in the list, subset by subset, and where each of these begins. `lights`: those of the lane.
fn place_lights(lane: u32, lights: vec2<u32>) {
    var counts: array<u32, SUBSETS>;
    var block = 0u;
    var first = 0u;
    for (var light = lights.x; light < lights.y; light++) {
        let own = block_of(light);
        if light == lights.x {
            first = first_of_block(light);
        } else if own != block {
            first = light;
        }
        block = own;
        let subset = (hash(block) + light - first) % SUBSETS;
        nodes[light] = subset;
        counts[subset]++;
    }
    var start = 0u;
    for (var subset = 0u; subset < SUBSETS; subset++) {
        let before = exclusive_scan(counts[subset], lane);
        counts[subset] = start + before;
        if lane == 0u {
            header.subset_start[subset] = start;
        }
        start += scan_total();
        workgroupBarrier();
    }
    for (var light = lights.x; light < lights.y; light++) {
        let subset = nodes[light];
        nodes[light] = counts[subset];
        counts[subset]++;
    }
}

fn write_header(count: u32, in_finest_grid: u32) {
    header.subset_start[SUBSETS] = count;
    header.count = count;
    header.path_count = parameters.path_count;
    header.bound_scale = parameters.bound_scale;
    header.geometry_bound = mean_bound(in_finest_grid);
}

var<workgroup> lights_in_finest_grid: u32;

@compute @workgroup_size(256)
fn cut(@builtin(local_invocation_index) lane: u32) {
    find_least(lane);
    let count = vertex_count[0];
    let stretch = stretch_of(lane, count);
    var sum = 0u;
    for (var i = stretch.x; i < stretch.y; i++) {
        sum += u32(nodes[i] >= least);
    }
    // Vertices of the finest grid come first.
    let next_grid = first_at(first_key_of_grid(1u));
    var light = exclusive_scan(sum, lane);
    for (var i = stretch.x; i < stretch.y; i++) {
        if nodes[i] >= least {
            firsts[light] = i;
            light++;
        }
        if i + 1u == next_grid {
            lights_in_finest_grid = light;
        }
    }
    let lights = scan_total();
    if lane == 0u {
        firsts[lights] = count;
    }
    workgroupBarrier();
    storageBarrier();
    if lane == 0u {
        write_header(lights, select(lights_in_finest_grid, 0u, next_grid == 0u));
    }
    place_lights(lane, stretch_of(lane, lights));
}
