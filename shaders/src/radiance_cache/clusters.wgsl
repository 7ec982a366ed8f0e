// Clusters from the sorted keys: boundaries by comparing neighbours, numbers by a prefix sum. Rehfeld, Zirr and Dachsbacher
// 2014, 3.2.
//
// There is room for a number of caches. Leaving out the lowest g bits of all keys merges clusters that are neighbours in the order: first
// slices of depth, then facings. How many clusters are left follows, for every g at once, from the highest bits in which
// neighbours differ; the smallest g that fits is taken.
//
// Cost: one workgroup 1024 pixels, three times a word each; one workgroup over the blocks.

#import bevy_bounce::radiance_cache::types::{CacheGrid, CacheCounters, CLUSTER_SLICE_BITS, CLUSTER_FACING_BITS}
#import bevy_bounce::shared::groups::{folded_index, exclusive_scan, scan_total}

@group(0) @binding(0) var<uniform> parameters: CacheGrid;
// Key, pixel; sorted.
@group(0) @binding(1) var<storage, read> pairs: array<vec2<u32>>;
// As CacheCounters.
@group(0) @binding(2) var<storage, read_write> counters: array<atomic<u32>>;
// One word a block: its clusters, then those of the blocks before it.
@group(0) @binding(3) var<storage, read_write> blocks: array<u32>;
// First pixel in the order of each cluster; after the last, the number of pixels.
@group(0) @binding(4) var<storage, read_write> starts: array<u32>;
// Of each tile, its first cluster and the one after its last.
@group(0) @binding(5) var<storage, read_write> ranges: array<u32>;

const GROUP: u32 = 256u;
const PER_THREAD: u32 = 4u;
const BLOCK: u32 = 1024u;
const BITS: u32 = 32u;
// Words of the counters.
const CLUSTERS: u32 = 0u;
const COARSENESS: u32 = 1u;
const MERGED: u32 = 2u;
const PIXELS: u32 = 3u;
const DIFFERENCES: u32 = 5u;

var<workgroup> tally: array<atomic<u32>, BITS>;

fn pixel_count() -> u32 {
    return parameters.size.x * parameters.size.y;
}

fn tile_of(key: u32) -> u32 {
    return key >> (CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS);
}

// Whether there is a surface.
fn is_lit(i: u32) -> bool {
    return i < pixel_count() && tile_of(pairs[i].x) < parameters.tiles.x * parameters.tiles.y;
}

@compute @workgroup_size(256)
fn count_differences(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let i = folded_index(group) * GROUP + lane;
    if is_lit(i) {
        if i > 0u {
            let differing = pairs[i].x ^ pairs[i - 1u].x;
            if differing != 0u {
                atomicAdd(&tally[firstLeadingBit(differing)], 1u);
            }
        }
        if !is_lit(i + 1u) {
            atomicStore(&counters[PIXELS], i + 1u);
        }
    }
    workgroupBarrier();
    if lane < BITS && atomicLoad(&tally[lane]) > 0u {
        atomicAdd(&counters[DIFFERENCES + lane], atomicLoad(&tally[lane]));
    }
}

@compute @workgroup_size(1)
fn choose_coarseness() {
    if atomicLoad(&counters[PIXELS]) == 0u {
        return;
    }
    var fitting = 1u;
    var all_clusters = 1u;
    var coarseness = BITS - 1u;
    for (var i = 0u; i < BITS - 1u; i++) {
        // Clusters where the bits below this one are left out.
        let bit = BITS - 2u - i;
        all_clusters += atomicLoad(&counters[DIFFERENCES + bit]);
        if all_clusters <= parameters.capacity {
            fitting = all_clusters;
            coarseness = bit;
        }
    }
    atomicStore(&counters[CLUSTERS], fitting);
    atomicStore(&counters[COARSENESS], coarseness);
    atomicStore(&counters[MERGED], all_clusters - fitting);
}

fn starts_cluster(i: u32) -> u32 {
    if !is_lit(i) {
        return 0u;
    }
    if i == 0u {
        return 1u;
    }
    let coarseness = atomicLoad(&counters[COARSENESS]);
    return select(0u, 1u, ((pairs[i].x ^ pairs[i - 1u].x) >> coarseness) != 0u);
}

fn count_four(first: u32) -> u32 {
    return starts_cluster(first) + starts_cluster(first + 1u) + starts_cluster(first + 2u) + starts_cluster(first + 3u);
}

@compute @workgroup_size(256)
fn count_blocks(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = folded_index(group);
    exclusive_scan(count_four(block * BLOCK + lane * PER_THREAD), lane);
    if lane == GROUP - 1u && block < arrayLength(&blocks) {
        blocks[block] = scan_total();
    }
}

@compute @workgroup_size(256)
fn scan_blocks(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&blocks);
    var before = 0u;
    for (var base = 0u; base < count; base += GROUP) {
        let block = base + lane;
        var value = 0u;
        if block < count {
            value = blocks[block];
        }
        let sum = exclusive_scan(value, lane);
        if block < count {
            blocks[block] = before + sum;
        }
        before += scan_total();
        workgroupBarrier();
    }
}

// `cluster`: the one that pixel `i` of the order is in.
fn note(i: u32, cluster: u32, is_first: bool) {
    let tile = tile_of(pairs[i].x);
    if is_first {
        starts[cluster] = i;
    }
    if i == 0u || tile_of(pairs[i - 1u].x) != tile {
        ranges[2u * tile] = cluster;
    }
    let is_last = !is_lit(i + 1u);
    if is_last {
        starts[cluster + 1u] = i + 1u;
    }
    if is_last || tile_of(pairs[i + 1u].x) != tile {
        ranges[2u * tile + 1u] = cluster + 1u;
    }
}

@compute @workgroup_size(256)
fn number_clusters(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let block = folded_index(group);
    let first = block * BLOCK + lane * PER_THREAD;
    let lower = exclusive_scan(count_four(first), lane);
    if block >= arrayLength(&blocks) {
        return;
    }
    var before = blocks[block] + lower;
    for (var i = first; i < first + PER_THREAD && is_lit(i); i++) {
        let is_first = starts_cluster(i) == 1u;
        before += select(0u, 1u, is_first);
        note(i, before - 1u, is_first);
    }
}
