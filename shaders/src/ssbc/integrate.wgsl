// Light that the bounded geometry term takes from a point: the integral of what its surroundings send, weighted by what the
// geometry term has above the bound. Novak et al. 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global
// Illumination with Virtual Point Lights", 3.2 and 4.
//
// Only what lies within 1 / sqrt(bound) counts. The descent starts at the level of which up to nine texels cover that on the
// screen, and goes on with the four below a texel where it fills too large a solid angle, or where an edge runs through it;
// texels that have nothing above the bound anywhere are left out. It needs no stack: the next texel follows from the last.
//
// The geometry term of a texel of area A is that of a disk, cos cos / (d^2 + A / pi): the singularity of small distances
// would come back through the areas otherwise. Nothing is taken to lie between.
//
// Cost: one load a texel that is looked at, two a pixel that counts.

#define_import_path bevy_bounce::ssbc::integrate

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_
#import bevy_bounce::interleaved::surface::Surface
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::ssbc::common::{parameters, surface_texture, view_lens, position_at, texel_at, Lens}
#import bevy_bounce::ssbc::hierarchy::{decode_range, EDGE, SSBC_LEVELS}
#import bevy_bounce::vpl::bound::geometry_bound
#import bevy_bounce::vpl::types::VplHeader

@group(0) @binding(4) var<storage, read> header: VplHeader;
@group(0) @binding(7) var radiance_texture: texture_2d<f32>;
@group(0) @binding(8) var hierarchy: texture_2d<u32>;

/// Sines of angles below which two surfaces are one plane: what normals of the G-buffer tell no more.
const FLAT: f32 = 0.002;
/// Of a square of edge 1.
const HALF_DIAGONAL: f32 = 0.70710678;

struct Receiver {
    position: vec3<f32>,
    normal: vec3<f32>,
    // By how much what is seen in a texel may be higher over the plane than its middle, over the texel's edge.
    slope: f32,
    // Of the geometry term, 1/m^2.
    bound: f32,
}

struct Visit {
    light: vec3<f32>,
    refine: bool,
}

const NOTHING: Visit = Visit(vec3<f32>(0.0), false);
const REFINE: Visit = Visit(vec3<f32>(0.0), true);

// What the geometry term has above the bound: heights of each end over the other's plane, square of the distance.
fn residual_term(receiver: Receiver, height: f32, other_height: f32, square: f32, area: f32) -> f32 {
    let cosines = height * other_height / square;
    return max(cosines / (square + area / PI) - receiver.bound, 0.0);
}

fn visit_pixel(lens: Lens, receiver: Receiver, pixel: vec2<i32>) -> Visit {
    if any(pixel >= vec2<i32>(textureDimensions(surface_texture))) {
        return NOTHING;
    }
    let texel = textureLoad(surface_texture, pixel, 0).xy;
    if texel.x == 0u {
        return NOTHING;
    }
    let position = position_at(lens, vec2<f32>(pixel) + 0.5, bitcast<f32>(texel.x));
    let offset = position.xyz - receiver.position;
    let square = dot(offset, offset);
    let height = dot(receiver.normal, offset);
    if height <= 0.0 || square * receiver.bound >= 1.0 {
        return NOTHING;
    }
    let other_height = -dot(decode_unit(texel.y), offset);
    if other_height * height <= square * square * receiver.bound {
        return NOTHING;
    }
    let radiance = textureLoad(radiance_texture, pixel, 0);
    let area = radiance.a * position.w * position.w;
    return Visit(radiance.rgb * (area * residual_term(receiver, height, other_height, square, area)), false);
}

// Radius of a texel whose surface has that area, over its edge.
fn radius_ratio(area_ratio: f32) -> f32 {
    return 0.5 * sqrt(1.0 + area_ratio * area_ratio);
}

fn visit_plane(lens: Lens, receiver: Receiver, texel: vec2<i32>, level: u32, words: vec4<u32>, area_ratio: f32) -> Visit {
    let position = texel_at(lens, texel, level, bitcast<f32>(words.x));
    let normal = decode_unit(words.y);
    let area = area_ratio * position.w * position.w;
    let radius = radius_ratio(area_ratio) * position.w;
    let offset = position.xyz - receiver.position;
    let square = max(dot(offset, offset), 1e-20);
    let distance = sqrt(square);
    let flat = FLAT * (distance + radius);
    // The same for all points of the texel; and the highest of them.
    let other_height = -dot(normal, offset);
    let middle = dot(receiver.normal, offset);
    let height = middle + radius * length(cross(receiver.normal, normal));
    let nearest = max(distance - radius, other_height);
    let nearest_square = nearest * nearest;
    if other_height <= flat || height <= flat
        || height * other_height <= receiver.bound * nearest_square * nearest_square {
        return NOTHING;
    }
    // Seen from its middle alone, a texel that reaches over the receiver would look small.
    let between = max(distance - 0.5 * radius, other_height);
    let between_square = between * between;
    let solid_angle = area * height * other_height / (between_square * (between_square + area / PI));
    if solid_angle > parameters.solid_angle {
        return REFINE;
    }
    let weight = area * residual_term(receiver, max(middle, 0.0), other_height, square, area);
    return Visit(rgb9e5_to_vec3_(words.w) * weight, false);
}

fn visit_edge(lens: Lens, receiver: Receiver, texel: vec2<i32>, level: u32, words: vec4<u32>, area_ratio: f32) -> Visit {
    let range = decode_range(words.x);
    let near = texel_at(lens, texel, level, range.x);
    let far = texel_at(lens, texel, level, range.y);
    let to_near = near.xyz - receiver.position;
    let to_far = far.xyz - receiver.position;
    let along = to_far - to_near;
    let closest = to_near + along * clamp(-dot(to_near, along) / max(dot(along, along), 1e-20), 0.0, 1.0);
    let distance = length(closest);
    let nearest = max(distance - HALF_DIAGONAL * max(near.w, far.w), 0.0);
    let height = max(
        dot(receiver.normal, to_near) + receiver.slope * near.w,
        dot(receiver.normal, to_far) + receiver.slope * far.w,
    );
    if height <= FLAT * far.w || height <= receiver.bound * nearest * nearest * nearest {
        return NOTHING;
    }
    let position = texel_at(lens, texel, level, 0.5 * (range.x + range.y));
    let area = area_ratio * position.w * position.w;
    if area / (distance * distance + area / PI) > parameters.edge_solid_angle {
        return REFINE;
    }
    let offset = position.xyz - receiver.position;
    let other_height = max(-dot(decode_unit(words.y), offset), 0.0);
    let square = max(dot(offset, offset), 1e-20);
    let weight = area * residual_term(receiver, max(dot(receiver.normal, offset), 0.0), other_height, square, area);
    return Visit(rgb9e5_to_vec3_(words.w) * weight, false);
}

fn visit(lens: Lens, receiver: Receiver, texel: vec2<i32>, level: u32) -> Visit {
    if level == 0u {
        return visit_pixel(lens, receiver, texel);
    }
    let words = textureLoad(hierarchy, texel, i32(level) - 1);
    let area_ratio = unpack2x16float(words.z & 0xffffu).x;
    if area_ratio == 0.0 {
        return NOTHING;
    }
    if (words.z & EDGE) == 0u {
        return visit_plane(lens, receiver, texel, level, words, area_ratio);
    }
    return visit_edge(lens, receiver, texel, level, words, area_ratio);
}

// Whether a texel is nearer to a pixel than so many pixels.
fn is_within(texel: vec2<i32>, level: u32, pixel: vec2<u32>, radius: f32) -> bool {
    let half_edge = 0.5 * f32(1u << level);
    let middle = (vec2<f32>(texel) * 2.0 + 1.0) * half_edge;
    let away = max(abs(middle - vec2<f32>(pixel) - 0.5) - half_edge, vec2<f32>(0.0));
    return dot(away, away) < radius * radius;
}

// Irradiance times pi from what is in a texel and at most so many pixels from the receiver.
fn descend(lens: Lens, receiver: Receiver, pixel: vec2<u32>, radius: f32, root: vec2<i32>, top: u32) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    var texel = root;
    var level = top;
    loop {
        var visited = NOTHING;
        if is_within(texel, level, pixel, radius) {
            visited = visit(lens, receiver, texel, level);
        }
        light += visited.light;
        if visited.refine {
            texel *= 2;
            level--;
            continue;
        }
        // Up from the last of each four, then to the next one.
        let up = min(countTrailingZeros(~u32(texel.x & texel.y)), top - level);
        texel = texel >> vec2<u32>(up);
        level += up;
        if level == top {
            break;
        }
        texel += select(vec2<i32>(-1, 1), vec2<i32>(1, 0), (texel.x & 1) == 0);
    }
    return light;
}

/// Irradiance over pi that the bound took from the surface at a pixel.
fn residual_light(surface: Surface, pixel: vec2<u32>) -> vec3<f32> {
    let bound = geometry_bound(header, surface.position);
    if header.count == 0u || bound <= 0.0 {
        return vec3<f32>(0.0);
    }
    let lens = view_lens();
    let slope = 0.5 * (abs(dot(surface.normal, lens.x.xyz)) + abs(dot(surface.normal, lens.y.xyz)));
    let receiver = Receiver(surface.position, surface.normal, slope / lens.pixel, bound);
    let size = vec2<f32>(textureDimensions(surface_texture));
    let radius = inverseSqrt(bound) / max(surface.footprint, 1e-20);
    let top = u32(clamp(ceil(log2(radius + 0.5)), 0.0, f32(SSBC_LEVELS)));
    let low = vec2<i32>(max(vec2<f32>(pixel) - radius, vec2<f32>(0.0))) >> vec2<u32>(top);
    let high = vec2<i32>(min(vec2<f32>(pixel) + radius, size - 1.0)) >> vec2<u32>(top);
    var light = vec3<f32>(0.0);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            light += descend(lens, receiver, pixel, radius, vec2<i32>(x, y), top);
        }
    }
    return light / PI;
}
