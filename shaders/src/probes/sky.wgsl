// Light straight from the sky, to that of the probes' faces.
//
// Cost: a thread a face, a ray through the grid for each of the sky's directions that it faces.

#import bevy_bounce::interleaved::sky::sky_light
#import bevy_bounce::probes::types::{ProbeParameters, ProbePlace, PROBE_FACES, PLACE_SURFACE, probe_count, place_kind}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::decode_unit_8

@group(0) @binding(0) var<uniform> parameters: ProbeParameters;
@group(0) @binding(1) var<storage, read> places: array<ProbePlace>;
// Irradiance over pi, cd/m^2.
@group(0) @binding(2) var<storage, read_write> light: array<vec4<f32>>;

/// Voxels: a place on a surface is known only as the mean of its voxel.
const GAP: f32 = 0.25;

@compute @workgroup_size(64)
fn add_sky(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    if entry >= probe_count(parameters) * PROBE_FACES {
        return;
    }
    let place = places[entry];
    let normal = decode_unit_8(place.word);
    let on = select(vec3<f32>(0.0), normal, place_kind(place) == PLACE_SURFACE);
    light[entry] += vec4<f32>(sky_light(place.position, normal, on, normal, GAP, 0u, 1u).diffuse, 0.0);
}
