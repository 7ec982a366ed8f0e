// Cones through the light volume. Rehfeld, Zirr and Dachsbacher 2014, 3.1 and 4, "Cone-marching"; Crassin et al. 2011.
//
// A cone starts with a diameter of 3/4 of a voxel; a step is half the diameter, and the level is the one whose texels are as
// wide as a step: a surface's filtered coverage then still adds up to one, and light is told from shadow better than where texels are as
// wide as the cone. Both grow by the same factor a step, so that the level's logarithm grows by a constant.
//
// The six facings of a texel are apart: a cone sees what faces it, so that a surface does not shade itself and light on one
// side of a wall is not seen on the other.
//
// Coverage is projected area: what a cone meets on a step is its sum over the axes, each times how much of a texel the
// step goes along the axis. Near its start, what looks the other way is taken off: a surface aslant faces the cone that
// leaves it along one axis and away from it along another, and only the difference is met, so that what is convex does
// not shade itself. Where an axis has both, they are the two sides of a wall, and nothing is taken off. Over a whole
// surface that adds up to what of the cone the surface fills, whatever the angle, the level and the step. Where a layer
// is half open, the next one behind closes the other half; the paper multiplies, by which edges grow and closed walls
// leak.
//
// A filtered surface reaches a texel to both sides. A cone therefore starts a little before its place, so that it meets the whole
// of what is near; and what looks down on the surface that it leaves counts only from one and a half texels above
// it, for a thin wall's other side reaches that far. For the same reason a cone goes on for half a texel beyond the grid.
//
// Groups with a grid of their own are in `group_cones.wgsl`: what a cone meets of them on a step adds to what it meets of the world there.
//
// Cost: six filtered loads a step, some forty steps across a grid of 64^3.

#define_import_path bevy_bounce::radiance_cache::cone

#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::grid::Grid

@group(1) @binding(0) var<uniform> grid: Grid;
@group(1) @binding(1) var<uniform> volume: LightVolume;
@group(1) @binding(2) var light_x: texture_3d<f32>;
@group(1) @binding(3) var light_y: texture_3d<f32>;
@group(1) @binding(4) var light_z: texture_3d<f32>;
@group(1) @binding(5) var light_sampler: sampler;

/// Texels of the coarser level over a surface to which its own other side reaches: half a texel from the surface to the
/// middle of its texel, and one from there.
const OWN_REACH: f32 = 1.5;

/// Voxels along a cone within which the other side of a surface aslant may be met.
const OWN_LENGTH: f32 = 4.0;

/// The surface that a cone leaves, in voxels.
struct Start {
    position: vec3<f32>,
    normal: vec3<f32>,
}

/// A step of a cone in a grid, all in its voxels.
struct Step {
    start: Start,
    // Unit length.
    direction: vec3<f32>,
    place: vec3<f32>,
    // Along the cone.
    distance: f32,
    length: f32,
    // Logarithm of the width of the texels that are as wide as the step.
    level: f32,
}

/// Light and coverage of what faces that way along an axis; of what faces the other way, its coverage.
struct Sides {
    toward: vec4<f32>,
    away: f32,
}

// How much of what faces against each axis of the direction is not the surface's own other side. A surface along the grid
// goes on as far as the cone follows it, one aslant ends or bends.
fn not_own(at: Step) -> vec3<f32> {
    let height = dot(at.start.normal, at.place - at.start.position) / exp2(ceil(at.level));
    let looks_down = clamp(2.0 * at.start.normal * sign(at.direction), vec3<f32>(0.0), vec3<f32>(1.0));
    let goes_on = smoothstep(vec3<f32>(0.8), vec3<f32>(0.95), abs(at.start.normal));
    let own = looks_down * max(goes_on, vec3<f32>(clamp(2.0 - at.distance / OWN_LENGTH, 0.0, 1.0)));
    return 1.0 - own * (1.0 - clamp(4.0 * (height - OWN_REACH), 0.0, 1.0));
}

/// Width of the filter between two levels, texels of the finest.
fn texel_width(level: f32) -> f32 {
    return exp2(floor(level)) * (1.0 + fract(level));
}

/// What is at a place of a texture, and `other` further on, where what faces down its axis is; as parts of the texture.
fn sample_axis(light: texture_3d<f32>, place: vec3<f32>, other: vec3<f32>, against: bool, level: f32) -> Sides {
    let up = textureSampleLevel(light, light_sampler, place, level);
    let down = textureSampleLevel(light, light_sampler, place + other, level);
    // A surface that faces up an axis is seen by what goes down it.
    if against {
        return Sides(down, up.a);
    }
    return Sides(up, down.a);
}

/// What a cone meets on a step where that is along each axis: light times coverage, coverage.
fn meet(at: Step, x: Sides, y: Sides, z: Sides) -> vec4<f32> {
    let along = abs(at.direction) * (at.length / texel_width(at.level));
    let toward = along * not_own(at);
    let met = x.toward * toward.x + y.toward * toward.y + z.toward * toward.z;
    // Of a surface aslant near the start only what is left where one axis sees its back; of a wall with two sides, all.
    let lone = vec3<f32>(max(x.away - x.toward.a, 0.0), max(y.away - y.toward.a, 0.0), max(z.away - z.toward.a, 0.0));
    let near = clamp(2.0 - at.distance / OWN_LENGTH, 0.0, 1.0);
    let coverage = max(met.a - dot(lone, along) * near, 0.0);
    return met * (coverage / max(met.a, 1e-6));
}

/// What a cone meets of the world on a step.
fn sample_world(at: Step) -> vec4<f32> {
    let size = vec3<f32>(f32(2u * volume.dims.x + volume.gap), vec2<f32>(volume.dims.yz));
    let other = vec3<f32>(f32(volume.dims.x + volume.gap) / size.x, 0.0, 0.0);
    // Outside, the outermost texels go on.
    let margin = 0.5 * exp2(ceil(at.level));
    let place = clamp(at.place, vec3<f32>(margin), vec3<f32>(volume.dims) - margin) / size;
    let x = sample_axis(light_x, place, other, at.direction.x > 0.0, at.level);
    let y = sample_axis(light_y, place, other, at.direction.y > 0.0, at.level);
    let z = sample_axis(light_z, place, other, at.direction.z > 0.0, at.level);
    return meet(at, x, y, z);
}
