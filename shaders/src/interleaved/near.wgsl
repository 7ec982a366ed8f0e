// Bounced light from near virtual lights, at each texel from all of them: what their geometry term has above an eighth of the bound.
// The rest is interleaved (`shade.wgsl`), where a light counts sixteen times at one texel in sixteen: a near one would be a spot there.
//
// A workgroup takes 8x8 texels, of two parts: the surface amid them, and what else they show. It marks the lights near to the box about
// either, 2048 at a time, as in tiled shading (Andersson 2009), and its threads go through the marks of their part, in the same order
// in each run.
//
// Cost: a thread tests a 64th of the lights against one box or two, 15 operations each and 30 more for those that are close, and goes
// through those marked. In the Cornell box at 640x360 and half resolution, with 2048 lights, these are 50 in the mean, and less than 15
// for half of the texels; 4 of them count. See `gather.wgsl` for what one costs. 4.5 KiB of workgroup memory.

#import bevy_render::view::View
#import bevy_bounce::interleaved::brightest::BRIGHTEST_PART
#import bevy_bounce::interleaved::gather::{Band, header, compact_vpls, near_band, geometry_term, is_visible}
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface, is_same_surface, texels_shaded, PIXELS_A_TEXEL}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::compact::{CompactVpl, flux_of}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;

const EDGE: u32 = 8u;
const THREADS: u32 = EDGE * EDGE;
const PARTS: u32 = 2u;

// About what texels show, world units.
struct Bounds {
    low: vec3<f32>,
    // Least geometry term of a near light, 1/m^2.
    least: f32,
    high: vec3<f32>,
    // Of normals.
    low_normal: vec3<f32>,
    high_normal: vec3<f32>,
}

const NOTHING: Bounds = Bounds(vec3<f32>(1e10), 1e10, vec3<f32>(-1e10), vec3<f32>(1.0), vec3<f32>(-1.0));

var<workgroup> bounds: array<Bounds, THREADS>;
// Of 2048 lights for each part; a bit of all words stands for 64 of them, one after the other.
var<workgroup> marks: array<array<u32, THREADS>, PARTS>;

fn join(a: Bounds, b: Bounds) -> Bounds {
    return Bounds(
        min(a.low, b.low), min(a.least, b.least), max(a.high, b.high),
        min(a.low_normal, b.low_normal), max(a.high_normal, b.high_normal),
    );
}

// Of eight of the bounds, `step` apart.
fn join_some(first: u32, step: u32) -> Bounds {
    var all = NOTHING;
    for (var i = 0u; i < EDGE; i++) {
        all = join(all, bounds[first + i * step]);
    }
    return all;
}

// Of all threads that take part.
fn join_all(own: Bounds, lane: u32, takes_part: bool) -> Bounds {
    workgroupBarrier();
    var taken = NOTHING;
    if takes_part {
        taken = own;
    }
    bounds[lane] = taken;
    workgroupBarrier();
    if lane < EDGE {
        bounds[lane * EDGE] = join_some(lane * EDGE, 1u);
    }
    workgroupBarrier();
    if lane == 0u {
        bounds[0] = join_some(0u, EDGE);
    }
    workgroupBarrier();
    return bounds[0];
}

// Square of the least distance from there to something within the bounds, square world units.
fn square_to(position: vec3<f32>, tile: Bounds) -> f32 {
    let off = max(max(position - tile.high, tile.low - position), vec3<f32>(0.0));
    return max(dot(off, off), 1e-12);
}

// Whether a light may be near to something within the bounds: by the least distance, and the largest cosines at it.
fn is_near(vpl: CompactVpl, tile: Bounds) -> bool {
    let low = vpl.position - tile.high;
    let high = vpl.position - tile.low;
    let square = square_to(vpl.position, tile);
    let sent = -dot(vpl.normal, select(high, low, vpl.normal > vec3<f32>(0.0)));
    let met = max(max(low * tile.low_normal, low * tile.high_normal), max(high * tile.low_normal, high * tile.high_normal));
    let cosines = clamp(vec2<f32>(sent, met.x + met.y + met.z) * inverseSqrt(square), vec2<f32>(0.0), vec2<f32>(1.0));
    return cosines.x * cosines.y > tile.least * square;
}

// Marks of a thread for lights from there on, one in 64, a bit each: first for those at no larger distance, then for those of them
// that face what is there.
fn mark(tile: Bounds, first: u32) -> u32 {
    var close = 0u;
    let end = select(first, header.count, tile.low.x <= tile.high.x);
    for (var bit = 0u; bit < 32u && first + bit * THREADS < end; bit++) {
        let square = square_to(compact_vpls[first + bit * THREADS].position, tile);
        close |= select(0u, 1u << bit, square * tile.least < 1.0);
    }
    var marked = close;
    for (var left = close; left != 0u; left &= left - 1u) {
        let bit = firstTrailingBit(left);
        marked ^= select(1u << bit, 0u, is_near(compact_vpls[first + bit * THREADS], tile));
    }
    return marked;
}

// Among the marked.
struct Search {
    word: u32,
    // Of its bits, those yet to come.
    left: u32,
    // What was found, and its geometry term; 0 where nothing was left.
    light: u32,
    term: f32,
}

// The next that counts.
fn next(last: Search, first: u32, part: u32, surface: Surface, band: Band) -> Search {
    var search = last;
    search.term = 0.0;
    while search.term <= 0.0 {
        while search.left == 0u && search.word + 1u < THREADS {
            search.word++;
            search.left = marks[part][search.word];
        }
        if search.left == 0u {
            break;
        }
        search.light = first + firstTrailingBit(search.left) * THREADS + search.word;
        search.left &= search.left - 1u;
        search.term = geometry_term(surface, compact_vpls[search.light], band);
    }
    return search;
}

fn surface_at(texel: vec2<u32>) -> Surface {
    let size = textureDimensions(surface_texture);
    let pixel = min(texel, texels_shaded(size) - 1u) * PIXELS_A_TEXEL;
    return unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, size, view);
}

@compute @workgroup_size(8, 8)
fn near(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let surface = surface_at(id.xy);
    let part = select(1u, 0u, is_same_surface(surface_at(group.xy * EDGE + EDGE / 2u), surface));
    let band = near_band(surface);
    let has_near = surface.valid && band.above < band.below;
    var own = NOTHING;
    if has_near {
        own = Bounds(surface.position, band.above, surface.position, surface.normal, surface.normal);
    }
    let amid = join_all(own, lane, part == 0u);
    let beside = join_all(own, lane, part == 1u);
    var light = vec3<f32>(0.0);
    for (var first = 0u; first < header.count; first += 32u * THREADS) {
        let marked = vec2<u32>(mark(amid, first + lane), mark(beside, first + lane));
        workgroupBarrier();
        marks[0][lane] = marked.x;
        marks[1][lane] = marked.y;
        workgroupBarrier();
        // What is dear, seeing, is not in the loop that looks for the next light.
        // At its end where nothing is near.
        var search = Search(THREADS, 0u, 0u, 0.0);
        if has_near {
            search = Search(0u, marks[part][0], 0u, 0.0);
        }
        loop {
            search = next(search, first, part, surface, band);
            if search.term <= 0.0 {
                break;
            }
            let vpl = compact_vpls[search.light];
            if is_visible(search.light, vpl.position, vpl.normal, surface) {
                light += flux_of(vpl) * search.term;
            }
        }
    }
    if all(id.xy < texels_shaded(textureDimensions(surface_texture))) {
        light = select(vec3<f32>(0.0), light / (PI * PI) * view.exposure, surface.valid);
        textureStore(output, id.xy, vec4<f32>(min(light, vec3<f32>(BRIGHTEST_PART)), 1.0));
    }
}
