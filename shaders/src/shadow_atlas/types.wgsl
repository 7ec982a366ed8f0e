// What casts shadows.

#define_import_path bevy_bounce::shadow_atlas::types

/// Casts from both sides.
const OCCLUDER_TWO_SIDED: u32 = 1u;
/// Above it, the error of [`OccluderChunk`], 2 bits.
const OCCLUDER_ERROR_SHIFT: u32 = 1u;
/// Above that, of triangles with holes the share of the part of which most is there, 8 bits.
const OCCLUDER_MOST_SHIFT: u32 = 3u;
/// Above that, bits that are the triangle's own, whatever else there is.
const OCCLUDER_NAME_SHIFT: u32 = 11u;

// World space, counter-clockwise as seen from the side that casts; all corners the same where there is nothing.
struct Occluder {
    a: vec3<f32>,
    flags: u32,
    b: vec3<f32>,
    // The baked object that it is part of, or NONE; nothing where no bakes are asked.
    object: u32,
    c: vec3<f32>,
    // How much of each of its 16 parts is there where it has holes: see `masks.wgsl`.
    cover: u32,
}

// Up to 64 triangles of one mesh.
struct OccluderChunk {
    instance: u32,
    // Word of the geometry buffer.
    first_index: u32,
    first_occluder: u32,
    triangle_count: u32,
    // How far the triangles may be off the surface: the root of the share of the largest error, in thirds.
    error: u32,
}

/// Points are in the order of the surfaces; a light takes one of this many subsets, each spread over all of them.
const POINT_SUBSETS: u32 = 4u;
/// Normal of a point that casts nothing.
const POINT_NONE: u32 = 0x80008000u;

// A point of a surface, wherever that goes.
struct SurfacePoint {
    instance: u32,
    // Word of the geometry buffer.
    first_index: u32,
    // Weights of the second and third corner, 2 unorm16.
    barycentric: u32,
}

struct WorldPoint {
    position: vec3<f32>,
    // Octahedral, 2 snorm16, but for their lowest bits: of the second one whether both sides cast, of the first one whether its triangle
    // is wide.
    normal: u32,
}

const POINT_TWO_SIDED: u32 = 1u;
const POINT_WIDE: u32 = 0x10000u;

/// Radius of a disc that covers the area of its point, of the root of that area: many on narrow triangles cover as much as these do.
const EVEN_RADIUS: f32 = 0.564;
/// Radius on a triangle that is wide enough, of the same: the largest circle without a point has 0.97 where triangles are about as wide as
/// high, and along their edges there are points on one side only.
const WIDE_RADIUS: f32 = 1.2;

/// Of the disc that a point is, by the area it stands for, world units.
fn disc_radius(area: f32, is_wide: bool) -> f32 {
    return select(EVEN_RADIUS, WIDE_RADIUS, is_wide) * sqrt(area);
}
