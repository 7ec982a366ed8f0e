// A cache for each cluster, at the pixel that stands for it best. Rehfeld, Zirr and Dachsbacher 2014, 3.2, "Placing Caches".
//
// The pixel looks as the cluster does on the average, lies out from its surfaces and near the line through the middle of its
// box along that normal: (n_p . n_c + (p - c) . n_c) / (1 + d), with lengths in halves of the box's diagonal, so that the choice does not
// depend on the unit of length. Of equal pixels the one that is first on the screen is taken. A cache that was kept from the last
// frame stays where it is until a pixel is clearly better.
//
// A cache counts by its pixels up to a quarter of a tile, so that one whose cluster comes into a tile or leaves it comes and goes
// by degrees.
//
// The cache lights `reach` times as far as its farthest pixel, and at least across as many tiles.
//
// Cost: a workgroup a cluster; each pixel is read three times.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface}
#import bevy_bounce::radiance_cache::types::{CacheGrid, CacheCounters, RadianceCache, screen_place}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> parameters: CacheGrid;
@group(0) @binding(2) var surface_texture: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> counters: CacheCounters;
@group(0) @binding(4) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> last: array<RadianceCache>;
// As `keep.wgsl` leaves it.
@group(0) @binding(7) var<storage, read> kept: array<u32>;
// One without radius is none.
@group(0) @binding(8) var<storage, read_write> caches: array<RadianceCache>;

const GROUP: u32 = 64u;
const LOWEST: f32 = -3e38;
/// By how much the score of a pixel has to be better than that of a cache that was kept.
const CLEARLY: f32 = 0.5;

var<workgroup> lows: array<vec3<f32>, GROUP>;
var<workgroup> highs: array<vec3<f32>, GROUP>;
var<workgroup> sums: array<vec3<f32>, GROUP>;
var<workgroup> scores: array<f32, GROUP>;
var<workgroup> chosen: array<u32, GROUP>;

struct Middle {
    center: vec3<f32>,
    normal: vec3<f32>,
    // Half the diagonal of the box.
    extent: f32,
}

fn load(pixel: u32) -> Surface {
    let at = vec2<u32>(pixel % parameters.size.x, pixel / parameters.size.x);
    return unpack_surface(textureLoad(surface_texture, at, 0).xy, at, parameters.size, view);
}

fn find_middle(first: u32, end: u32, lane: u32) -> Middle {
    var low = vec3<f32>(3e38);
    var high = vec3<f32>(-3e38);
    var sum = vec3<f32>(0.0);
    for (var i = first + lane; i < end; i += GROUP) {
        let surface = load(pairs[i].y);
        low = min(low, surface.position);
        high = max(high, surface.position);
        sum += surface.normal;
    }
    lows[lane] = low;
    highs[lane] = high;
    sums[lane] = sum;
    workgroupBarrier();
    for (var step = GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            lows[lane] = min(lows[lane], lows[lane + step]);
            highs[lane] = max(highs[lane], highs[lane + step]);
            sums[lane] += sums[lane + step];
        }
        workgroupBarrier();
    }
    var middle: Middle;
    middle.center = 0.5 * (lows[0] + highs[0]);
    middle.extent = 0.5 * distance(lows[0], highs[0]);
    let length = length(sums[0]);
    middle.normal = sums[0] / max(length, 1e-6);
    if length < 1e-3 {
        middle.normal = load(pairs[first].y).normal;
    }
    return middle;
}

// A pixel, or the cache that was kept there.
fn candidate(pixel: u32) -> Surface {
    var surface = load(pixel);
    if kept[pixel] != 0u {
        let cache = last[kept[pixel] - 1u];
        surface.position = cache.position;
        surface.normal = cache.normal;
    }
    return surface;
}

fn score(surface: Surface, middle: Middle) -> f32 {
    let unit = max(middle.extent, 1e-3 * surface.footprint);
    let way = (surface.position - middle.center) / max(unit, 1e-20);
    let out = dot(way, middle.normal);
    let aside = length(way - middle.normal * out);
    return (dot(surface.normal, middle.normal) + out) / (1.0 + aside);
}

fn choose(first: u32, end: u32, middle: Middle, lane: u32) -> u32 {
    var best = LOWEST;
    var pixel = 0xffffffffu;
    for (var i = first + lane; i < end; i += GROUP) {
        let at = pairs[i].y;
        let value = score(candidate(at), middle) + select(0.0, CLEARLY, kept[at] != 0u);
        if value > best || (value == best && at < pixel) {
            best = value;
            pixel = at;
        }
    }
    scores[lane] = best;
    chosen[lane] = pixel;
    workgroupBarrier();
    for (var step = GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            let is_better = scores[lane + step] > scores[lane]
                || (scores[lane + step] == scores[lane] && chosen[lane + step] < chosen[lane]);
            if is_better {
                scores[lane] = scores[lane + step];
                chosen[lane] = chosen[lane + step];
            }
        }
        workgroupBarrier();
    }
    return min(chosen[0], parameters.size.x * parameters.size.y - 1u);
}

fn farthest(first: u32, end: u32, from_here: vec3<f32>, lane: u32) -> f32 {
    var most = 0.0;
    for (var i = first + lane; i < end; i += GROUP) {
        most = max(most, distance(load(pairs[i].y).position, from_here));
    }
    // All have read the scores.
    workgroupBarrier();
    scores[lane] = most;
    workgroupBarrier();
    for (var step = GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            scores[lane] = max(scores[lane], scores[lane + step]);
        }
        workgroupBarrier();
    }
    return scores[0];
}

@compute @workgroup_size(64)
fn place(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let cluster = folded_index(group);
    if cluster >= counters.clusters {
        if lane == 0u && cluster < arrayLength(&caches) {
            caches[cluster].radius = 0.0;
        }
        return;
    }
    let first = starts[cluster];
    let end = starts[cluster + 1u];
    let middle = find_middle(first, end, lane);
    let pixel = choose(first, end, middle, lane);
    let surface = candidate(pixel);
    let extent = farthest(first, end, surface.position, lane);
    if lane == 0u {
        let across = f32(parameters.tile) * surface.footprint;
        let radius = parameters.reach * max(extent, across);
        let screen = screen_place(view.clip_from_world * vec4<f32>(surface.position, 1.0), parameters.size);
        let share = min(f32(end - first) * 4.0 / f32(parameters.tile * parameters.tile), 1.0);
        caches[cluster] = RadianceCache(surface.position, max(radius, 1e-20), surface.normal, share, screen, 0u, 0u);
    }
}
