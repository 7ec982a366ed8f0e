// What the vertices of the paths weigh when they are cut into lights, as a running sum along their order.
//
// All alike, for paths end by roulette and carry about the same flux; one whose light goes on into the open a fifth: a roof in the
// sun does not take the lights from the rooms below it.
//
// Cost: one workgroup; two loads a vertex.

#import bevy_bounce::shared::groups::{exclusive_scan, stretch_of}
#import bevy_bounce::vpl::types::{Vpl, MET}

@group(0) @binding(0) var<storage, read> vertices: array<Vpl>;
@group(0) @binding(1) var<storage, read> vertex_count: array<u32>;
// Key, slot of the vertex, sorted by key.
@group(0) @binding(2) var<storage, read> pairs: array<vec2<u32>>;
// Weights of the vertices before each, and of all.
@group(0) @binding(3) var<storage, read_write> starts: array<u32>;

const GROUP: u32 = 256u;
const WEIGHT: u32 = 5u;
const OPEN_WEIGHT: u32 = 1u;

@compute @workgroup_size(256)
fn scan_weights(@builtin(local_invocation_index) lane: u32) {
    let count = vertex_count[0];
    let stretch = stretch_of(lane, count);
    var sum = 0u;
    for (var i = stretch.x; i < stretch.y; i++) {
        starts[i] = sum;
        sum += select(OPEN_WEIGHT, WEIGHT, (vertices[pairs[i].y].bounce_met & MET) != 0u);
    }
    let before = exclusive_scan(sum, lane);
    for (var i = stretch.x; i < stretch.y; i++) {
        starts[i] += before;
    }
    if lane == GROUP - 1u {
        starts[count] = before + sum;
    }
}
