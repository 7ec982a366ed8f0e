// Light that the bounded geometry term takes from a point: the integral of what its surroundings send, weighted by what the
// geometry term has above the bound. Novak et al. 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global
// Illumination with Virtual Point Lights", 3.2 and 4.
//
// Only a lobe over the receiver counts, distance^3 < height / bound. The descent starts at the level of which texels are at
// least as wide as the smallest sphere round that lobe on the screen, so that up to four cover it, and goes on with the
// four below a texel where it fills too large a solid angle, or where an edge runs through it; texels that have nothing above
// the bound anywhere are left out. It needs no stack: the next texel follows from the last.
//
// The geometry term of a texel of area A is that of a disk, cos cos / (d^2 + A / pi): the singularity of small distances
// would come back through the areas otherwise. A pixel next to the receiver that fills too large a solid angle is a polygon:
// see `near.wgsl`. Nothing is taken to lie between.
//
// A texel of a plane is looked at as a disk round its middle, one of an edge as all that may lie between its nearest and its
// farthest depth, whichever way that faces. Both go through the same operations, so that threads in step may differ in them.
//
// Cost: one load and some 250 operations a texel that is looked at; see `near.wgsl` for the pixels next to the receiver.

#define_import_path bevy_bounce::ssbc::integrate

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::interleaved::brightest::BRIGHTEST_PART
#import bevy_bounce::interleaved::surface::{Surface, Lens, relative_lens}
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::ssbc::common::{parameters, surface_texture, sphere_on_screen, Disc}
#import bevy_bounce::ssbc::hierarchy::{decode_range, EDGE, SSBC_LEVELS}
#import bevy_bounce::ssbc::near::near_light
#import bevy_bounce::vpl::bound::geometry_bound
#import bevy_bounce::vpl::types::VplHeader

@group(0) @binding(4) var<storage, read> header: VplHeader;
@group(0) @binding(7) var hierarchy: texture_2d<u32>;

/// Sines of angles below which two surfaces are one plane: what normals of the G-buffer tell no more.
const FLAT: f32 = 0.002;
/// How far a curved surface in a texel may lie off its plane, over the texel's radius.
const BENT: f32 = 0.05;
/// Smallest sphere round the lobe: height of its middle over the receiver, 27^(-1/4), and its radius, sqrt(2) times that;
/// both over 1 / sqrt(bound).
const LOBE_HEIGHT: f32 = 0.43869134;
const LOBE_RADIUS: f32 = 0.62040323;
/// Pixels to each side of the receiver that may be looked at as polygons.
const NEAR: i32 = 2;
/// Projected solid angle above which they are, sr.
const NEAR_SOLID_ANGLE: f32 = 0.08;
/// Of a square of edge 1.
const HALF_DIAGONAL: f32 = 0.70710678;

struct Receiver {
    normal: vec3<f32>,
    pixel: vec2<i32>,
    // By how much what is seen in a texel may be higher over the plane than its middle, over the texel's edge.
    slope: f32,
    // Of the geometry term, 1/m^2.
    bound: f32,
}

struct Visit {
    light: vec3<f32>,
    // Fills too large a solid angle: to be taken apart, or, of a pixel, to be looked at for itself.
    large: bool,
}

const NOTHING: Visit = Visit(vec3<f32>(0.0), false);

// Of a power of two from 1 up.
fn exponent_of(value: f32) -> u32 {
    return (bitcast<u32>(value) >> 23u) - 127u;
}

// On the line of sight through the middle of a texel, relative to the receiver: its nearest point, its farthest, and the one halfway
// between by depth; the edge of a pixel at each.
struct Sight {
    near: vec3<f32>,
    far: vec3<f32>,
    middle: vec3<f32>,
    pixels: vec3<f32>,
}

fn sight_at(lens: Lens, pixel: vec2<f32>, depths: vec2<f32>) -> Sight {
    let sight = lens.origin + lens.x * pixel.x + lens.y * pixel.y;
    let near = sight + lens.depth * depths.x;
    let far = sight + lens.depth * depths.y;
    let middle = 0.5 * (near + far);
    let inverse = 1.0 / vec3<f32>(near.w, far.w, middle.w);
    return Sight(near.xyz * inverse.x, far.xyz * inverse.y, middle.xyz * inverse.z, lens.pixel * abs(inverse));
}

fn visit(lens: Lens, receiver: Receiver, place: Place) -> Visit {
    let scale = f32(place.size);
    let level = exponent_of(scale);
    let words = textureLoad(hierarchy, place.corner >> vec2<u32>(level), i32(level));
    let is_edge = (words.z & EDGE) != 0u;
    let normal = decode_unit(words.y);
    let depths = select(vec2<f32>(bitcast<f32>(words.x)), decode_range(words.x), is_edge);
    let sight = sight_at(lens, vec2<f32>(place.corner) + 0.5 * scale, depths);
    let edges = sight.pixels * scale;
    let area_ratio = unpack2x16float(words.z).x;
    let area = area_ratio * edges.z * edges.z;
    let disk = area * (1.0 / PI);
    let height = dot(receiver.normal, sight.middle);
    let other_height = -dot(normal, sight.middle);
    let square = max(dot(sight.middle, sight.middle), 1e-20);

    // What may be nearest and highest of it.
    let along = sight.far - sight.near;
    let share = clamp(-dot(sight.near, along) / max(dot(along, along), 1e-20), 0.0, 1.0);
    let distance = length(sight.near + along * share);
    let pixel_radius = sight.pixels.z * HALF_DIAGONAL * max(area_ratio, 1.0);
    let radius = pixel_radius * scale;
    // What is seen of a plane may end half a pixel farther on.
    let reach = select(radius + pixel_radius, HALF_DIAGONAL * max(edges.x, edges.y), is_edge);
    let flat = FLAT * select(distance + radius, edges.y, is_edge);
    let slant = dot(receiver.normal, normal);
    let highest_of_plane = height + radius * sqrt(max(1.0 - slant * slant, 0.0));
    let highest_of_edge = max(
        dot(receiver.normal, sight.near) + receiver.slope * edges.x,
        dot(receiver.normal, sight.far) + receiver.slope * edges.y,
    );
    let highest = select(highest_of_plane, highest_of_edge, is_edge);
    // The receiver over the texel: the same for all points of a plane, as far as that is one. An edge may turn to it.
    let other_highest_of_plane = other_height + flat + select(0.0, BENT * radius, place.size > 1);
    let nearest = max(distance - reach, select(other_highest_of_plane, 1e-9, is_edge));
    let other_highest = select(other_highest_of_plane, nearest, is_edge);
    let nearest_square = nearest * nearest;
    if words.z == 0u || highest <= flat || other_highest <= 0.0
        || highest * other_highest <= receiver.bound * nearest_square * nearest_square {
        return NOTHING;
    }

    // Seen from its middle alone, a plane that reaches over the receiver or down to its feet would look small.
    let touches = distance - reach <= other_highest;
    let between_plane = select(max(distance - 0.5 * radius, other_highest), nearest, touches);
    let between = max(select(between_plane, distance, is_edge), 1e-10);
    let between_square = between * between;
    // Of an edge only the receiver's cosine is known: where it is highest, over how near it is.
    let cosines = select(highest * other_highest, min(highest * between, between_square), is_edge);
    let limit_of_plane = select(min(parameters.solid_angle, NEAR_SOLID_ANGLE), parameters.solid_angle, place.size > 1);
    // Not selected: compilers would make it one load, from an address that each thread computes.
    let limit = mix(limit_of_plane, parameters.edge_solid_angle, select(0.0, 1.0, is_edge));
    let large = area * cosines > limit * between_square * (between_square + disk);
    let term = max(height, 0.0) * max(other_height, 0.0) / (square * (square + disk));
    return Visit(rgb9e5_to_vec3_(words.w) * (area * max(term - receiver.bound, 0.0)), large);
}

struct Found {
    // Irradiance.
    light: vec3<f32>,
    // Bits of the pixels round the receiver that are still to be looked at.
    near: u32,
}

// Bit of a pixel next to the receiver; 0 for others.
fn near_bit(from_receiver: vec2<i32>) -> u32 {
    let place = from_receiver + NEAR;
    let bit = 1u << u32(place.y * (2 * NEAR + 1) + place.x);
    return select(0u, bit, all(place >= vec2<i32>(0)) && all(place <= vec2<i32>(2 * NEAR)));
}

// A texel on the way through the levels, in pixels: its first, and how many it has a side.
struct Place {
    corner: vec2<i32>,
    size: i32,
}

// Texels from which the descent starts, row by row: the first, where the last of a row lies, and the first row of pixels behind them,
// 0 where there are none.
struct Roots {
    first: Place,
    last_x: i32,
    end_y: i32,
}

fn roots_of(disc: Disc) -> Roots {
    let level = u32(clamp(ceil(log2(2.0 * max(disc.radius.x, disc.radius.y))), 0.0, f32(SSBC_LEVELS)));
    let last_pixel = vec2<f32>(textureDimensions(surface_texture)) - 1.0;
    let size = 1i << level;
    let low = vec2<i32>(max(disc.middle - disc.radius, vec2<f32>(0.0))) & vec2<i32>(-size);
    let high = vec2<i32>(clamp(disc.middle + disc.radius, vec2<f32>(0.0), last_pixel)) & vec2<i32>(-size);
    return Roots(Place(low, size), high.x, select(high.y + size, 0, low.x > high.x));
}

// Whether any of a texel is in a disc on the screen.
fn is_within(place: Place, disc: Disc) -> bool {
    let half_edge = 0.5 * f32(place.size);
    let middle = vec2<f32>(place.corner) + half_edge;
    let away = max(abs(middle - disc.middle) - half_edge, vec2<f32>(0.0)) * disc.inverse_radius;
    return dot(away, away) < 1.0;
}

// What comes after a texel and all below it: up from the last of each four, then the next of four or the next root.
fn after(place: Place, roots: Roots) -> Place {
    // It is the last of its four where both bits of its size are set, and so on: up to the first bit that is not.
    let passed = (place.corner.x & place.corner.y) | (place.size - 1);
    let size = min(~passed & (passed + 1), roots.first.size);
    let corner = place.corner & vec2<i32>(-size);
    let is_root = size == roots.first.size;
    let is_last = select((corner.x & size) != 0, corner.x >= roots.last_x, is_root);
    let start = select(corner.x - size, roots.first.corner.x, is_root);
    return Place(select(corner + vec2<i32>(size, 0), vec2<i32>(start, corner.y + size), is_last), size);
}

// What is in the disc. A visit is dear, and stands outside of the loop that looks for the next texel, so that threads in step come to it
// together, whatever root they are below.
fn descend(lens: Lens, receiver: Receiver, disc: Disc, roots: Roots) -> Found {
    var found = Found(vec3<f32>(0.0), 0u);
    var place = roots.first;
    loop {
        while place.corner.y < roots.end_y && !is_within(place, disc) {
            place = after(place, roots);
        }
        if place.corner.y >= roots.end_y {
            break;
        }
        let visited = visit(lens, receiver, place);
        if visited.large && place.size > 1 {
            place.size >>= 1u;
        } else {
            let bit = select(0u, near_bit(place.corner - receiver.pixel), visited.large);
            found.near |= bit;
            found.light += select(visited.light, vec3<f32>(0.0), bit != 0u);
            place = after(place, roots);
        }
    }
    return found;
}

/// Irradiance over pi that the bound took from a pixel's surface.
fn residual_light(lens: Lens, surface: Surface, pixel: vec2<u32>) -> vec3<f32> {
    let bound = geometry_bound(header, surface.position);
    if header.count == 0u || bound <= 0.0 {
        return vec3<f32>(0.0);
    }
    let slope = 0.5 * (abs(dot(surface.normal, lens.right)) + abs(dot(surface.normal, lens.down)));
    let receiver = Receiver(surface.normal, vec2<i32>(pixel), slope / lens.pixel, bound);
    let reach = inverseSqrt(bound);
    let disc = sphere_on_screen(surface.position + surface.normal * (LOBE_HEIGHT * reach), LOBE_RADIUS * reach);
    let found = descend(relative_lens(lens, surface.position), receiver, disc, roots_of(disc));
    var light = found.light;
    var near = found.near;
    while near != 0u {
        let bit = i32(countTrailingZeros(near));
        near &= near - 1u;
        let other = receiver.pixel + vec2<i32>(bit % (2 * NEAR + 1), bit / (2 * NEAR + 1)) - NEAR;
        let radiance = rgb9e5_to_vec3_(textureLoad(hierarchy, other, 0).w);
        light += radiance * near_light(lens, surface, bound, other);
    }
    return clamp(light / PI, vec3<f32>(0.0), vec3<f32>(BRIGHTEST_PART));
}
