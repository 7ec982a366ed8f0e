// From paths to the list of virtual lights: as many whole paths as it holds, in sixteen subsets of which each has its share
// of every bounce. A subset takes, of each bounce, a run of consecutive paths: a run of the sequence is spread over all lights
// and directions as well as the whole is.
//
// Cost: one workgroup; every path is read once a bounce.

#import bevy_bounce::shared::grid::{Grid, COUNTER_AREA}
#import bevy_bounce::vpl::types::{Vpl, VplParameters, VplHeader, SUBSETS}
#import bevy_bounce::shared::sampling::PI

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertices: array<Vpl>;
@group(0) @binding(3) var<storage, read> lengths: array<u32>;
@group(0) @binding(4) var<storage, read> counters: array<u32>;
@group(0) @binding(5) var<storage, read_write> header: VplHeader;
@group(0) @binding(6) var<storage, read_write> vpls: array<Vpl>;

const GROUP: u32 = 256u;
// Bounces 0 to 32.
const LEVELS: u32 = 33u;

var<workgroup> scratch: array<u32, 256>;
var<workgroup> level_count: array<atomic<u32>, 33>;
var<workgroup> last_kept: atomic<u32>;
var<workgroup> kept_paths: u32;

fn inclusive_scan(value: u32, lane: u32) -> u32 {
    scratch[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < GROUP; step <<= 1u) {
        let lower = select(0u, scratch[max(lane, step) - step], lane >= step);
        workgroupBarrier();
        scratch[lane] += lower;
        workgroupBarrier();
    }
    return scratch[lane];
}

// Bounce of the first vertex of a path.
fn first_bounce(length: u32) -> u32 {
    return select(1u, 0u, (length >> 16u) != 0u);
}

// Whether the path has a vertex of that bounce.
fn reaches(length: u32, bounce: u32) -> bool {
    let first = first_bounce(length);
    return bounce >= first && bounce - first < (length & 0xffffu);
}

// Of `count` lights in a row, how many come before subset `subset`.
fn before_subset(count: u32, subset: u32) -> u32 {
    return (count * subset + (SUBSETS - 1u)) / SUBSETS;
}

fn path_length(path: u32) -> u32 {
    if path < parameters.path_count {
        return lengths[path];
    }
    return 0u;
}

// Keeps paths, in order, while the list holds them whole.
fn keep_paths(lane: u32) {
    var before = 0u;
    for (var base = 0u; base < parameters.path_count; base += GROUP) {
        let path = base + lane;
        let sum = before + inclusive_scan(path_length(path) & 0xffffu, lane);
        if path < parameters.path_count && sum <= parameters.capacity {
            atomicMax(&last_kept, path + 1u);
        }
        before += scratch[GROUP - 1u];
        workgroupBarrier();
    }
}

fn count_levels(lane: u32, paths: u32) {
    for (var path = lane; path < paths; path += GROUP) {
        let length = lengths[path];
        let first = first_bounce(length);
        for (var i = 0u; i < (length & 0xffffu); i++) {
            atomicAdd(&level_count[min(first + i, LEVELS - 1u)], 1u);
        }
    }
}

// Largest geometry term: a light stands for its share of all surfaces, and no share can light more than one that fills the
// whole hemisphere.
fn geometry_bound(count: u32) -> f32 {
    let area = f32(counters[COUNTER_AREA]) / 256.0 * grid.voxel_size * grid.voxel_size;
    return PI * f32(count) / max(area, 1e-12);
}

fn write_header(paths: u32) {
    var total = 0u;
    for (var subset = 0u; subset <= SUBSETS; subset++) {
        var start = 0u;
        for (var bounce = 0u; bounce < LEVELS; bounce++) {
            start += before_subset(atomicLoad(&level_count[bounce]), subset);
        }
        header.subset_start[subset] = start;
        total = start;
    }
    header.count = total;
    header.path_count = paths;
    header.geometry_bound = geometry_bound(total);
}

// Place in the list of the light of that rank among those of its bounce.
fn place(bounce: u32, rank: u32) -> u32 {
    let subset = rank * SUBSETS / atomicLoad(&level_count[bounce]);
    var slot = rank - before_subset(atomicLoad(&level_count[bounce]), subset);
    for (var level = 0u; level < LEVELS; level++) {
        let count = atomicLoad(&level_count[level]);
        slot += before_subset(count, subset);
        if level < bounce {
            slot += before_subset(count, subset + 1u) - before_subset(count, subset);
        }
    }
    return slot;
}

fn write_level(lane: u32, bounce: u32, paths: u32) {
    let flux_scale = 1.0 / f32(max(paths, 1u));
    var before = 0u;
    for (var base = 0u; base < paths; base += GROUP) {
        let path = base + lane;
        var present = 0u;
        var length = 0u;
        if path < paths {
            length = lengths[path];
            present = select(0u, 1u, reaches(length, bounce));
        }
        let rank = before + inclusive_scan(present, lane) - present;
        if present == 1u {
            let slot = path * (parameters.max_bounces + 1u) + bounce - first_bounce(length);
            var vpl = vertices[slot];
            vpl.flux *= flux_scale;
            vpls[place(bounce, rank)] = vpl;
        }
        before += scratch[GROUP - 1u];
        workgroupBarrier();
    }
}

@compute @workgroup_size(256)
fn build_list(@builtin(local_invocation_index) lane: u32) {
    keep_paths(lane);
    if lane == 0u {
        kept_paths = atomicLoad(&last_kept);
    }
    let paths = workgroupUniformLoad(&kept_paths);
    count_levels(lane, paths);
    workgroupBarrier();
    if lane == 0u {
        write_header(paths);
    }
    for (var bounce = 0u; bounce <= parameters.max_bounces; bounce++) {
        write_level(lane, bounce, paths);
    }
}
