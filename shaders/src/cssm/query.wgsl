// What is visible: from a texel to a point by the texel's cube map, and from far away by the maps from outside. The same
// operations in the same order as on the CPU (crate bevy_bounce_cssm, `query`, `cube` and `csm`), so that the answers are the
// same; from outside, but for a few in ten thousand where rounding leads to the next direction. Ritschel, Grosch, Kautz and Seidel 2008, 3.2.2.
//
// Points and directions are in the object's space.
//
// Cost: one code, or four where the filter asks for them.

#define_import_path bevy_bounce::cssm::query

#import bevy_bounce::cssm::maps::{map_code, LANES, ROWS}
#import bevy_bounce::cssm::texels::{bake, root, Texel}

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
fn cube_center(texel: Texel) -> vec3<f32> {
    return texel.position + texel.normal * bake.lift;
}

fn face_point(offset: vec3<f32>) -> FacePoint {
    let size = abs(offset);
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    } else if size.y >= size.z {
        axis = 1u;
    }
    let depth = size[axis];
    let across = vec2<f32>(offset[(axis + 1u) % 3u], offset[(axis + 2u) % 3u]);
    let at = (across / depth * 0.5 + 0.5) * f32(bake.depth);
    return FacePoint(2u * axis + select(0u, 1u, offset[axis] < 0.0), at, depth);
}

// The direction through a place on a face; its part along the face's axis has length 1.
fn face_direction(face: u32, at: vec2<f32>) -> vec3<f32> {
    let axis = face / 2u;
    let across = 2.0 * at / f32(bake.depth) - 1.0;
    var direction = vec3<f32>(0.0);
    direction[axis] = select(-1.0, 1.0, face % 2u == 0u);
    direction[(axis + 1u) % 3u] = across.x;
    direction[(axis + 2u) % 3u] = across.y;
    return direction;
}

fn pixel_of(at: vec2<f32>) -> vec2<u32> {
    return min(vec2<u32>(max(at, vec2<f32>(0.0))), vec2<u32>(bake.depth - 1u));
}

// Group within a picture of `side` pixels, and row within the group.
fn group_and_row(pixel: vec2<u32>, side: u32) -> vec2<u32> {
    let square = (pixel.y / SQUARE) * (side / SQUARE) + pixel.x / SQUARE;
    let within = (pixel.y % SQUARE) * SQUARE + pixel.x % SQUARE;
    return vec2<u32>(square * (SQUARE * SQUARE / ROWS) + within / ROWS, within % ROWS);
}

// The code of a cube map at a pixel of a face.
fn cube_code(slot: u32, face: u32, pixel: vec2<u32>) -> u32 {
    let face_groups = bake.depth * bake.depth / ROWS;
    let place = group_and_row(pixel, bake.depth);
    let entry = (slot / LANES) * (6u * face_groups) + face * face_groups + place.x;
    return map_code(entry, 0u, place.y, slot % LANES);
}

fn is_before(depth: f32, code: u32, quantum: f32) -> bool {
    return code == UNBOUNDED || depth <= f32(code) * quantum;
}

fn is_lit(texel: Texel, face: u32, pixel: vec2<u32>, depth: f32) -> bool {
    return is_before(depth, cube_code(texel.slot, face, pixel), bake.quantum);
}

/// Whether nothing of the object stands between a texel and a point of the object, by one pixel.
fn is_visible(texel: Texel, point: vec3<f32>) -> bool {
    let offset = point - cube_center(texel);
    if sum_of_products(offset, texel.normal) <= 0.0 {
        return false;
    }
    let place = face_point(offset);
    return is_lit(texel, place.face, pixel_of(place.at), place.depth);
}

/// Share of a point that is visible: percentage-closer filtering of the four pixels round it. Reeves et al. 1987.
fn filtered_visibility(texel: Texel, point: vec3<f32>) -> f32 {
    let offset = point - cube_center(texel);
    if sum_of_products(offset, texel.normal) <= 0.0 {
        return 0.0;
    }
    let place = face_point(offset);
    let low = floor(place.at - 0.5);
    let part = place.at - 0.5 - low;
    var seen = 0.0;
    for (var corner = 0u; corner < 4u; corner++) {
        let right = vec2<f32>(f32(corner & 1u), f32(corner >> 1u));
        let weights = select(1.0 - part, part, right > vec2<f32>(0.5));
        // A neighbour past the face's edge is found on the next face; rays to the texel's back have no depth of their own.
        let direction = face_direction(place.face, low + right + 0.5);
        var face = place.face;
        var at = place.at;
        var depth = place.depth;
        if sum_of_products(direction, texel.normal) > 0.0 {
            let there = face_point(direction);
            face = there.face;
            at = there.at;
            depth = abs(offset[there.face / 2u]);
        }
        seen += select(0.0, weights.x * weights.y, is_lit(texel, face, pixel_of(at), depth));
    }
    return seen;
}

/// Share of a point that a texel sees, filtered or not.
fn visibility(texel: Texel, point: vec3<f32>, filtered: bool) -> f32 {
    if filtered {
        return filtered_visibility(texel, point);
    }
    return select(0.0, 1.0, is_visible(texel, point));
}

fn octahedral_square(direction: vec3<f32>) -> vec2<f32> {
    let sum = abs(direction.x) + abs(direction.y) + abs(direction.z);
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

/// Whether a point of the object is seen from far away by rays along `direction`, as far as the maps from outside tell.
fn is_seen_from_outside(point: vec3<f32>, direction: vec3<f32>) -> bool {
    if bake.csm_grid == 0u {
        return true;
    }
    let scaled = (octahedral_square(direction) * 0.5 + 0.5) * f32(bake.csm_grid);
    let cell = min(vec2<u32>(max(scaled, vec2<f32>(0.0))), vec2<u32>(bake.csm_grid - 1u));
    let forward = octahedral_direction(vec2<f32>(2u * cell + 1u) / f32(bake.csm_grid) - 1.0);
    let helper = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 0.0, 1.0), abs(forward.z) < 0.9);
    var across = cross_product(helper, forward);
    across /= root(sum_of_products(across, across));
    let up = cross_product(forward, across);
    let offset = point - bake.csm_center;
    let xy = vec2<f32>(sum_of_products(offset, across), sum_of_products(offset, up));
    let pixel = (xy / bake.csm_radius * 0.5 + 0.5) * f32(bake.csm_side);
    if any(pixel < vec2<f32>(0.0)) || any(pixel >= vec2<f32>(f32(bake.csm_side))) {
        return true;
    }
    let block = (cell.y / SQUARE) * (bake.csm_grid / SQUARE) + cell.x / SQUARE;
    let column = cell.x % SQUARE;
    let row = cell.y % SQUARE;
    let lane = row * SQUARE + select(SQUARE - 1u - column, column, row % 2u == 0u);
    let place = group_and_row(vec2<u32>(pixel), bake.csm_side);
    let groups = bake.csm_side * bake.csm_side / ROWS;
    let entry = bake.csm_directory + block * groups + place.x;
    let code = map_code(entry, bake.csm_blocks, place.y, lane);
    let depth = sum_of_products(offset, forward) + bake.csm_radius;
    return is_before(depth, code, bake.csm_quantum);
}
