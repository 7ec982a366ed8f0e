// What is visible: from a texel to a point by the texel's cube map, and past an object by its maps from outside. The same
// operations in the same order as on the CPU (crate bevy_bounce_cssm, `query`, `cube` and `csm`), so that the answers are the
// same. Ritschel, Grosch, Kautz and Seidel 2008, 3.2.2 and 3.3.
//
// Points and directions are in the object's space where nothing else is said.
//
// Cost: one code, or four where the filter asks for them; one more for points outside the object.

#define_import_path bevy_bounce::cssm::query

#import bevy_bounce::cssm::maps::{map_code, LANES, ROWS}
#import bevy_bounce::cssm::texels::{bakes, root, scale_of, to_object, to_world, turn_to_object, Texel}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::scene::NONE

/// Side of a square of pixels.
const SQUARE: u32 = 8u;
/// The code of a ray that meets nothing.
const UNBOUNDED: u32 = 65535u;

/// A place on a face of the cube.
struct FacePoint {
    face: u32,
    /// Column and row in pixels.
    at: vec2<f32>,
    /// Distance along the face's axis.
    depth: f32,
}

fn sum_of_products(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

/// Centre of a texel's cube map.
fn cube_center(object: u32, texel: Texel) -> vec3<f32> {
    return texel.position + texel.normal * bakes.objects[object].lift;
}

// Where a point is seen that lies at `offset` from the centre, on faces of `side` pixels.
fn face_point(offset: vec3<f32>, side: u32) -> FacePoint {
    let size = abs(offset);
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    } else if size.y >= size.z {
        axis = 1u;
    }
    let depth = size[axis];
    let across = vec2<f32>(offset[(axis + 1u) % 3u], offset[(axis + 2u) % 3u]);
    let at = (across / depth * 0.5 + 0.5) * f32(side);
    return FacePoint(2u * axis + select(0u, 1u, offset[axis] < 0.0), at, depth);
}

// The direction through a place on a face; its part along the face's axis has length 1.
fn face_direction(face: u32, at: vec2<f32>, side: u32) -> vec3<f32> {
    let axis = face / 2u;
    let across = 2.0 * at / f32(side) - 1.0;
    var direction = vec3<f32>(0.0);
    direction[axis] = select(-1.0, 1.0, face % 2u == 0u);
    direction[(axis + 1u) % 3u] = across.x;
    direction[(axis + 2u) % 3u] = across.y;
    return direction;
}

fn pixel_of(at: vec2<f32>, side: u32) -> vec2<u32> {
    return min(vec2<u32>(max(at, vec2<f32>(0.0))), vec2<u32>(side - 1u));
}

// Group within a picture of `side` pixels, and row within the group.
fn group_and_row(pixel: vec2<u32>, side: u32) -> vec2<u32> {
    let square = (pixel.y / SQUARE) * (side / SQUARE) + pixel.x / SQUARE;
    let within = (pixel.y % SQUARE) * SQUARE + pixel.x % SQUARE;
    return vec2<u32>(square * (SQUARE * SQUARE / ROWS) + within / ROWS, within % ROWS);
}

// The code of a cube map at a pixel of a face.
fn cube_code(object: u32, slot: u32, face: u32, pixel: vec2<u32>) -> u32 {
    let bake = &bakes.objects[object];
    let face_groups = (*bake).depth * (*bake).depth / ROWS;
    let place = group_and_row(pixel, (*bake).depth);
    let entry = (slot / LANES) * (6u * face_groups) + face * face_groups + place.x;
    return map_code((*bake).directory + entry, (*bake).blocks, place.y, slot % LANES);
}

fn is_lit(object: u32, texel: Texel, face: u32, pixel: vec2<u32>, depth: f32) -> bool {
    let code = cube_code(object, texel.slot, face, pixel);
    return code == UNBOUNDED || depth <= f32(code) * bakes.objects[object].quantum;
}

/// Share of a point of the object that a texel sees: by one pixel, or, filtered, by the four pixels round it. Percentage-closer
/// filtering: Reeves et al. 1987.
fn visibility(object: u32, texel: Texel, point: vec3<f32>, filtered: bool) -> f32 {
    let offset = point - cube_center(object, texel);
    if sum_of_products(offset, texel.normal) <= 0.0 {
        return 0.0;
    }
    let side = bakes.objects[object].depth;
    let place = face_point(offset, side);
    let low = floor(place.at - 0.5);
    let part = place.at - 0.5 - low;
    var seen = 0.0;
    for (var corner = 0u; corner < select(1u, 4u, filtered); corner++) {
        var face = place.face;
        var at = place.at;
        var depth = place.depth;
        var weight = 1.0;
        if filtered {
            let right = vec2<f32>(f32(corner & 1u), f32(corner >> 1u));
            let weights = select(1.0 - part, part, right > vec2<f32>(0.5));
            weight = weights.x * weights.y;
            // A neighbour past the face's edge is found on the next face; rays to the texel's back have no depth of their own.
            let direction = face_direction(place.face, low + right + 0.5, side);
            if sum_of_products(direction, texel.normal) > 0.0 {
                let there = face_point(direction, side);
                face = there.face;
                at = there.at;
                depth = abs(offset[there.face / 2u]);
            }
        }
        seen += select(0.0, weight, is_lit(object, texel, face, pixel_of(at, side), depth));
    }
    return seen;
}

fn octahedral_square(direction: vec3<f32>) -> vec2<f32> {
    let sum = abs(direction.x) + abs(direction.y) + abs(direction.z);
    if sum == 0.0 {
        return vec2<f32>(0.0);
    }
    let p = direction.xy / sum;
    if direction.z >= 0.0 {
        return p;
    }
    return select(1.0 - abs(p.yx), abs(p.yx) - 1.0, p < vec2<f32>(0.0));
}

fn octahedral_direction(p: vec2<f32>) -> vec3<f32> {
    let z = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-z, 0.0);
    let xy = select(p - fold, p + fold, p < vec2<f32>(0.0));
    let length = root(xy.x * xy.x + xy.y * xy.y + z * z);
    return vec3<f32>(xy.x / length, xy.y / length, z / length);
}

fn cross_product(a: vec3<f32>, b: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

/// In a map from outside: a point's depth, and that of the surface there.
struct OutsideDepth {
    point: f32,
    /// `NOTHING` where there is none, or where the point is not in the map.
    surface: f32,
}

/// Along the direction that is asked for.
const STRAIGHT: vec2<f32> = vec2<f32>(0.0);
/// A depth behind everything.
const NOTHING: f32 = 1e30;

// In the map whose rays run most nearly along `direction`, or one beside it: `aside` is how far to look in cells of the grid of directions.
// The mean over the square of half a cell to all sides is the light of the four maps around, by how near they are.
fn outside_depth(object: u32, point: vec3<f32>, direction: vec3<f32>, aside: vec2<f32>) -> OutsideDepth {
    let bake = &bakes.objects[object];
    let grid = (*bake).csm_grid;
    let side = (*bake).csm_side;
    if grid == 0u {
        return OutsideDepth(0.0, NOTHING);
    }
    let scaled = (octahedral_square(direction) * 0.5 + 0.5) * f32(grid) + aside;
    let cell = min(vec2<u32>(max(scaled, vec2<f32>(0.0))), vec2<u32>(grid - 1u));
    let forward = octahedral_direction(vec2<f32>(2u * cell + 1u) / f32(grid) - 1.0);
    let helper = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 0.0, 1.0), abs(forward.z) < 0.9);
    var across = cross_product(helper, forward);
    across /= root(sum_of_products(across, across));
    let up = cross_product(forward, across);
    let offset = point - (*bake).csm_center;
    let xy = vec2<f32>(sum_of_products(offset, across), sum_of_products(offset, up));
    let pixel = (xy / (*bake).csm_radius * 0.5 + 0.5) * f32(side);
    if any(pixel < vec2<f32>(0.0)) || any(pixel >= vec2<f32>(f32(side))) {
        return OutsideDepth(0.0, NOTHING);
    }
    let block = (cell.y / SQUARE) * (grid / SQUARE) + cell.x / SQUARE;
    let column = cell.x % SQUARE;
    let row = cell.y % SQUARE;
    let lane = row * SQUARE + select(SQUARE - 1u - column, column, row % 2u == 0u);
    let place = group_and_row(vec2<u32>(pixel), side);
    let groups = side * side / ROWS;
    let code = map_code((*bake).csm_directory + block * groups + place.x, (*bake).csm_blocks, place.y, lane);
    let surface = select(f32(code) * (*bake).csm_quantum, NOTHING, code == UNBOUNDED);
    return OutsideDepth(sum_of_products(offset, forward) + (*bake).csm_radius, surface);
}

/// Whether a point is seen from far away by rays along `direction`, as far as the object's maps from outside tell.
fn is_seen_from_outside(object: u32, point: vec3<f32>, direction: vec3<f32>, aside: vec2<f32>) -> bool {
    let depth = outside_depth(object, point, direction, aside);
    return depth.point <= depth.surface;
}

/// Whether the object blocks the way from a point outside its hull to another one, as far as its maps from outside tell.
fn is_blocking(object: u32, start: vec3<f32>, end: vec3<f32>, aside: vec2<f32>) -> bool {
    let bake = &bakes.objects[object];
    let way = end - start;
    let square = sum_of_products(way, way);
    // Where the way is nearest to the centre: there the map's rays, which run a little askew, are off by least.
    let along = clamp(sum_of_products(way, (*bake).csm_center - start) / square, 0.0, 1.0);
    let nearest = start + along * way;
    let offset = nearest - (*bake).csm_center;
    if sum_of_products(offset, offset) >= (*bake).csm_radius * (*bake).csm_radius {
        return false;
    }
    let depth = outside_depth(object, nearest, way, aside);
    let length = root(square);
    let first = depth.point - along * length;
    return first < depth.surface && depth.surface < first + length;
}

/// Whether a point is outside the object's box.
fn is_outside(object: u32, point: vec3<f32>) -> bool {
    let bake = &bakes.objects[object];
    return any(point < (*bake).bounds_min - (*bake).lift) || any(point > (*bake).bounds_max + (*bake).lift);
}

/// Whether a point that is not on the object is within its box or seen by the maps from outside. Where a ray leaves an object
/// through its only surface the cube map leaves open where that is.
fn is_in_open(object: u32, texel: Texel, point: vec3<f32>) -> bool {
    return !is_outside(object, point) || is_seen_from_outside(object, texel.position, texel.position - point, STRAIGHT);
}

/// Share of any point that its own object lets a texel see.
fn sight(object: u32, texel: Texel, point: vec3<f32>, filtered: bool) -> f32 {
    return select(0.0, visibility(object, texel, point, filtered), is_in_open(object, texel, point));
}

/// Whether an object that neither of two places of the world is on stands between them. It is asked from outside its box; what
/// lies between two places within that is not known.
fn is_between(object: u32, a: vec3<f32>, b: vec3<f32>, aside: vec2<f32>) -> bool {
    var start = to_object(object, a);
    var end = to_object(object, b);
    if !is_outside(object, start) {
        if !is_outside(object, end) {
            return false;
        }
        let inside = start;
        start = end;
        end = inside;
    }
    return is_blocking(object, start, end, aside);
}

/// Objects as bits.
struct Objects {
    words: array<u32, 2>,
}

/// The objects that may stand between a place of the world and what is within a sphere: those whose own spheres come as near to the way
/// to its middle as its radius. Two are left out.
fn between_candidates(place: vec3<f32>, center: vec3<f32>, radius: f32, object_a: u32, object_b: u32) -> Objects {
    var candidates: Objects;
    let way = center - place;
    let square = max(dot(way, way), 1e-20);
    for (var object = 0u; is_within(object, bakes.count, place.x); object++) {
        let middle = to_world(object, bakes.objects[object].csm_center);
        let along = clamp(dot(middle - place, way) / square, 0.0, 1.0);
        let reach = radius + scale_of(object) * bakes.objects[object].csm_radius;
        let is_near = distance(middle, place + along * way) < reach;
        if is_near && object != object_a && object != object_b {
            candidates.words[object / 32u] |= 1u << (object % 32u);
        }
    }
    return candidates;
}

/// Takes one of the objects away; `NONE` where none is left.
fn take(objects: ptr<function, Objects>) -> u32 {
    for (var word = 0u; word < 2u; word++) {
        let bits = (*objects).words[word];
        if bits != 0u {
            (*objects).words[word] = bits & (bits - 1u);
            return 32u * word + firstTrailingBit(bits);
        }
    }
    return NONE;
}

/// Whether one of those objects stands between a place of the world and what lies that way.
fn is_shaded(place: vec3<f32>, direction: vec3<f32>, candidates: Objects, aside: vec2<f32>) -> bool {
    var left = candidates;
    for (var object = take(&left); object != NONE; object = take(&left)) {
        let turned = turn_to_object(object, direction);
        if !is_seen_from_outside(object, to_object(object, place), turned, aside) {
            return true;
        }
    }
    return false;
}

/// Whether one of those objects stands between two places of the world.
fn is_hidden(a: vec3<f32>, b: vec3<f32>, candidates: Objects, aside: vec2<f32>) -> bool {
    var left = candidates;
    for (var object = take(&left); object != NONE; object = take(&left)) {
        if is_between(object, a, b, aside) {
            return true;
        }
    }
    return false;
}
