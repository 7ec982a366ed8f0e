// A shadow map for every virtual light. Keller 1997; Bashford-Rogers et al. 2012, III-C.
//
// A workgroup draws a light's tile in its own memory; of tiles above 48 x 48 texels, a part of at most that size. A texel is covered
// by a triangle where its direction lies on the inner side of the three planes through the light and the edges (Olano & Greer 1997):
// exact, straight and without gaps on the octahedron as on any projection, with nothing to clip. A thread projects a triangle and fills
// it if it is small; a large one is filled by eight threads, row by row of its box, eight such triangles at once: each loads it once for
// some rows, where threads that fill a block of texels together would all load it for a texel or two.
//
// With `BAKED` a light that is on a baked object knows from its bake what it sees of that: its tile is there, and the
// object's triangles are left out.
//
// Masked triangles leave texels out where they have holes: see `masks.wgsl`.
//
// Cost: a part and triangle about 200 operations, a texel in the triangle's box about 20; within a triangle a
// comparison, and where that is masked some 60 operations.

#import bevy_bounce::shadow_atlas::masks::{Cover, part_at, is_there}
#import bevy_bounce::shadow_atlas::tile::{
    AtlasParameters, Part, TILE_EMPTY, OWN_PLANE, SAME_FACING, ERROR_STEPS, PART_TEXELS, part_of, part_texel, part_index, light_name,
    tile_frame, to_tile, from_tile, word_of, depth_bits, surface_bits, error_of,
}
#import bevy_bounce::shadow_atlas::types::{
    Occluder, OCCLUDER_TWO_SIDED, OCCLUDER_ERROR_SHIFT, OCCLUDER_MOST_SHIFT, OCCLUDER_NAME_SHIFT,
}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::Grid
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::hash
#import bevy_bounce::shared::scene::NONE
#import bevy_bounce::vpl::types::{Vpl, VplHeader}

@group(0) @binding(0) var<uniform> parameters: AtlasParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> header: VplHeader;
@group(0) @binding(3) var<storage, read> occluders: array<Occluder>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> atlas: array<u32>;
#ifdef BAKED
@group(0) @binding(6) var<storage, read> eyes: array<vec2<u32>>;
#endif

const GROUP: u32 = 64u;
/// Texels in the box of a triangle that one thread fills.
const INLINE_TEXELS: i32 = 8;
/// Threads that fill a large triangle, and triangles that are filled at once: the root of `GROUP`.
const ROWS: u32 = 8u;

// A triangle as a light sees it; a direction d is inside where all edges have dot(edge, d) >= 0, and meets the triangle at
// d / dot(plane, d) far distances.
struct Seen {
    edge_a: vec3<f32>,
    // See `Cover`; nothing where there are no holes.
    most: u32,
    edge_b: vec3<f32>,
    cover: u32,
    edge_c: vec3<f32>,
    // Of triangle and light.
    name: u32,
    plane: vec3<f32>,
    // What of a texel's word is the same all over the triangle.
    surface: u32,
    // First and last texel of the part; none where the last is before the first.
    low: vec2<i32>,
    high: vec2<i32>,
}

// Of the part.
var<workgroup> nearest: array<atomic<u32>, PART_TEXELS>;
// Large triangles: those without holes from the front, those with holes from the back.
var<workgroup> large: array<Seen, GROUP>;
var<workgroup> large_count: atomic<u32>;
var<workgroup> masked_count: atomic<u32>;

struct Box {
    low: vec2<f32>,
    high: vec2<f32>,
}

fn include(box: ptr<function, Box>, direction: vec3<f32>) {
    if direction.z >= 0.0 {
        let place = to_tile(direction);
        (*box).low = min((*box).low, place);
        (*box).high = max((*box).high, place);
    }
}

// Where an edge crosses the planes between the faces of the octahedron, and the horizon.
fn include_crossings(box: ptr<function, Box>, p: vec3<f32>, q: vec3<f32>) {
    for (var axis = 0u; axis < 3u; axis++) {
        if p[axis] * q[axis] < 0.0 {
            var crossing = mix(p, q, p[axis] / (p[axis] - q[axis]));
            crossing[axis] = 0.0;
            include(box, crossing);
        }
    }
}

// Of the corners of the triangle where a direction meets it, but for a factor: parts of the volume with the light.
fn corner_weights(seen: Seen, direction: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(dot(seen.edge_b, direction), dot(seen.edge_c, direction), dot(seen.edge_a, direction));
}

// Without branches: it is asked for every texel of a triangle's box.
fn is_inside(weights: vec3<f32>, along: f32) -> bool {
    return (min(weights.x, min(weights.y, weights.z)) >= 0.0) & (along > 0.0);
}

// The part's texels whose centres lie in the box of what is above the horizon.
fn texel_box(seen: ptr<function, Seen>, part: Part, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) {
    var box = Box(vec2<f32>(2.0), vec2<f32>(-1.0));
    include(&box, a);
    include(&box, b);
    include(&box, c);
    include_crossings(&box, a, b);
    include_crossings(&box, b, c);
    include_crossings(&box, c, a);
    // Corners of the octahedron.
    for (var corner = 0u; corner < 5u; corner++) {
        var direction = vec3<f32>(0.0);
        direction[corner / 2u] = select(1.0, -1.0, (corner & 1u) != 0u);
        if is_inside(corner_weights(*seen, direction), dot((*seen).plane, direction)) {
            include(&box, direction);
        }
    }
    let edge = f32(parameters.tile);
    let first = vec2<i32>(part.low);
    let last = vec2<i32>(part.low + part.size) - 1;
    (*seen).low = max(vec2<i32>(ceil(box.low * edge - 0.501)), first);
    (*seen).high = min(vec2<i32>(floor(box.high * edge - 0.499)), last);
}

fn nothing_seen() -> Seen {
    var seen: Seen;
    seen.high = vec2<i32>(-1);
    return seen;
}

fn project(occluder: Occluder, part: Part, eye: vec3<f32>, frame: mat3x3<f32>, name: u32) -> Seen {
    let a = (occluder.a - eye) * frame;
    let b = (occluder.b - eye) * frame;
    let c = (occluder.c - eye) * frame;
    if max(a.z, max(b.z, c.z)) <= 0.0 {
        return nothing_seen();
    }
    let normal = cross(b - a, c - a);
    let area = length(normal);
    // Six times the volume with the light; negative where it is on the side that casts.
    let volume = dot(a, normal);
    let error = (occluder.flags >> OCCLUDER_ERROR_SHIFT) & ERROR_STEPS;
    let own_plane = max(OWN_PLANE * grid.voxel_size, error_of(error, parameters.error));
    let is_own = abs(volume) <= own_plane * area && abs(normal.z) > SAME_FACING * area;
    if volume == 0.0 || is_own || (volume > 0.0 && (occluder.flags & OCCLUDER_TWO_SIDED) == 0u) {
        return nothing_seen();
    }
    var seen: Seen;
    let side = sign(volume);
    seen.edge_a = cross(a, b) * side;
    seen.edge_b = cross(b, c) * side;
    seen.edge_c = cross(c, a) * side;
    seen.plane = normal * (parameters.far / volume);
    seen.surface = surface_bits(error, normal * (-side / area));
    seen.most = (occluder.flags >> OCCLUDER_MOST_SHIFT) & 255u;
    seen.cover = occluder.cover;
    seen.name = (occluder.flags >> OCCLUDER_NAME_SHIFT) ^ name;
    texel_box(&seen, part, a, b, c);
    return seen;
}

// Whether a triangle has a hole at those weights of its corners, as that texel sees it.
fn is_hole(seen: Seen, weights: vec3<f32>, texel: i32) -> bool {
    let sixteenth = part_at(weights.yz / max(weights.x + weights.y + weights.z, 1e-30));
    return !is_there(Cover(seen.most, seen.cover), sixteenth, hash(hash(seen.name) ^ u32(texel)));
}

// The word of a texel that a triangle covers; empty where it does not.
fn word_at(seen: Seen, x: i32, y: i32, has_holes: bool) -> u32 {
    let direction = from_tile((vec2<f32>(f32(x), f32(y)) + 0.5) * (1.0 / f32(parameters.tile)));
    let weights = corner_weights(seen, direction);
    let along = dot(seen.plane, direction);
    var inside = is_inside(weights, along);
    if has_holes {
        inside = inside && !is_hole(seen, weights, y * i32(parameters.tile) + x);
    }
    return select(TILE_EMPTY, depth_bits(length(direction) / along) | seen.surface, inside);
}

// One row in `step` of its box, beside threads that fill other rows and triangles.
fn fill(seen: Seen, part: Part, first: i32, step: i32, has_holes: bool) {
    for (var y = seen.low.y + first; y <= seen.high.y; y += step) {
        for (var x = seen.low.x; x <= seen.high.x; x++) {
            let word = word_at(seen, x, y, has_holes);
            if word != TILE_EMPTY {
                atomicMin(&nearest[part_index(part, vec2<i32>(x, y))], word);
            }
        }
    }
}

#ifdef BAKED
fn first_word(light: u32, texel: vec2<u32>) -> u32 {
    return atlas[word_of(parameters, light, texel)];
}

fn known_object(light: u32) -> u32 {
    return eyes[light].x;
}
#else
fn first_word(light: u32, texel: vec2<u32>) -> u32 {
    return TILE_EMPTY;
}

fn known_object(light: u32) -> u32 {
    return NONE;
}
#endif

@compute @workgroup_size(64)
fn rasterize(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group);
    if light >= header.count {
        return;
    }
    let vpl = vpls[light];
    let part = part_of(parameters.tile, group.z);
    for (var i = lane; i < part.size.x * part.size.y; i += GROUP) {
        atomicStore(&nearest[i], first_word(light, part_texel(part, i)));
    }
    workgroupBarrier();
    let eye = vpl.position;
    let frame = tile_frame(vpl.normal);
    let known = known_object(light);
    let name = light_name(vpl);

    for (var first = 0u; is_within(first, parameters.occluder_count, f32(light)); first += GROUP) {
        if first + lane < parameters.occluder_count {
            let occluder = occluders[first + lane];
            var seen = nothing_seen();
            if known == NONE || occluder.object != known {
                seen = project(occluder, part, eye, frame, name);
            }
            let size = seen.high - seen.low + 1;
            if size.x > 0 && size.y > 0 {
                if size.x * size.y <= INLINE_TEXELS {
                    fill(seen, part, 0, 1, seen.most != 0u);
                } else {
                    if seen.most == 0u {
                        large[atomicAdd(&large_count, 1u)] = seen;
                    } else {
                        large[GROUP - 1u - atomicAdd(&masked_count, 1u)] = seen;
                    }
                }
            }
        }
        workgroupBarrier();
        let row = i32(lane % ROWS);
        let count = atomicLoad(&large_count);
        for (var k = lane / ROWS; k < count; k += GROUP / ROWS) {
            fill(large[k], part, row, i32(ROWS), false);
        }
        // Apart from the others, so that these do not pay for holes.
        let masked = atomicLoad(&masked_count);
        for (var k = lane / ROWS; k < masked; k += GROUP / ROWS) {
            fill(large[GROUP - 1u - k], part, row, i32(ROWS), true);
        }
        workgroupBarrier();
        if lane == 0u {
            atomicStore(&large_count, 0u);
            atomicStore(&masked_count, 0u);
        }
        workgroupBarrier();
    }

    for (var y = lane / ROWS; y < part.size.y; y += ROWS) {
        for (var x = lane % ROWS; x < part.size.x; x += ROWS) {
            atlas[word_of(parameters, light, part.low + vec2<u32>(x, y))] = atomicLoad(&nearest[y * part.size.x + x]);
        }
    }
}
