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
// Cost: one load and some 150 operations a texel that is looked at; see `near.wgsl` for the pixels next to the receiver.

#define_import_path bevy_bounce::ssbc::integrate

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::interleaved::brightest::BRIGHTEST_PART
#import bevy_bounce::interleaved::surface::{Surface, Lens}
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
    position: vec3<f32>,
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

// A point on the line of sight through the middle of a texel, relative to the receiver, and the edge of the texel there.
fn point_on(lens: Lens, sight: vec4<f32>, edge: f32, depth: f32, receiver: Receiver) -> vec4<f32> {
    let p = sight + lens.depth * depth;
    let inverse = 1.0 / p.w;
    return vec4<f32>(p.xyz * inverse - receiver.position, edge * abs(inverse));
}

fn visit(lens: Lens, receiver: Receiver, texel: vec2<i32>, level: u32) -> Visit {
    let words = textureLoad(hierarchy, texel, i32(level));
    let area_ratio = unpack2x16float(words.z & 0xffffu).x;
    if area_ratio == 0.0 {
        return NOTHING;
    }
    let is_edge = (words.z & EDGE) != 0u;
    let normal = decode_unit(words.y);
    let depths = select(vec2<f32>(bitcast<f32>(words.x)), decode_range(words.x), is_edge);
    let scale = f32(1u << level);
    let pixel = (vec2<f32>(texel) + 0.5) * scale;
    let sight = lens.origin + lens.x * pixel.x + lens.y * pixel.y;
    let near = point_on(lens, sight, lens.pixel * scale, depths.x, receiver);
    let far = point_on(lens, sight, lens.pixel * scale, depths.y, receiver);
    let middle = point_on(lens, sight, lens.pixel * scale, 0.5 * (depths.x + depths.y), receiver);
    let area = area_ratio * middle.w * middle.w;
    let height = dot(receiver.normal, middle.xyz);
    let other_height = -dot(normal, middle.xyz);
    let square = max(dot(middle.xyz, middle.xyz), 1e-20);

    // What may be nearest and highest of it.
    let along = far.xyz - near.xyz;
    let share = clamp(-dot(near.xyz, along) / max(dot(along, along), 1e-20), 0.0, 1.0);
    let distance = length(near.xyz + along * share);
    let radius = middle.w * HALF_DIAGONAL * max(area_ratio, 1.0);
    // What is seen of a plane may end half a pixel farther on.
    let reach = select(radius + radius / scale, HALF_DIAGONAL * max(near.w, far.w), is_edge);
    let flat = FLAT * select(distance + radius, far.w, is_edge);
    let highest_of_plane = height + radius * length(cross(receiver.normal, normal));
    let highest_of_edge = max(
        dot(receiver.normal, near.xyz) + receiver.slope * near.w,
        dot(receiver.normal, far.xyz) + receiver.slope * far.w,
    );
    let highest = select(highest_of_plane, highest_of_edge, is_edge);
    // The receiver over the texel: the same for all points of a plane, as far as that is one. An edge may turn to it.
    let other_highest_of_plane = other_height + flat + select(0.0, BENT * radius, level > 0u);
    let nearest = max(distance - reach, select(other_highest_of_plane, 1e-9, is_edge));
    let other_highest = select(other_highest_of_plane, nearest, is_edge);
    let nearest_square = nearest * nearest;
    if highest <= flat || other_highest <= 0.0
        || highest * other_highest <= receiver.bound * nearest_square * nearest_square {
        return NOTHING;
    }

    // Seen from its middle alone, a plane that reaches over the receiver or down to its feet would look small.
    let touches = distance - reach <= other_highest;
    let between_plane = select(max(distance - 0.5 * radius, other_highest), nearest, touches);
    let between = select(between_plane, distance, is_edge);
    let between_square = max(between * between, 1e-20);
    // Of an edge only the receiver's cosine is known: where it is highest, over how near it is.
    let cosine = min(highest * inverseSqrt(between_square), 1.0);
    let cosines = select(highest * other_highest, cosine * between_square, is_edge);
    let limit_of_plane = select(min(parameters.solid_angle, NEAR_SOLID_ANGLE), parameters.solid_angle, level > 0u);
    let limit = select(limit_of_plane, parameters.edge_solid_angle, is_edge);
    let large = area * cosines > limit * between_square * (between_square + area / PI);
    let term = max(height, 0.0) * max(other_height, 0.0) / (square * (square + area / PI));
    return Visit(rgb9e5_to_vec3_(words.w) * (area * max(term - receiver.bound, 0.0)), large);
}

// Whether any of a texel is in a disc on the screen.
fn is_within(texel: vec2<i32>, level: u32, disc: Disc) -> bool {
    let half_edge = 0.5 * f32(1u << level);
    let middle = (vec2<f32>(texel) * 2.0 + 1.0) * half_edge;
    let away = max(abs(middle - disc.middle) - half_edge, vec2<f32>(0.0)) / disc.radius;
    return dot(away, away) < 1.0;
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

// A texel on the way through the levels.
struct Place {
    texel: vec2<i32>,
    level: u32,
}

// Texels from which the descent starts, row by row.
struct Roots {
    low: vec2<i32>,
    high: vec2<i32>,
    level: u32,
}

fn roots_of(disc: Disc) -> Roots {
    let level = u32(clamp(ceil(log2(2.0 * max(disc.radius.x, disc.radius.y))), 0.0, f32(SSBC_LEVELS)));
    let last = vec2<f32>(textureDimensions(surface_texture)) - 1.0;
    let low = vec2<i32>(max(disc.middle - disc.radius, vec2<f32>(0.0)));
    let high = vec2<i32>(clamp(disc.middle + disc.radius, vec2<f32>(0.0), last));
    return Roots(low >> vec2<u32>(level), high >> vec2<u32>(level), level);
}

fn is_over(place: Place, roots: Roots) -> bool {
    return place.level == roots.level && (place.texel.y > roots.high.y || roots.low.x > roots.high.x);
}

// What comes after a texel and all below it: up from the last of each four, then the next of four or the next root.
fn after(place: Place, roots: Roots) -> Place {
    let up = min(countTrailingZeros(~u32(place.texel.x & place.texel.y)), roots.level - place.level);
    let texel = place.texel >> vec2<u32>(up);
    let level = place.level + up;
    let sibling = texel + select(vec2<i32>(-1, 1), vec2<i32>(1, 0), (texel.x & 1) == 0);
    let root = select(vec2<i32>(roots.low.x, texel.y + 1), texel + vec2<i32>(1, 0), texel.x < roots.high.x);
    return Place(select(sibling, root, level == roots.level), level);
}

// What is in the disc. A visit is dear, and stands outside of the loop that looks for the next texel, so that threads in step come to it
// together, whatever root they are below.
fn descend(lens: Lens, receiver: Receiver, disc: Disc, roots: Roots) -> Found {
    var found = Found(vec3<f32>(0.0), 0u);
    var place = Place(roots.low, roots.level);
    loop {
        while !is_over(place, roots) && !is_within(place.texel, place.level, disc) {
            place = after(place, roots);
        }
        if is_over(place, roots) {
            break;
        }
        let visited = visit(lens, receiver, place.texel, place.level);
        if visited.large && place.level > 0u {
            place = Place(2 * place.texel, place.level - 1u);
        } else {
            let bit = select(0u, near_bit(place.texel - receiver.pixel), visited.large);
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
    let receiver = Receiver(surface.position, surface.normal, vec2<i32>(pixel), slope / lens.pixel, bound);
    let reach = inverseSqrt(bound);
    let disc = sphere_on_screen(surface.position + surface.normal * (LOBE_HEIGHT * reach), LOBE_RADIUS * reach);
    let found = descend(lens, receiver, disc, roots_of(disc));
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
