// Cones through the light volume. Rehfeld, Zirr and Dachsbacher 2014, 3.1 and 4, "Cone-marching"; Crassin et al. 2011.
//
// A cone starts with a diameter of 3/4 of a voxel; a step is half the diameter, and the level is the one whose texels are as
// wide as a step: a surface's filtered coverage then still adds up to one, and light is told from shadow better than where texels are as
// wide as the cone. Both grow by the same factor a step, so that the level's logarithm grows by a constant.
//
// The six facings of a texel are apart: a cone sees what faces it, so that a surface does not shade itself and light on one
// side of a wall is not seen on the other.
//
// Coverage is projected area: what a cone meets on a step is its sum over the axes, each times how much of a texel the step
// goes along the axis. Near its start, what looks the other way is taken off: a surface aslant faces the cone that leaves it along one axis
// and away from it along another, and only the difference is met, so that what is convex does not shade itself. Where an axis has
// both, they are the two sides of a wall, and nothing is taken off. Over a whole surface that adds up to what of the cone the surface
// fills, whatever the angle, the level and the step. Where a layer is half open, the next one behind closes the other half; the paper multiplies, by which
// edges grow and closed walls leak.
//
// A filtered surface reaches a texel to both sides. A cone therefore starts a little before its place, so that it meets the whole
// of what is near; and what looks down on the surface that it leaves counts only from one and a half texels above
// it, for a thin wall's other side reaches that far. For the same reason a cone goes on for half a texel beyond the grid.
//
// Cost: six filtered loads a step, some forty steps across a grid of 64^3.

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
/// Where the first sample is taken, voxels along the cone.
const FIRST_SAMPLE: f32 = -0.75;
/// More than any cone takes, whatever rounding does.
const MAX_STEPS: u32 = 256u;
/// Part of a cone below which what is open is the error of the steps.
const CLOSED: f32 = 0.06;

/// Texels of the coarser level over a surface to which its own other side reaches: half a texel from the surface to the middle of its texel, and one
/// from there.
const OWN_REACH: f32 = 1.5;

/// Voxels along a cone within which the other side of a surface aslant may be met.
const OWN_LENGTH: f32 = 4.0;

/// The surface that a cone leaves, in voxels.
struct Start {
    position: vec3<f32>,
    normal: vec3<f32>,
}

// How much of what faces against each axis of the direction is not the surface's own other side, at that height over it in
// texels. A surface along the grid goes on as far as the cone follows it, one aslant ends or bends.
fn not_own(start: Start, direction: vec3<f32>, height: f32, distance: f32) -> vec3<f32> {
    let looks_down = clamp(2.0 * start.normal * sign(direction), vec3<f32>(0.0), vec3<f32>(1.0));
    let goes_on = smoothstep(vec3<f32>(0.8), vec3<f32>(0.95), abs(start.normal));
    let own = looks_down * max(goes_on, vec3<f32>(clamp(2.0 - distance / OWN_LENGTH, 0.0, 1.0)));
    return 1.0 - own * (1.0 - clamp(4.0 * (height - OWN_REACH), 0.0, 1.0));
}

// Light and coverage of what faces that way along an axis; of what faces the other way, its coverage.
struct Sides {
    toward: vec4<f32>,
    away: f32,
}

fn sample_axis(light: texture_3d<f32>, place: vec3<f32>, size: vec3<f32>, against: bool, level: f32) -> Sides {
    let other = vec3<f32>(f32(volume.dims.x + volume.gap), 0.0, 0.0);
    let up = textureSampleLevel(light, light_sampler, place / size, level);
    let down = textureSampleLevel(light, light_sampler, (place + other) / size, level);
    // A surface that faces up an axis is seen by what goes down it.
    if against {
        return Sides(down, up.a);
    }
    return Sides(up, down.a);
}

// What a cone meets on a step at a place: light times coverage, coverage.
fn sample_volume(place: vec3<f32>, start: Start, direction: vec3<f32>, distance: f32, level: f32, step: f32) -> vec4<f32> {
    let size = vec3<f32>(f32(2u * volume.dims.x + volume.gap), vec2<f32>(volume.dims.yz));
    // Outside, the outermost texels go on.
    let margin = 0.5 * exp2(ceil(level));
    let within = clamp(place, vec3<f32>(margin), vec3<f32>(volume.dims) - margin);
    let x = sample_axis(light_x, within, size, direction.x > 0.0, level);
    let y = sample_axis(light_y, within, size, direction.y > 0.0, level);
    let z = sample_axis(light_z, within, size, direction.z > 0.0, level);
    // Width of the filter between two levels.
    let texel = exp2(floor(level)) * (1.0 + fract(level));
    let height = dot(start.normal, place - start.position) / exp2(ceil(level));
    let along = abs(direction) * (step / texel);
    let toward = along * not_own(start, direction, height, distance);
    let met = x.toward * toward.x + y.toward * toward.y + z.toward * toward.z;
    // Of a surface aslant near the start only what is left where one axis sees its back; of a wall with two sides, all.
    let lone = vec3<f32>(max(x.away - x.toward.a, 0.0), max(y.away - y.toward.a, 0.0), max(z.away - z.toward.a, 0.0));
    let near = clamp(2.0 - distance / OWN_LENGTH, 0.0, 1.0);
    let coverage = max(met.a - dot(lone, along) * near, 0.0);
    return met * (coverage / max(met.a, 1e-6));
}

/// Light along a cone, and how much of it ended on a surface. `lift`: voxels by which it begins above the surface; `spread`:
/// diameter over distance.
fn march_cone(start: Start, lift: f32, direction: vec3<f32>, spread: f32) -> vec4<f32> {
    let end = vec3<f32>(grid.dims);
    let origin = start.position + start.normal * lift;
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
        let met = sample_volume(place, start, direction, distance, clamp(level, 0.0, f32(volume.last_level)), step);
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
