// A cone's way through the world and the groups in it, one step after the other: light adds up from the front to the back, whatever grid it
// is from. Rehfeld, Zirr and Dachsbacher 2014, 3.1, march each grid by itself and put their hits in order afterwards, as
// far as they keep them; here all are looked at on the same step, so that their order is that of the steps.
//
// Cost: that of a cone through the world; for each group that it is in, up to twelve more filtered loads a step.

#define_import_path bevy_bounce::radiance_cache::march

#import bevy_bounce::radiance_cache::cone::{grid, volume, Start, Step, sample_world}
#import bevy_bounce::radiance_cache::group_cones::{groups_near, sample_group}

/// Voxels.
const FIRST_DIAMETER: f32 = 0.75;
/// Where the first sample is taken, voxels along the cone.
const FIRST_SAMPLE: f32 = -0.75;
/// More than any cone takes, whatever rounding does.
const MAX_STEPS: u32 = 256u;
/// Part of a cone below which what is open is the error of the steps.
const CLOSED: f32 = 0.06;

// What a cone meets on a step; `level` is not limited by what there is.
fn sample_all(at: Step, groups: u32) -> vec4<f32> {
    var own = at;
    own.level = clamp(at.level, 0.0, f32(volume.last_level));
    var met = sample_world(own);
    var left = groups;
    while left != 0u {
        let index = firstTrailingBit(left);
        left &= left - 1u;
        met += sample_group(at, index);
    }
    return met;
}

/// Light along a cone, and how much of it ended on a surface. `lift`: voxels by which it begins above the surface; `spread`:
/// diameter over distance.
fn march_cone(start: Start, lift: f32, direction: vec3<f32>, spread: f32) -> vec4<f32> {
    let end = vec3<f32>(grid.dims);
    let origin = start.position + start.normal * lift;
    let groups = groups_near(origin, direction, spread);
    let growth = 1.0 + 0.5 * spread;
    let level_step = log2(growth);
    var diameter = FIRST_DIAMETER;
    var level = log2(diameter) - 1.0;
    var distance = FIRST_SAMPLE;
    var light = vec3<f32>(0.0);
    var open = 1.0;
    for (var i = 0u; i < MAX_STEPS && open > CLOSED; i++) {
        let place = origin + direction * distance;
        // The outermost surfaces reach half a texel beyond the grid.
        let outside = max(-place, place - end);
        if distance > 0.0 && max(outside.x, max(outside.y, outside.z)) > 0.5 * max(diameter, 1.0) {
            break;
        }
        let step = 0.5 * diameter;
        let met = sample_all(Step(start, direction, place, distance, step, level), groups);
        let taken = min(met.a, open);
        light += met.rgb * (taken / max(met.a, 1e-6));
        open -= taken;
        distance += step;
        if distance > 0.0 {
            diameter *= growth;
            level += level_step;
        }
    }
    if open <= CLOSED {
        light /= 1.0 - open;
        open = 0.0;
    }
    return vec4<f32>(light, 1.0 - open);
}
