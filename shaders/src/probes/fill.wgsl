// Into the texture that Bevy's shaders read. A face that no light of its own can be told for takes that of the probes around.
//
// The texture has (x, 2y, 3z) texels for (x, y, z) probes: faces along x, y and z behind each other in z, those of positive
// directions first in y. See `irradiance_volume.wgsl` of bevy_pbr.
//
// Cost: a thread a face, seven loads; 53 more where it takes the light of others.

#import bevy_bounce::probes::types::{
    ProbeParameters, ProbePlace, PROBE_FACES, PLACE_BEHIND, PLACE_UNKNOWN, PROBE_MOVED, probe_count, probe_at, probe_index, place_kind, face_normal,
}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> parameters: ProbeParameters;
@group(0) @binding(1) var<storage, read> places: array<ProbePlace>;
@group(0) @binding(2) var<storage, read> light: array<vec4<f32>>;
@group(0) @binding(3) var output: texture_storage_3d<rgba16float, write>;

/// Largest finite half float.
const HALF_MAX: f32 = 65504.0;

// Whether a face has light of its own. Beyond the edges of a room there may be no surface on any of a probe's lines. Then it is
// where its next neighbours are, for nothing is between them: behind what one of them is behind. Beyond its corners the neighbours do not
// know either, but no virtual light sees the probe.
fn is_known(probe: u32, face: u32, count: u32) -> bool {
    let kind = place_kind(places[face * count + probe]);
    if kind != PLACE_UNKNOWN {
        return kind != PLACE_BEHIND;
    }
    let at = vec3<i32>(probe_at(parameters, probe));
    for (var i = 0u; i < 6u; i++) {
        let next = at + vec3<i32>(face_normal(i));
        if all(next >= vec3<i32>(0)) && all(next < vec3<i32>(parameters.dims)) {
            if (places[face * count + probe_index(parameters, vec3<u32>(next))].word & PROBE_MOVED) != 0u {
                return false;
            }
        }
    }
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < PROBE_FACES; i++) {
        sum += light[i * count + probe].rgb;
    }
    return any(sum > vec3<f32>(0.0));
}

// Mean of the known light of a face over the 26 probes around, by the square of their nearness.
fn light_around(probe: vec3<u32>, face: u32, count: u32) -> vec3<f32> {
    var sum = vec4<f32>(0.0);
    for (var i = 0u; i < 27u; i++) {
        let step = vec3<i32>(vec3<u32>(i % 3u, (i / 3u) % 3u, i / 9u)) - 1;
        let other = vec3<i32>(probe) + step;
        if i == 13u || any(other < vec3<i32>(0)) || any(other >= vec3<i32>(parameters.dims)) {
            continue;
        }
        let index = probe_index(parameters, vec3<u32>(other));
        if is_known(index, face, count) {
            let square = f32(dot(step, step));
            sum += vec4<f32>(light[face * count + index].rgb, 1.0) / (square * square);
        }
    }
    return sum.rgb / max(sum.w, 1e-6);
}

@compute @workgroup_size(64)
fn fill(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    let count = probe_count(parameters);
    if entry >= count * PROBE_FACES {
        return;
    }
    let face = entry / count;
    let probe = probe_at(parameters, entry % count);
    var value = light[entry].rgb;
    if !is_known(entry % count, face, count) {
        value = light_around(probe, face, count);
    }
    let texel = probe + parameters.dims * vec3<u32>(0u, face & 1u, face / 2u);
    textureStore(output, texel, vec4<f32>(min(value * parameters.scale, vec3<f32>(HALF_MAX)), 1.0));
}
