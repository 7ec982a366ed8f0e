// Light that the bounded geometry term takes from a point: the integral of what its surroundings send, weighted by what the
// geometry term has above the bound. Novak et al. 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global
// Illumination with Virtual Point Lights", 3.2 and 4.
//
// Only a lobe over the receiver counts, distance^3 < height / bound. The descent starts at the level of which texels are at
// least as wide as the smallest sphere round that lobe on the screen, so that up to four cover it, and goes on with the
// four below a texel where it fills too large a solid angle, or where an edge runs through it; texels that have nothing above
// the bound anywhere are left out. Its stack is a word: four bits a level.
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
    let scale = f32(1u << place.level);
    let words = textureLoad(hierarchy, place.corner >> vec2<u32>(place.level), i32(place.level));
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
    let other_highest_of_plane = other_height + flat + select(0.0, BENT * radius, place.level > 0u);
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
    let limit_of_plane = select(min(parameters.solid_angle, NEAR_SOLID_ANGLE), parameters.solid_angle, place.level > 0u);
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

// A texel: its first pixel, and its level.
struct Place {
    corner: vec2<i32>,
    level: u32,
}

// Texels from which the descent starts, in blocks of 2x2, row by row: their level, where the first is, and where the picture or the disc
// ends, pixels; 0 where they have nothing in common.
struct Roots {
    level: u32,
    low: vec2<i32>,
    end: vec2<i32>,
}

fn roots_of(disc: Disc) -> Roots {
    let level = u32(clamp(ceil(log2(2.0 * max(disc.radius.x, disc.radius.y))), 0.0, f32(SSBC_LEVELS)));
    let size = vec2<f32>(textureDimensions(surface_texture));
    let low = vec2<i32>(max(disc.middle - disc.radius, vec2<f32>(0.0))) & vec2<i32>(-(1i << level));
    let end = vec2<i32>(ceil(clamp(disc.middle + disc.radius, vec2<f32>(0.0), size)));
    return Roots(level, low, select(end, vec2<i32>(0), any(low >= end)));
}

// Of four texels of a level, row by row, from the one at a corner on: bits of those that have any of a disc.
fn four_within(corner: vec2<i32>, level: u32, disc: Disc) -> u32 {
    let edge = f32(1u << level);
    let middle = vec2<f32>(corner) + 0.5 * edge - disc.middle;
    let first = max(abs(middle) - 0.5 * edge, vec2<f32>(0.0)) * disc.inverse_radius;
    let second = max(abs(middle + edge) - 0.5 * edge, vec2<f32>(0.0)) * disc.inverse_radius;
    let away = vec4<f32>(first.x, second.x, first.x, second.x);
    let down = vec4<f32>(first.yy, second.yy);
    let bits = select(vec4<u32>(0u), vec4<u32>(1u, 2u, 4u, 8u), away * away + down * down < vec4<f32>(1.0));
    return (bits.x | bits.y) | (bits.z | bits.w);
}

// The way through a block.
struct Walk {
    // Its first pixel.
    block: vec2<i32>,
    // That of the last texel, from there on.
    corner: vec2<i32>,
    // What is still to be visited: four bits a level, from the pixels up, for those below the last texel that was taken apart above.
    pending: u32,
}

fn walk_of(block: vec2<i32>, roots: Roots, disc: Disc) -> Walk {
    // Beyond the end there are no texels.
    let second = block + (1i << roots.level) < roots.end;
    let inside = select(5u, 15u, second.x) & select(3u, 15u, second.y);
    return Walk(block, vec2<i32>(0), (four_within(block, roots.level, disc) & inside) << (4u * roots.level));
}

// The block after another.
fn block_after(block: vec2<i32>, roots: Roots) -> vec2<i32> {
    let size = 2i << roots.level;
    let beside = block.x + size;
    return select(vec2<i32>(roots.low.x, block.y + size), vec2<i32>(beside, block.y), beside < roots.end.x);
}

// Of the finest level first: what was taken apart last.
fn next(walk: ptr<function, Walk>) -> Place {
    let bit = firstTrailingBit((*walk).pending);
    (*walk).pending &= (*walk).pending - 1u;
    let level = bit >> 2u;
    let place = vec2<i32>(vec2<u32>(bit & 1u, (bit >> 1u) & 1u) << vec2<u32>(level));
    (*walk).corner = ((*walk).corner & vec2<i32>(-2i << level)) + place;
    return Place((*walk).block + (*walk).corner, level);
}

// The four below a texel.
fn take_apart(walk: ptr<function, Walk>, place: Place, disc: Disc) {
    let below = place.level - 1u;
    (*walk).pending |= four_within(place.corner, below, disc) << (4u * below);
}

// What is in the disc. Finding the next texel takes no loop of its own, in which threads in step would wait for the last of them.
fn descend(lens: Lens, receiver: Receiver, disc: Disc) -> Found {
    let roots = roots_of(disc);
    var found = Found(vec3<f32>(0.0), 0u);
    var block = roots.low;
    while block.y < roots.end.y {
        var walk = walk_of(block, roots, disc);
        while walk.pending != 0u {
            let place = next(&walk);
            let visited = visit(lens, receiver, place);
            if visited.large && place.level > 0u {
                take_apart(&walk, place, disc);
            } else {
                let bit = select(0u, near_bit(place.corner - receiver.pixel), visited.large);
                found.near |= bit;
                found.light += select(visited.light, vec3<f32>(0.0), bit != 0u);
            }
        }
        block = block_after(block, roots);
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
    let found = descend(relative_lens(lens, surface.position), receiver, disc);
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
