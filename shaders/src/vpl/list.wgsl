// From paths to the list of virtual lights.
//
// More vertices are traced than the list holds. It takes them with a probability that falls with the cube root of how many
// there are around (in the same brick of the grid), and raises their flux by as much: where light is rare, it comes from more
// and weaker lights than its share of the flux would give it. Selection is systematic, in order of bounce and path: a sum of
// probabilities runs along, and whoever carries it over the next integer is in.
//
// The list has sixteen subsets, each with its share of every bounce. A subset takes, of each bounce, a run of consecutive
// paths: a run of the sequence is spread over all lights and directions as well as the whole is.
//
// Cost: one workgroup; a thread takes consecutive paths, and looks at each three times a bounce.

#import bevy_bounce::shared::grid::{Grid, COUNTER_AREA}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::types::{Vpl, Path, VplParameters, VplHeader, SUBSETS}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> vertices: array<Vpl>;
@group(0) @binding(3) var<storage, read_write> paths: array<Path>;
@group(0) @binding(4) var<storage, read> brick_counts: array<u32>;
@group(0) @binding(5) var<storage, read> counters: array<u32>;
@group(0) @binding(6) var<storage, read_write> header: VplHeader;
@group(0) @binding(7) var<storage, read_write> vpls: array<Vpl>;

const GROUP: u32 = 256u;
// Bounces 0 to 31, a bit each.
const LEVELS: u32 = 32u;

var<workgroup> float_scratch: array<f32, 256>;
var<workgroup> scratch: array<u32, 256>;
// Lights of each bounce, in the list.
var<workgroup> level_count: array<u32, LEVELS>;

// Sum of the values of this lane and lower ones. Hillis & Steele 1986.
fn inclusive_sum(value: f32, lane: u32) -> f32 {
    workgroupBarrier();
    float_scratch[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < GROUP; step <<= 1u) {
        let lower = select(0.0, float_scratch[max(lane, step) - step], lane >= step);
        workgroupBarrier();
        float_scratch[lane] += lower;
        workgroupBarrier();
    }
    return float_scratch[lane];
}

fn inclusive_count(value: u32, lane: u32) -> u32 {
    workgroupBarrier();
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

fn vertex_slot(path: u32, bounce: u32) -> u32 {
    return path * (parameters.max_bounces + 1u) + bounce - paths[path].first_bounce;
}

// Whether the path has a vertex of that bounce.
fn reaches(path: u32, bounce: u32) -> bool {
    let p = paths[path];
    return bounce >= p.first_bounce && bounce - p.first_bounce < p.length;
}

// Probability, but for a factor, that a vertex is taken.
fn vertex_weight(slot: u32) -> f32 {
    return pow(f32(max(brick_counts[vertices[slot].brick], 1u)), -1.0 / 3.0);
}

fn first_path(lane: u32) -> u32 {
    return min(lane * ((parameters.path_count + GROUP - 1u) / GROUP), parameters.path_count);
}

fn total_weight(lane: u32) -> f32 {
    var sum = 0.0;
    for (var path = first_path(lane); path < first_path(lane + 1u); path++) {
        for (var i = 0u; i < paths[path].length; i++) {
            sum += vertex_weight(path * (parameters.max_bounces + 1u) + i);
        }
    }
    inclusive_sum(sum, lane);
    return float_scratch[GROUP - 1u];
}

fn probability(slot: u32, scale: f32) -> f32 {
    return min(vertex_weight(slot) * scale, 1.0);
}

// Marks the vertices of one bounce that are taken; `before` is the sum of probabilities of lower bounces. Returns the sum
// with this one.
fn select_level(lane: u32, bounce: u32, scale: f32, before: f32) -> f32 {
    var sum = 0.0;
    for (var path = first_path(lane); path < first_path(lane + 1u); path++) {
        if reaches(path, bounce) {
            sum += probability(vertex_slot(path, bounce), scale);
        }
    }
    var running = before + inclusive_sum(sum, lane) - sum;
    let after = before + float_scratch[GROUP - 1u];
    var taken = 0u;
    for (var path = first_path(lane); path < first_path(lane + 1u); path++) {
        if reaches(path, bounce) {
            let next = running + probability(vertex_slot(path, bounce), scale);
            if floor(next + 0.5) > floor(running + 0.5) {
                paths[path].selected |= 1u << bounce;
                taken++;
            }
            running = next;
        }
    }
    inclusive_count(taken, lane);
    if lane == 0u {
        level_count[bounce] = scratch[GROUP - 1u];
    }
    return after;
}

// Of `count` lights in a row, how many come before subset `subset`.
fn before_subset(count: u32, subset: u32) -> u32 {
    return (count * subset + (SUBSETS - 1u)) / SUBSETS;
}

// Largest geometry term: a light stands for its share of the surfaces, and lights nothing more than if that filled a whole
// hemisphere, which is pi over the share. Half of all facings are taken to look into the dark, as the far sides of walls do, and
// are not counted: an assumption, not a measurement of the scene.
fn geometry_bound(count: u32) -> f32 {
    let area = f32(counters[COUNTER_AREA]) / 256.0 * grid.voxel_size * grid.voxel_size;
    return 2.0 * PI * f32(count) / max(area, 1e-12);
}

fn write_header() {
    for (var subset = 0u; subset <= SUBSETS; subset++) {
        var start = 0u;
        for (var bounce = 0u; bounce <= parameters.max_bounces; bounce++) {
            start += before_subset(level_count[bounce], subset);
        }
        header.subset_start[subset] = min(start, parameters.capacity);
    }
    header.count = header.subset_start[SUBSETS];
    header.path_count = parameters.path_count;
    header.geometry_bound = geometry_bound(header.count);
}

// Place in the list of the light of that rank among those of its bounce.
fn place(bounce: u32, rank: u32) -> u32 {
    let subset = rank * SUBSETS / level_count[bounce];
    var slot = rank - before_subset(level_count[bounce], subset);
    for (var level = 0u; level <= parameters.max_bounces; level++) {
        let count = level_count[level];
        slot += before_subset(count, subset);
        if level < bounce {
            slot += before_subset(count, subset + 1u) - before_subset(count, subset);
        }
    }
    return slot;
}

fn is_selected(path: u32, bounce: u32) -> bool {
    return (paths[path].selected & (1u << bounce)) != 0u && reaches(path, bounce);
}

fn write_level(lane: u32, bounce: u32, scale: f32) {
    var count = 0u;
    for (var path = first_path(lane); path < first_path(lane + 1u); path++) {
        count += select(0u, 1u, is_selected(path, bounce));
    }
    var rank = inclusive_count(count, lane) - count;
    for (var path = first_path(lane); path < first_path(lane + 1u); path++) {
        if is_selected(path, bounce) {
            let slot = vertex_slot(path, bounce);
            var vpl = vertices[slot];
            vpl.flux /= probability(slot, scale) * f32(parameters.path_count);
            let index = place(bounce, rank);
            if index < parameters.capacity {
                vpls[index] = vpl;
            }
            rank++;
        }
    }
}

@compute @workgroup_size(256)
fn build_list(@builtin(local_invocation_index) lane: u32) {
    // One place is left for what rounding adds.
    let scale = (f32(parameters.capacity) - 1.0) / max(total_weight(lane), 1e-30);
    var before = 0.0;
    for (var bounce = 0u; bounce <= parameters.max_bounces; bounce++) {
        before = select_level(lane, bounce, scale, before);
    }
    workgroupBarrier();
    if lane == 0u {
        write_header();
    }
    for (var bounce = 0u; bounce <= parameters.max_bounces; bounce++) {
        write_level(lane, bounce, scale);
    }
}
