// Cones through the light volume. Rehfeld, Zirr and Dachsbacher 2014, 3.1 and 4, "Cone-marching"; Crassin et al. 2011.
//
// A cone starts with a diameter of 3/4 of a voxel, and half a step from its origin; a step is half the diameter, and the level
// is the one whose texels are as wide as the cone. Both grow by the same factor a step, so that the level's logarithm grows by
// a constant.
//
// The six facings of a texel are apart: a cone sees what faces it, so that a surface does not shade itself and light on one
// side of a wall is not seen on the other.
//
// Cost: three filtered loads a step, some forty steps across a grid of 64^3.

#define_import_path bevy_bounce::radiance_cache::cone

#import bevy_bounce::shared::grid::Grid
#import bevy_bounce::radiance_cache::types::LightVolume

@group(1) @binding(0) var<uniform> grid: Grid;
@group(1) @binding(1) var<uniform> volume: LightVolume;
@group(1) @binding(2) var light_x: texture_3d<f32>;
@group(1) @binding(3) var light_y: texture_3d<f32>;
@group(1) @binding(4) var light_z: texture_3d<f32>;
@group(1) @binding(5) var light_sampler: sampler;

/// Voxels.
const FIRST_DIAMETER: f32 = 0.75;
/// More than any cone takes, whatever rounding does.
const MAX_STEPS: u32 = 256u;
/// Light that still comes through, of 1, below which a cone has ended.
const CLOSED: f32 = 0.004;
/// Cosine between a surface and a cone from which on it closes it as far as it covers it; below, in proportion.
const FACED: f32 = 0.5;

// Premultiplied light and coverage of what faces a ray along one axis.
fn seen(light: vec4<f32>, along: f32) -> vec4<f32> {
    return light * min(abs(along) / FACED, 1.0);
}

// What a cone meets at a place: premultiplied light, coverage.
fn sample_volume(place: vec3<f32>, direction: vec3<f32>, level: f32) -> vec4<f32> {
    let width = f32(2u * volume.dims.x + volume.gap);
    let size = vec3<f32>(width, vec2<f32>(volume.dims.yz));
    let other = f32(volume.dims.x + volume.gap);
    // A surface that faces up an axis is seen by what goes down it.
    let halves = select(vec3<f32>(0.0), vec3<f32>(other), direction > vec3<f32>(0.0));
    let x = seen(textureSampleLevel(light_x, light_sampler, (place + vec3<f32>(halves.x, 0.0, 0.0)) / size, level), direction.x);
    let y = seen(textureSampleLevel(light_y, light_sampler, (place + vec3<f32>(halves.y, 0.0, 0.0)) / size, level), direction.y);
    let z = seen(textureSampleLevel(light_z, light_sampler, (place + vec3<f32>(halves.z, 0.0, 0.0)) / size, level), direction.z);
    let sum = x + y + z;
    let coverage = 1.0 - (1.0 - x.a) * (1.0 - y.a) * (1.0 - z.a);
    return vec4<f32>(sum.rgb * (coverage / max(sum.a, 1e-6)), coverage);
}

/// Light along a cone from a place in voxels, and how much of it ended on a surface. `spread`: diameter over distance.
fn march_cone(origin: vec3<f32>, direction: vec3<f32>, spread: f32) -> vec4<f32> {
    let end = vec3<f32>(grid.dims);
    let growth = 1.0 + 0.5 * spread;
    let level_step = log2(growth);
    var diameter = FIRST_DIAMETER;
    var level = log2(diameter);
    var distance = 0.25 * diameter;
    var light = vec3<f32>(0.0);
    var open = 1.0;
    for (var i = 0u; i < MAX_STEPS && open > CLOSED; i++) {
        let place = origin + direction * distance;
        if any(place < vec3<f32>(0.0)) || any(place > end) {
            break;
        }
        let met = sample_volume(place, direction, clamp(level, 0.0, f32(volume.last_level)));
        light += open * met.rgb;
        open *= 1.0 - met.a;
        distance += 0.5 * diameter;
        diameter *= growth;
        level += level_step;
    }
    // What is closed but for a rounding error has the colour of what closes it.
    if open <= CLOSED {
        light /= 1.0 - open;
        open = 0.0;
    }
    return vec4<f32>(light, 1.0 - open);
}
