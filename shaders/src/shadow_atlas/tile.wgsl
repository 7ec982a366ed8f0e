// A light's tile: depth over the hemisphere that it lights.
//
// The hemisphere is mapped to a square by the half octahedron (Engelhardt & Dachsbacher 2008; Cigolle et al. 2014): on each of
// its four faces, planes through the light are straight lines. Two depths a word, unorm16 of the far distance, row by row.

#define_import_path bevy_bounce::shadow_atlas::tile

#import bevy_bounce::shared::sampling::any_tangent

/// Depth where nothing is.
const TILE_EMPTY: u32 = 0xffffu;

struct AtlasParameters {
    // Edge of a tile, texels; even.
    tile: u32,
    // Triangles in the list of occluders.
    occluder_count: u32,
    // Distance of depth 1, world units.
    far: f32,
    // Of a point, where maps are made from points: square world units.
    point_area: f32,
}

/// Columns: tangent, bitangent, normal.
fn tile_frame(normal: vec3<f32>) -> mat3x3<f32> {
    let tangent = any_tangent(normal);
    return mat3x3<f32>(tangent, cross(normal, tangent), normal);
}

/// Place in [0, 1]^2 of a direction in the frame, of any length, z >= 0.
fn to_tile(direction: vec3<f32>) -> vec2<f32> {
    let p = direction.xy / max(abs(direction.x) + abs(direction.y) + max(direction.z, 0.0), 1e-30);
    return vec2<f32>(p.x + p.y, p.x - p.y) * 0.5 + 0.5;
}

/// The point of the half octahedron |x| + |y| + z = 1 there.
fn from_tile(place: vec2<f32>) -> vec3<f32> {
    let w = place * 2.0 - 1.0;
    return vec3<f32>(w.x + w.y, w.x - w.y, 2.0 - 2.0 * max(abs(w.x), abs(w.y))) * 0.5;
}

/// Words of a tile.
fn tile_words(parameters: AtlasParameters) -> u32 {
    return parameters.tile * parameters.tile / 2u;
}
