// Bounced light at the place of each face: a sum over all virtual lights, with their visibility.
//
// A light stands for the surface around it: where that is near it is a square of the same area, so that no light is brighter than its
// surface however near it is, and together they are as bright as theirs. What bounding takes from pixels, compensation in screen
// space gives back; for probes there is none.
//
// Cost: a thread a face, about 35 operations a light; besides a ray, or the lookup of a depth, for those that face each other, and
// 250 operations for those that are near.

#import bevy_bounce::interleaved::gather::{header, is_visible}
#import bevy_bounce::interleaved::surface::Surface
#import bevy_bounce::probes::types::{ProbeParameters, ProbePlace, PROBE_FACES, PLACE_SURFACE, probe_count, place_kind}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::decode_unit_8
#import bevy_bounce::shared::polygons::polygon_light
#import bevy_bounce::shared::sampling::{any_tangent, PI}
#import bevy_bounce::vpl::types::{Vpl, light_area}

@group(0) @binding(0) var<uniform> parameters: ProbeParameters;
@group(0) @binding(1) var<storage, read> places: array<ProbePlace>;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
// Irradiance over pi, cd/m^2.
@group(0) @binding(4) var<storage, read_write> light: array<vec4<f32>>;

/// Square of the distance up to which a light is a square, over its area. At that distance a point is as good to a few percent.
const NEAR: f32 = 4.0;

// Geometry term of the square that a light stands for, relative to the place.
fn square_term(vpl: Vpl, to_vpl: vec3<f32>, normal: vec3<f32>) -> f32 {
    let area = light_area(vpl);
    let right = any_tangent(vpl.normal) * (0.5 * sqrt(area));
    let up = cross(vpl.normal, right);
    let corners =
        array<vec3<f32>, 4>(to_vpl - right - up, to_vpl + right - up, to_vpl + right + up, to_vpl - right + up);
    return polygon_light(corners, normal).x / area;
}

// What is visible at a place.
fn sees(place: ProbePlace, normal: vec3<f32>, i: u32, vpl: Vpl, direction: vec3<f32>) -> bool {
    let on_surface = place_kind(place) == PLACE_SURFACE;
    var surface: Surface;
    surface.position = place.position;
    surface.valid = true;
    // A point in the air has no surface that could be taken for what hides it.
#ifdef VISIBILITY_VOXEL
    surface.normal = select(vec3<f32>(0.0), normal, on_surface);
#else
    surface.normal = select(direction, normal, on_surface);
#endif
    return is_visible(i, vpl.position, vpl.normal, surface);
}

@compute @workgroup_size(64)
fn gather_probes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    if entry >= probe_count(parameters) * PROBE_FACES {
        return;
    }
    let place = places[entry];
    let normal = decode_unit_8(place.word);
    var sum = vec3<f32>(0.0);
    // Near lights are dear: threads in step come to theirs together.
    var i = 0u;
    while i < header.count {
        var near = false;
        while i < header.count && !near {
            let vpl = vpls[i];
            let to_vpl = vpl.position - place.position;
            let square = max(dot(to_vpl, to_vpl), 1e-12);
            let direction = to_vpl * inverseSqrt(square);
            let cosines = max(dot(normal, direction), 0.0) * max(-dot(vpl.normal, direction), 0.0);
            if cosines > 0.0 && sees(place, normal, i, vpl, direction) {
                near = square < NEAR * light_area(vpl);
                sum += select(vpl.flux * (cosines / square), vec3<f32>(0.0), near);
            }
            i++;
        }
        if near {
            let vpl = vpls[i - 1u];
            sum += vpl.flux * square_term(vpl, vpl.position - place.position, normal);
        }
    }
    light[entry] = vec4<f32>(sum / (PI * PI), 1.0);
}
