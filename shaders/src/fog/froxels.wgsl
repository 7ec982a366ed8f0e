// What fog scatters to the eye of the light that comes to a froxel: a sum over all virtual lights, with their visibility, and over the
// directions of the sky. (Wronski 2014, "Volumetric Fog"; froxels are cells of a lattice in the space of a view.)
//
// A light stands for a disc of the surface around it, of radius r. From a point at distance d on its axis its solid
// angle is 2 pi (1 - d / s), where s^2 = d^2 + r^2, and off the axis it is foreshortened; of a point that is nearer to
// its plane than r it is seen as from there, so that lights on a surface cover it without gaps however near the point
// is. The phase function of Henyey and Greenstein (1941) has the powers of its asymmetry as coefficients in Legendre's
// polynomials. Over a cap of half angle a the first of them shrinks by (1 + cos a) / 2: by that the asymmetry is
// multiplied, for the cap that reaches to the middle of the next discs, or between lights there would be less light
// than at them. Two such functions, one after the other, are one with the product of their asymmetries: a direction of
// the sky stands for a lobe as wide as directions are apart.
//
// A froxel behind what its middle shows is seen beside that, if at all: it takes the light where a pixel around sees as far, or, where none
// does, before what is seen farthest.
//
// Cost: a thread a froxel, about 50 operations a light that faces it; besides a ray, or the lookup of a depth; a ray
// for each direction of the sky. Before that, up to 17 rays through pixels, each a load and about 100 operations.

#import bevy_render::view::View
#import bevy_bounce::fog::rays::{EyeRay, eye_ray, uv_to_ndc, position_in_view}
#import bevy_bounce::fog::types::{FroxelParameters, froxel_distance}
#import bevy_bounce::interleaved::gather::{header, is_visible}
#import bevy_bounce::interleaved::surface::Surface
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::types::{Vpl, light_area}
#ifdef SKY
#import bevy_bounce::interleaved::sky::{scene, lights, FAR}
#import bevy_bounce::shared::rays::{is_blocked, to_grid, Ray}
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> froxels: FroxelParameters;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
// Pre-exposed radiance per unit of what scatters.
@group(0) @binding(4) var output: texture_storage_3d<rgba16float, write>;
// Reverse depth.
#ifdef MULTISAMPLED
@group(0) @binding(7) var depth_texture: texture_multisampled_2d<f32>;
#else
@group(0) @binding(7) var depth_texture: texture_2d<f32>;
#endif

/// Largest half float that is written.
const BRIGHTEST: f32 = 6e4;
/// Radii of its disc to which the light of a virtual light is spread.
const SPREAD: f32 = 2.0;
/// Share of the way to a surface at which the light before it is taken.
const BEFORE: f32 = 0.99;
/// Voxels: a place before a surface is known only as the mean of its voxel.
const GAP: f32 = 0.25;
/// Nearest to 1 and to -1 that fog scatters in one direction.
const STRAIGHT: f32 = 0.99;

/// Share of light that is scattered by an angle of that cosine, 1/sr.
fn phase(cosine: f32, asymmetry: f32) -> f32 {
    let g = clamp(asymmetry, -STRAIGHT, STRAIGHT);
    let square = 1.0 + g * g - 2.0 * g * cosine;
    return (1.0 - g * g) / (4.0 * PI * square * sqrt(square));
}

fn of_lights(position: vec3<f32>, ahead: vec3<f32>) -> vec3<f32> {
    var sum = vec3<f32>(0.0);
    for (var i = 0u; i < header.count; i++) {
        let vpl = vpls[i];
        let height = dot(vpl.normal, position - vpl.position);
        if height <= 0.0 {
            continue;
        }
        let radius = sqrt(light_area(vpl) / PI);
        let above = max(height, radius);
        let to_vpl = vpl.position - position - vpl.normal * (above - height);
        let distance = length(to_vpl);
        let direction = to_vpl / distance;
        var point: Surface;
        point.position = position;
        // A point in the air has no surface that could be taken for what hides it.
#ifndef VISIBILITY_VOXEL
        point.normal = normalize(vpl.position - position);
#endif
        if is_visible(i, vpl.position, vpl.normal, point) {
            let slant = length(vec2<f32>(distance, radius));
            let disc = 2.0 * above / (distance * slant * (slant + distance));
            let spread = 0.5 + 0.5 * distance / length(vec2<f32>(distance, SPREAD * radius));
            sum += vpl.flux * (disc * phase(dot(direction, ahead), spread * froxels.asymmetry));
        }
    }
    return sum / PI;
}

#ifdef SKY
fn of_sky(position: vec3<f32>, ahead: vec3<f32>) -> vec3<f32> {
    let asymmetry = froxels.asymmetry * max(1.0 - sqrt(4.0 * PI / f32(scene.sky_count)), 0.0);
    var ray: Ray;
    ray.origin = to_grid(position);
    ray.length = FAR;
    ray.gap = GAP;
    var sum = vec3<f32>(0.0);
    for (var i = scene.light_count; is_within(i, scene.light_count + scene.sky_count, position.x); i++) {
        ray.direction = -lights[i].direction;
        if !is_blocked(ray) {
            sum += lights[i].color * phase(dot(ray.direction, ahead), asymmetry);
        }
    }
    return sum;
}
#else
fn of_sky(position: vec3<f32>, ahead: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(0.0);
}
#endif

/// Pixels around the middle of a column: four beside it and the four between these, half a column away and as many a whole one, as far as
/// columns are interpolated.
const AROUND: u32 = 8u;
const RINGS: u32 = 2u;

fn aside(i: u32) -> vec2<f32> {
    let signs = select(vec2<f32>(-1.0), vec2<f32>(1.0), (vec2<u32>(i, i >> 1u) & vec2<u32>(1u)) != vec2<u32>(0u));
    let beside = select(vec2<f32>(signs.x, 0.0), vec2<f32>(0.0, signs.x), (i & 2u) != 0u);
    return select(beside, signs, i >= 4u);
}

// Along the ray through a place in the viewport.
struct Reach {
    ray: EyeRay,
    // World units from the near plane, as far as asked or before what is seen there.
    along: f32,
    // From the eye.
    distance: f32,
    is_whole: bool,
}

fn reach(place: vec2<f32>, distance: f32) -> Reach {
    let ndc = uv_to_ndc(place);
    let ray = eye_ray(view, ndc);
    let wanted = max(distance - ray.distance, 0.0);
    let last = view.viewport.zw - 1.0;
    let pixel = vec2<i32>(view.viewport.xy + clamp(place * view.viewport.zw, vec2<f32>(0.0), last));
    let depth = textureLoad(depth_texture, pixel, 0).x;
    if depth == 0.0 {
        return Reach(ray, wanted, distance, true);
    }
    let surface = -position_in_view(view, vec3<f32>(ndc, depth)).z;
    let free = max(BEFORE * (surface - ray.depth) / ray.deepens, 0.0);
    let along = min(wanted, free);
    return Reach(ray, along, ray.distance + along, free >= wanted);
}

// Where a froxel takes its light. The first one behind what the middle shows is interpolated with the one before that, and takes what is
// before it, too.
fn farthest_reach(place: vec3<f32>) -> Reach {
    let distance = froxel_distance(froxels, place.z);
    var best = reach(place.xy, distance);
    let slice = 1.0 / f32(froxels.dims.z);
    if best.is_whole || best.distance >= froxel_distance(froxels, place.z - slice) {
        return best;
    }
    for (var i = 0u; i < AROUND * RINGS && !best.is_whole; i++) {
        let columns = 0.5 * f32(1u + i / AROUND) * aside(i % AROUND);
        let pixel = clamp(place.xy + columns / vec2<f32>(froxels.dims.xy), vec2<f32>(0.0), vec2<f32>(1.0));
        let found = reach(pixel, distance);
        if found.is_whole || found.distance > best.distance {
            best = found;
        }
    }
    return best;
}

@compute @workgroup_size(64)
fn light_froxels(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let entry = folded_index(group) * 64u + lane;
    let dims = froxels.dims;
    if entry >= dims.x * dims.y * dims.z {
        return;
    }
    let froxel = vec3<u32>(entry % dims.x, (entry / dims.x) % dims.y, entry / (dims.x * dims.y));
    let place = (vec3<f32>(froxel) + 0.5) / vec3<f32>(dims);
    let seen = farthest_reach(place);
    let position = seen.ray.origin + seen.ray.direction * seen.along;
    let light = of_lights(position, seen.ray.direction) + of_sky(position, seen.ray.direction);
    textureStore(output, froxel, vec4<f32>(min(light * view.exposure, vec3<f32>(BRIGHTEST)), 1.0));
}
