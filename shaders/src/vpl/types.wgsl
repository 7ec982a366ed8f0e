// What the tracer hands on.

#define_import_path bevy_bounce::vpl::types

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::grid::{Grid, GridLevel, grid_level, to_level}
#import bevy_bounce::shared::hilbert::HILBERT_BITS
#import bevy_bounce::shared::octahedral::{encode_unit_8, decode_unit_8}

struct Vpl {
    position: vec3<f32>,
    // Bounces behind it; `MET` where its light met a surface. While it is unsettled, the cell that was met, or of a triangle the albedo
    // as RGBA8.
    bounce_met: u32,
    normal: vec3<f32>,
    // Of the sequence that its path follows: the same while its light is there.
    sample: u32,
    flux: vec3<f32>,
    // While paths are traced, the light's way there: see `pack_incoming`. In the list, `light_area`.
    incoming: u32,
}

/// Area of the surface that a light of the list stands for, square world units.
fn light_area(vpl: Vpl) -> f32 {
    return bitcast<f32>(vpl.incoming);
}

/// Voxels before and behind the plane of the grid within which the surface may be that a path met in truth; and from where it starts within
/// which it meets triangles. Of the grid that `settle_level` says.
const SETTLE_RANGE: f32 = 1.5;

/// The finest grid that reaches `SETTLE_RANGE` about a world position; else the coarsest.
fn settle_level(grid: Grid, position: vec3<f32>) -> GridLevel {
    var i = 0u;
    while is_within(i, grid.further_count, position.x) {
        let level = grid_level(grid, i);
        let place = to_level(level, position);
        if all(place >= vec3<f32>(SETTLE_RANGE)) && all(place <= vec3<f32>(level.dims) - SETTLE_RANGE) {
            break;
        }
        i++;
    }
    return grid_level(grid, i);
}

/// Direction of the light that is reflected, and how far it had come without meeting anything, voxels.
fn pack_incoming(direction: vec3<f32>, reach: f32) -> u32 {
    return (pack2x16float(vec2<f32>(reach, 0.0)) << 16u) | encode_unit_8(direction);
}

fn incoming_direction(word: u32) -> vec3<f32> {
    return decode_unit_8(word);
}

fn incoming_reach(word: u32) -> f32 {
    return unpack2x16float(word >> 16u).x;
}

/// Bit of [`Vpl::bounce_met`].
const MET: u32 = 0x80000000u;

/// Of the sequence that a path follows, the first dimension of what happens where it is reflected, two a bounce.
const DIMENSION_BOUNCE: u32 = 8u;

/// Places of which a path from a directional light starts at one.
const CANDIDATES: u32 = 8u;

/// What is known of a brick, in words: lights, in fixed point; candidates whose light falls into it; those of them whose light
/// goes on to meet something; area of the groups in it, in `1 / BRICK_AREA_STEPS` voxel faces.
const BRICK_WORDS: u32 = 4u;
const BRICK_LIGHTS: u32 = 0u;
const BRICK_TRIED: u32 = 1u;
const BRICK_ONWARD: u32 = 2u;
const BRICK_AREA: u32 = 3u;
const BRICK_AREA_STEPS: f32 = 65536.0;

/// Fixed point: one light. 65,536 lights fit into a word.
const LIGHT_SHIFT: u32 = 15u;

/// Steps of the error of a node of the tree over the vertices: 32 an octave.
const NODE_STEPS: u32 = 1024u;

const FACINGS: u32 = 6u;

/// Least key of the vertices in one of the nested grids. Keys: grid, facing, index on a Hilbert curve.
fn first_key_of_grid(grid: u32) -> u32 {
    return (grid * FACINGS) << (3u * HILBERT_BITS);
}

struct Path {
    length: u32,
    first_bounce: u32,
    // While it is traced, the bounces that are left to it or `START`, `UNSETTLED` and `ON_TRIANGLE`; then, vertices of the paths before it.
    first: u32,
    // Not of this path: as the i-th, the i-th of those that go on. `NO_PATH` where there are no more.
    alive: u32,
}

/// Bit of `Path::first`: a vertex more is where the grid was met, and not yet set on a surface.
const UNSETTLED: u32 = 0x80000000u;
/// Likewise: it is where a triangle was met.
const ON_TRIANGLE: u32 = 0x40000000u;
/// In place of the bounces that are left to it: it begins.
const START: u32 = 0x20000000u;
const NO_PATH: u32 = 0xffffffffu;
/// In place of the cell of such a vertex, where the grid was not met.
const NO_CELL: u32 = 0xffffffffu;

struct Emitter {
    position: vec3<f32>,
    two_sided: u32,
    edge_b: vec3<f32>,
    cumulative_power: f32,
    edge_c: vec3<f32>,
    padding_a: u32,
    normal: vec3<f32>,
    padding_b: u32,
    flux: vec3<f32>,
    padding_c: u32,
}

struct VplParameters {
    capacity: u32,
    path_count: u32,
    max_bounces: u32,
    bound_scale: f32,
}

struct VplHeader {
    // First light of each subset, and the end of the last.
    subset_start: array<u32, 17>,
    // Paths traced.
    path_count: u32,
    // Largest geometry term where lights lie as densely as on the average, 1/m^2.
    geometry_bound: f32,
    // Lights in the list.
    count: u32,
    // Scale of all bounds.
    bound_scale: f32,
}

/// Where vertex `index` of a path is stored.
fn vertex_slot(parameters: VplParameters, path: u32, index: u32) -> u32 {
    return path * (parameters.max_bounces + 1u) + index;
}

/// Subsets of the lights: a pixel of each 4x4 block is lit by one of them.
const SUBSETS: u32 = 16u;

/// The subset that lights a place, by its last two bits a coordinate, in the order of a Bayer matrix: the two, four or eight subsets
/// from a multiple of their number on light places as far apart as there are, and any 2x2 places have one of each four. Lights
/// that are neighbours are in subsets in a row (`cuts.wgsl`): even the mean over few places has of each neighbourhood about
/// its part. Bayer 1973.
fn subset_at(place: vec2<u32>) -> u32 {
    let high = (place >> vec2<u32>(1u)) & vec2<u32>(1u);
    let low = place & vec2<u32>(1u);
    return high.y | ((high.x ^ high.y) << 1u) | (low.y << 2u) | ((low.x ^ low.y) << 3u);
}

/// The subset of the sky's directions that lights a place: row by row. In the order of that matrix an open floor, at edges of the picture
/// where the mean is over fewer places, has 3.3 % less than it should.
fn sky_subset_at(place: vec2<u32>) -> u32 {
    return (place.y & 3u) * 4u + (place.x & 3u);
}

fn luminance(color: vec3<f32>) -> f32 {
    return dot(color, vec3<f32>(0.2126, 0.7152, 0.0722));
}
