// A light's tile: the nearest surface in each direction of the hemisphere that it lights.
//
// The hemisphere is mapped to a square by the half octahedron (Engelhardt & Dachsbacher 2008; Cigolle et al. 2014): on each of
// its four faces, planes through the light are straight lines. A word a texel, row by row: depth along the texel's direction,
// 14 bits of the far distance; how far what casts may be off its surface, 2 bits; octahedral normal in the light's frame, 2 snorm8.

#define_import_path bevy_bounce::shadow_atlas::tile

#import bevy_bounce::shared::octahedral::{encode_unit_8, decode_unit_8}
#import bevy_bounce::shared::sampling::{any_tangent, hash}
#import bevy_bounce::vpl::types::{Vpl, MET}

/// Texel where nothing is.
const TILE_EMPTY: u32 = 0xffffffffu;
/// Steps of depth.
const DEPTH_STEPS: f32 = 16383.0;

/// Voxels between a light and the plane of its own surface, where that is not coarser than the surface itself.
const OWN_PLANE: f32 = 0.02;
/// Cosine to the light's normal of a surface that it may be on.
const SAME_FACING: f32 = 0.5;

/// Steps of the root of an error.
const ERROR_STEPS: u32 = 3u;

struct AtlasParameters {
    // Edge of a tile, texels.
    tile: u32,
    // Triangles in the list of occluders.
    occluder_count: u32,
    // Distance of depth 1, world units.
    far: f32,
    // Of a point, where maps are made from points: square world units.
    point_area: f32,
    // Largest distance of what casts from the surfaces it stands for, world units.
    error: f32,
}

/// Largest edge of what one workgroup draws of a tile, texels: 9 KiB of its 16 KiB. Whole blocks of 8 x 8 texels, and of 4 x 4.
const PART_EDGE: u32 = 48u;
const PART_TEXELS: u32 = PART_EDGE * PART_EDGE;

// What one workgroup draws of a tile, texels of that: from `low` to before `low + size`.
struct Part {
    low: vec2<u32>,
    size: vec2<u32>,
    // Index that texel (0, 0) of the tile would have in the part: 0 or below.
    origin: i32,
}

/// The part of that index; they are numbered row by row.
fn part_of(tile: u32, index: u32) -> Part {
    let parts = (tile + PART_EDGE - 1u) / PART_EDGE;
    let low = vec2<u32>(index % parts, index / parts) * PART_EDGE;
    let size = min(vec2<u32>(PART_EDGE), tile - low);
    return Part(low, size, -i32(low.y * size.x + low.x));
}

/// Texel of the tile that has that index in the part; row by row.
fn part_texel(part: Part, index: u32) -> vec2<u32> {
    return part.low + vec2<u32>(index % part.size.x, index / part.size.x);
}

/// Index in the part of a texel of the tile.
fn part_index(part: Part, texel: vec2<i32>) -> i32 {
    return part.origin + texel.y * i32(part.size.x) + texel.x;
}

/// What stays that of a light wherever it is in the list: of the vertex of the path that it is.
fn light_name(vpl: Vpl) -> u32 {
    return hash(hash(vpl.sample) ^ (vpl.bounce_met & ~MET));
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

/// Of the middle of a texel, in the frame; length 1.
fn texel_direction(texel: vec2<u32>, tile: u32) -> vec3<f32> {
    return normalize(from_tile((vec2<f32>(texel) + 0.5) / f32(tile)));
}

/// Words of a tile.
fn tile_words(parameters: AtlasParameters) -> u32 {
    return parameters.tile * parameters.tile;
}

/// Where the word of a light's texel is.
fn word_of(parameters: AtlasParameters, light: u32, texel: vec2<u32>) -> u32 {
    return light * tile_words(parameters) + texel.y * parameters.tile + texel.x;
}

/// A surface at a depth in world units, with the [`OccluderChunk::error`] of what casts; of two, the lower word is the nearer.
fn pack_texel(depth: f32, error: u32, normal: vec3<f32>, far: f32) -> u32 {
    return depth_bits(depth / far) | surface_bits(error, normal);
}

/// Of a part of the far distance.
fn depth_bits(share: f32) -> u32 {
    return u32(clamp(share, 0.0, 1.0) * (DEPTH_STEPS - 1.0)) << 18u;
}

fn surface_bits(error: u32, normal: vec3<f32>) -> u32 {
    return (error << 16u) | encode_unit_8(normal);
}

/// World units.
fn texel_depth(texel: u32, far: f32) -> f32 {
    return (f32(texel >> 18u) + 0.5) / (DEPTH_STEPS - 1.0) * far;
}

/// How far what casts may be off its surface, world units, by its [`OccluderChunk::error`].
fn error_of(steps: u32, largest: f32) -> f32 {
    let share = f32(steps) / f32(ERROR_STEPS);
    return share * share * largest;
}

/// World units.
fn texel_error(texel: u32, largest: f32) -> f32 {
    return error_of((texel >> 16u) & 3u, largest);
}

fn texel_normal(texel: u32) -> vec3<f32> {
    return decode_unit_8(texel);
}
