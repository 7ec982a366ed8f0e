// Bounced light at the place of each face: a sum over all virtual lights, with their visibility.
//
// A light stands for the surface around it, of area A: its geometry term is that of a disc of this area,
// cos cos' / (d^2 + A / pi) (exact on the disc's axis), so that none is brighter than that surface however near it is. What bounding takes
// from pixels, compensation in screen space gives back; for probes there is none, and this takes hardly any.
//
// Cost: a thread a face, about 35 operations a light; besides a ray, or the lookup of a depth, for those that face each other.

#import bevy_bounce::interleaved::gather::{header, vpls, is_visible}
#import bevy_bounce::interleaved::surface::Surface
#import bevy_bounce::probes::types::{ProbeParameters, ProbePlace, PROBE_FACES, PLACE_SURFACE, probe_count, place_kind}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::decode_unit_8
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::bound::geometry_bound

@group(0) @binding(0) var<uniform> parameters: ProbeParameters;
@group(0) @binding(1) var<storage, read> places: array<ProbePlace>;
// Irradiance over pi, cd/m^2.
@group(0) @binding(4) var<storage, read_write> light: array<vec4<f32>>;

@compute @workgroup_size(64)
fn gather_probes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    if entry >= probe_count(parameters) * PROBE_FACES {
        return;
    }
    let place = places[entry];
    let on_surface = place_kind(place) == PLACE_SURFACE;
    var surface: Surface;
    surface.position = place.position;
    surface.normal = decode_unit_8(place.word);
    surface.valid = true;
    let normal = surface.normal;
    // Where lights are sparser than on the average, and in the air, their density says nothing of the area they stand for.
    let bound = max(header.geometry_bound, geometry_bound(header, place.position));
    let disc = 1.0 / (PI * max(bound, 1e-12));
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < header.count; i++) {
        let vpl = vpls[i];
        let to_vpl = vpl.position - place.position;
        let square = max(dot(to_vpl, to_vpl), 1e-12);
        let direction = to_vpl * inverseSqrt(square);
        let cosines = max(dot(normal, direction), 0.0) * max(-dot(vpl.normal, direction), 0.0);
        if cosines > 0.0 {
            // A point in the air has no surface that could be taken for what hides it.
#ifdef VISIBILITY_VOXEL
            surface.normal = select(vec3<f32>(0.0), normal, on_surface);
#else
            surface.normal = select(direction, normal, on_surface);
#endif
            if is_visible(i, vpl, surface) {
                sum += vpl.flux * (cosines / (square + disc));
            }
        }
    }
    light[entry] = vec4<f32>(sum / (PI * PI), 1.0);
}
