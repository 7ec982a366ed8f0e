// Stable sort of pairs by their key, eight bits a pass: count, scan, scatter. Satish et al. 2009, "Designing Efficient Sorting
// Algorithms for Manycore GPUs".
//
// Cost of a pass: a pair is read twice and written once; its rank within 256 takes one atomic and eight reads of 9 KiB of
// workgroup memory.

struct Digit {
    // Lowest of its eight bits.
    shift: u32,
}

#import bevy_bounce::shared::groups::exclusive_scan

@group(0) @binding(0) var<uniform> digit: Digit;
// Pairs, in the first word.
@group(0) @binding(1) var<storage, read> pair_count: array<u32>;
// Key, value.
@group(0) @binding(2) var<storage, read> unsorted: array<vec2<u32>>;
@group(0) @binding(3) var<storage, read_write> sorted: array<vec2<u32>>;
// Digit by digit, block by block: pairs; after the scan, where they go.
@group(0) @binding(4) var<storage, read_write> counts: array<u32>;

const DIGITS: u32 = 256u;
/// Pairs a workgroup takes.
const SORT_BLOCK: u32 = 1024u;

/// Words of a bit a lane.
const LANE_WORDS: u32 = DIGITS / 32u;

var<workgroup> tally: array<atomic<u32>, DIGITS>;
// Digit by digit: which lanes have it.
var<workgroup> lanes: array<atomic<u32>, DIGITS * LANE_WORDS>;

fn block_count() -> u32 {
    return (pair_count[0] + SORT_BLOCK - 1u) / SORT_BLOCK;
}

fn digit_of(pair: vec2<u32>) -> u32 {
    return (pair.x >> digit.shift) & (DIGITS - 1u);
}

@compute @workgroup_size(256)
fn count_digits(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let blocks = block_count();
    if group.x >= blocks {
        return;
    }
    let end = min((group.x + 1u) * SORT_BLOCK, pair_count[0]);
    for (var i = group.x * SORT_BLOCK + lane; i < end; i += DIGITS) {
        atomicAdd(&tally[digit_of(unsorted[i])], 1u);
    }
    workgroupBarrier();
    counts[lane * blocks + group.x] = atomicLoad(&tally[lane]);
}

@compute @workgroup_size(256)
fn scan_digits(@builtin(local_invocation_index) lane: u32) {
    let blocks = block_count();
    var sum = 0u;
    for (var block = 0u; block < blocks; block++) {
        sum += counts[lane * blocks + block];
    }
    var place = exclusive_scan(sum, lane);
    for (var block = 0u; block < blocks; block++) {
        let count = counts[lane * blocks + block];
        counts[lane * blocks + block] = place;
        place += count;
    }
}

// How many of the first so many lanes have the digit.
fn lanes_below(own: u32, end: u32) -> u32 {
    var count = 0u;
    for (var word = 0u; word < LANE_WORDS; word++) {
        let inside = min(max(end, word * 32u) - word * 32u, 32u);
        let mask = select((1u << (inside % 32u)) - 1u, ~0u, inside == 32u);
        count += countOneBits(atomicLoad(&lanes[own * LANE_WORDS + word]) & mask);
    }
    return count;
}

fn clear_lanes(digit: u32) {
    for (var word = 0u; word < LANE_WORDS; word++) {
        atomicStore(&lanes[digit * LANE_WORDS + word], 0u);
    }
}

@compute @workgroup_size(256)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let blocks = block_count();
    if group.x >= blocks {
        return;
    }
    atomicStore(&tally[lane], counts[lane * blocks + group.x]);
    let end = min((group.x + 1u) * SORT_BLOCK, pair_count[0]);
    for (var first = group.x * SORT_BLOCK; first < end; first += DIGITS) {
        clear_lanes(lane);
        workgroupBarrier();
        let i = first + lane;
        let is_pair = i < end;
        var pair = vec2<u32>(0u);
        if is_pair {
            pair = unsorted[i];
            atomicOr(&lanes[digit_of(pair) * LANE_WORDS + lane / 32u], 1u << (lane % 32u));
        }
        workgroupBarrier();
        if is_pair {
            let own = digit_of(pair);
            sorted[atomicLoad(&tally[own]) + lanes_below(own, lane)] = pair;
        }
        workgroupBarrier();
        atomicAdd(&tally[lane], lanes_below(lane, DIGITS));
        workgroupBarrier();
    }
}
