// Where paths start: at lights, which share them by power; those of directional lights in the shadow of the regions.
//
// Cost: a binary search through the lights or the emitters, and a load a region.

#define_import_path bevy_bounce::vpl::starts

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::rays::grid
#import bevy_bounce::shared::sampling::sample_square
#import bevy_bounce::shared::scene::{Light, Scene, Region, projected_area, CHUNK_TRIANGLES}
#import bevy_bounce::vpl::types::{Emitter, VplParameters}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
@group(0) @binding(1) var<uniform> scene: Scene;
@group(0) @binding(2) var<storage, read> lights: array<Light>;
@group(0) @binding(3) var<storage, read> emitters: array<Emitter>;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(4) var<storage, read_write> bricks: array<atomic<u32>>;
// Path by path, the bricks that light from `CANDIDATES` places falls into, counted from 1; 0 where it meets nothing.
@group(0) @binding(5) var<storage, read_write> candidates: array<u32>;

// Dimensions of the sequence.
const DIMENSION_LIGHT: u32 = 0u;
const DIMENSION_POSITION: u32 = 1u;
const DIMENSION_DIRECTION: u32 = 2u;
const DIMENSION_PROMISE: u32 = 3u;
const DIMENSION_CHOICE: u32 = 4u;
const DIMENSION_PATCH: u32 = 5u;

/// Edge of the part of a moving region that the candidates of a path are in.
const PATCH: f32 = 0.25;

// Voxels: a path starts on a plane of the grid, and in a corner another one is near.
const PATH_GAP: f32 = 0.02;

// Each light has a part of the sequence of its own, and so have all emitters and all of the sky: which points of it one uses does not
// depend on what else shines, but for how many.
const PART_BITS: u32 = 20u;
const PARTS: u32 = 1u << (32u - PART_BITS);
const SKY_PART: u32 = PARTS - 1u;
const EMITTER_PART: u32 = PARTS - 2u;

/// What a path starts at: one of the lights, or one of the emitters.
struct Source {
    found: bool,
    is_emitter: bool,
    index: u32,
    // Of the sequence that the path follows.
    sample: u32,
    // Paths for one from this source, if all had as many.
    weight: f32,
}

/// Paths in a row, of the same light or kind.
struct Stretch {
    first: u32,
    count: u32,
    // Each stands for: paths of all for one of these.
    weight: f32,
}

// Without a branch, as `shared/control.wgsl` says.
fn emissive_power() -> f32 {
    let count = scene.emissive_chunk_count;
    return select(0.0, emitters[max(count, 1u) * CHUNK_TRIANGLES - 1u].cumulative_power, count > 0u);
}

// Of all directions of the sky, whose running sum begins anew.
fn sky_power() -> f32 {
    let count = scene.sky_count;
    return select(0.0, lights[max(scene.light_count + count, 1u) - 1u].cumulative_power, count > 0u);
}

fn cumulative_power(is_emitter: bool, index: u32) -> f32 {
    if is_emitter {
        return emitters[index].cumulative_power;
    }
    return lights[index].cumulative_power;
}

// The first of some lights or emitters whose running sum lies beyond `power`; where rounding leaves none, the last.
fn find(is_emitter: bool, power: f32, first: u32, count: u32) -> u32 {
    var low = first;
    var high = first + count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if cumulative_power(is_emitter, middle) > power {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

// One of some lights or emitters in proportion to power, for a path that follows the sequence there.
fn choose(is_emitter: bool, own: Stretch, sample: u32, power: f32, first: u32, count: u32) -> Source {
    let index = find(is_emitter, sample_square(sample, DIMENSION_LIGHT).x * power, first, count);
    var before = 0.0;
    if index > first {
        before = cumulative_power(is_emitter, index - 1u);
    }
    let weight = own.weight * power / max(cumulative_power(is_emitter, index) - before, 1e-30);
    return Source(true, is_emitter, index, sample, weight);
}

// The first path of what follows after sources of that power, of `total`.
fn path_after(power: f32, total: f32) -> u32 {
    return u32(clamp(ceil(power / total * f32(parameters.path_count) - 0.5), 0.0, f32(parameters.path_count)));
}

// Paths of what lies between these running sums. They bring all of its light, however many they are; what has less than one path
// has one in proportion to its power.
fn stretch(before: f32, after: f32, total: f32) -> Stretch {
    let paths = f32(parameters.path_count);
    let first = path_after(before, total);
    let count = path_after(after, total) - first;
    let expected = (after - before) / total * paths;
    return Stretch(first, count, paths / select(max(f32(count), 1.0), max(expected, 1e-30), expected < 1.0));
}

// The light whose paths that one is among.
fn light_of(path: u32, total: f32) -> Source {
    var low = 0u;
    var high = scene.light_count - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if path_after(lights[middle].cumulative_power, total) > path {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    var before = 0.0;
    if low > 0u {
        before = lights[low - 1u].cumulative_power;
    }
    let own = stretch(before, lights[low].cumulative_power, total);
    return Source(true, false, low, sample_of(lights[low].name % EMITTER_PART, path, own), own.weight);
}

fn sample_of(part: u32, path: u32, own: Stretch) -> u32 {
    return (part << PART_BITS) + path - own.first;
}

// Paths are shared out by power, those of one light in a row.
fn source_of(path: u32) -> Source {
    let emissive = emissive_power();
    let sky = sky_power();
    let total = scene.light_power + emissive + sky;
    if total <= 0.0 {
        return Source(false, false, 0u, 0u, 0.0);
    }
    if path < path_after(scene.light_power, total) {
        return light_of(path, total);
    }
    if path < path_after(scene.light_power + emissive, total) {
        let own = stretch(scene.light_power, scene.light_power + emissive, total);
        let sample = sample_of(EMITTER_PART, path, own);
        return choose(true, own, sample, emissive, 0u, scene.emissive_chunk_count * CHUNK_TRIANGLES);
    }
    let own = stretch(scene.light_power + emissive, total, total);
    return choose(false, own, sample_of(SKY_PART, path, own), sky, scene.light_count, scene.sky_count);
}

// Projected areas of the faces of a box that are turned to a light.
fn lit_areas(region: Region, light: Light) -> vec3<f32> {
    let size = region.max - region.min;
    return size.yzx * size.zxy * abs(light.direction);
}

// The same of all regions, each with its weight.
fn weighted_area(light: Light) -> f32 {
    var sum = 0.0;
    for (var i = 0u; is_within(i, scene.region_count, light.direction.x); i++) {
        sum += scene.regions[i].weight * projected_area(scene.regions[i], light.direction);
    }
    return sum;
}

// Sum of the weights of the regions that a line along the light goes through, `through` among them: of their lit areas, times
// this, paths have their starts.
fn start_density(light: Light, point: vec3<f32>, through: u32) -> f32 {
    let tiny = vec3<f32>(1e-6);
    let inverse = 1.0 / select(light.direction, tiny, abs(light.direction) < tiny);
    var density = 0.0;
    for (var i = 0u; is_within(i, scene.region_count, point.x); i++) {
        let a = (scene.regions[i].min - point) * inverse;
        let b = (scene.regions[i].max - point) * inverse;
        let low = min(a, b);
        let high = max(a, b);
        let is_met = max(low.x, max(low.y, low.z)) <= min(high.x, min(high.y, high.z));
        // Rounding may lead past the edge of the one that the line was chosen in.
        density += select(0.0, scene.regions[i].weight, is_met || i == through);
    }
    return density;
}

// The region that a path starts in, chosen in proportion to weight and lit area.
fn choose_region(light: Light, sample: u32) -> u32 {
    var left = sample_square(sample, DIMENSION_CHOICE).y * weighted_area(light);
    for (var i = 0u; is_within(i + 1u, scene.region_count, left); i++) {
        left -= scene.regions[i].weight * projected_area(scene.regions[i], light.direction);
        if left < 0.0 {
            return i;
        }
    }
    return scene.region_count - 1u;
}

// A point on a plane before one of the three faces of a region that are turned to the light, in proportion to their projected
// areas. A region that moves with the camera has its points where they are in the world: those that it leaves behind on one
// side come in on the other. There all candidates of a path are near each other, so that what comes and goes at the region's
// ends changes nothing within.
fn start_on_region(light: Light, index: u32, sample: u32, candidate: u32) -> vec3<f32> {
    let region = scene.regions[index];
    let moves = index + 1u < scene.region_count;
    var square = sample_square(candidate, DIMENSION_POSITION);
    var aside = vec2<f32>(0.0);
    if moves {
        aside = (square - 0.5) * PATCH;
        square = sample_square(sample, DIMENSION_PATCH);
    }
    let size = region.max - region.min;
    let areas = lit_areas(region, light);
    var pick = square.x * (areas.x + areas.y + areas.z);
    var axis = 2u;
    if pick < areas.x {
        axis = 0u;
    } else if pick < areas.x + areas.y {
        axis = 1u;
        pick -= areas.x;
    } else {
        pick -= areas.x + areas.y;
    }
    var place = vec3<f32>(0.0);
    place[axis] = select(0.0, 1.0, light.direction[axis] < 0.0);
    place[(axis + 1u) % 3u] = clamp(pick / max(areas[axis], 1e-30), 0.0, 1.0) + aside.x;
    place[(axis + 2u) % 3u] = square.y + aside.y;
    if moves {
        // Where the lines through the region's corner cross the plane through the world's origin.
        let face = region.min[axis] + place[axis] * size[axis];
        let low = region.min - light.direction * (face / light.direction[axis]);
        let kept = place[axis];
        place = fract(place - low / size);
        place[axis] = kept;
    }
    let point = region.min + place * size;
    return point - light.direction * (way_out(light, point) + grid.voxel_size);
}

// How far it is from a point against the light to the outside of all.
fn way_out(light: Light, point: vec3<f32>) -> f32 {
    let face = select(scene.bounds_min, scene.bounds_max, light.direction < vec3<f32>(0.0));
    let ways = (point - face) / select(light.direction, vec3<f32>(1e-6), abs(light.direction) < vec3<f32>(1e-6));
    let ahead = select(ways, vec3<f32>(1e30), abs(light.direction) < vec3<f32>(1e-6));
    return max(min(ahead.x, min(ahead.y, ahead.z)), 0.0);
}
