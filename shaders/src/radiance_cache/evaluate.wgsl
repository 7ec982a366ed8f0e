// Light of each pixel from the caches of the tiles around. Rehfeld, Zirr and Dachsbacher 2014, 3.3.
//
// A cache counts by the smaller of its weights in space and on the screen, times how far it faces as the pixel does and for how many
// pixels it stands. None of that is zero for the cache of a pixel's own cluster, which is always within both radii: every pixel has
// light.
//
// Light that a clearcoat reflects is gathered apart, for Bevy weighs it by the surface's normal and the coat's strength.
//
// Cost: some fifty caches a pixel, of which about fifteen are near; two filtered loads each, one more for diffuse light and two for a coat.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface}
#import bevy_bounce::radiance_cache::hemisphere::{hemisphere_to_square, to_cache}
#import bevy_bounce::radiance_cache::lobes::{dominant_direction, roughness_level, DIFFUSE_LEVEL}
#import bevy_bounce::radiance_cache::types::{
    CacheGrid, RadianceCache, CacheCounters, cache_corner, level_corner, CACHE_EDGE, CACHE_COARSE_EDGE,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> parameters: CacheGrid;
@group(0) @binding(2) var surface_texture: texture_2d<u32>;
@group(0) @binding(3) var deferred_texture: texture_2d<u32>;
@group(0) @binding(4) var atlas: texture_2d<f32>;
@group(0) @binding(5) var atlas_sampler: sampler;
@group(0) @binding(6) var<storage, read> unit: array<f32>;
@group(0) @binding(7) var<storage, read> caches: array<RadianceCache>;
// Of each tile, its first cache and the one after its last.
@group(0) @binding(8) var<storage, read> ranges: array<vec2<u32>>;
@group(0) @binding(9) var<storage, read_write> missing: array<atomic<u32>>;
@group(0) @binding(10) var glossy: texture_storage_2d<rgba16float, write>;
@group(0) @binding(11) var coat: texture_storage_2d<rgba16float, write>;
#ifdef DIFFUSE
@group(0) @binding(12) var diffuse: texture_storage_2d<rgba16float, write>;
#endif

/// Where in the counters that of pixels without light is.
const COUNTER_MISSING: u32 = 4u;
/// What a cache that faces the other way counts, of one that faces as the pixel does.
const LEAST_FACING: f32 = 1e-4;

// What a pixel reflects: towards where, and at which level. No strength, no light.
struct Lobe {
    direction: vec3<f32>,
    level: f32,
    strength: f32,
}

// Sums of light times weight, and of weights.
struct Lit {
    diffuse: vec4<f32>,
    glossy: vec4<f32>,
    coat: vec4<f32>,
}

// A level of a cache in a direction of its space.
fn look(index: u32, level: u32, square: vec2<f32>) -> vec3<f32> {
    let edge = f32(select(CACHE_COARSE_EDGE, CACHE_EDGE, level == 0u));
    let corner = vec2<f32>(cache_corner(index) + level_corner(level));
    let place = corner + clamp(square * edge, vec2<f32>(0.5), vec2<f32>(edge - 0.5));
    return textureSampleLevel(atlas, atlas_sampler, place / vec2<f32>(textureDimensions(atlas)), 0.0).rgb;
}

fn fourth_power(x: f32) -> f32 {
    return x * x * x * x;
}

fn make_lobe(surface: Surface, incident: vec3<f32>, roughness: f32, strength: f32) -> Lobe {
    let mirrored = reflect(incident, surface.normal);
    return Lobe(dominant_direction(surface.normal, mirrored, roughness * roughness), roughness_level(roughness), strength);
}

// A cache's light in a lobe times its weight; the weight.
fn look_lobe(index: u32, cache: RadianceCache, lobe: Lobe, near: f32, facing: f32) -> vec4<f32> {
    let toward = to_cache(cache.normal, lobe.direction);
    let square = hemisphere_to_square(toward);
    let first = u32(lobe.level);
    let light = mix(look(index, first, square), look(index, min(first + 1u, 3u), square), fract(lobe.level));
    let weight = near * (max(toward.z, 0.0) * fourth_power(facing) + LEAST_FACING);
    return vec4<f32>(light * weight, weight);
}

fn add_cache(lit: ptr<function, Lit>, index: u32, surface: Surface, pixel: vec2<f32>, lobe: Lobe, coat_lobe: Lobe) {
    let cache = caches[index];
    let on_screen = (pixel - cache.screen) / (parameters.reach * f32(parameters.tile));
    let in_space = (surface.position - cache.position) / cache.radius;
    let near = cache.share * min(1.0 - dot(on_screen, on_screen), 1.0 - dot(in_space, in_space));
    if near <= 0.0 {
        return;
    }
    let facing = max(dot(surface.normal, cache.normal), 0.0);
#ifdef DIFFUSE
    let weight = near * (fourth_power(facing) + LEAST_FACING);
    let local = to_cache(cache.normal, surface.normal);
    (*lit).diffuse += vec4<f32>(look(index, DIFFUSE_LEVEL, hemisphere_to_square(local)) * weight, weight);
#endif
    (*lit).glossy += look_lobe(index, cache, lobe, near, facing);
    if coat_lobe.strength > 0.0 {
        (*lit).coat += look_lobe(index, cache, coat_lobe, near, facing);
    }
}

fn gather(surface: Surface, pixel: vec2<f32>, deferred: vec4<u32>) -> Lit {
    let eye = view.world_position;
    var incident = normalize(surface.position - eye);
    if parameters.orthographic != 0u {
        incident = -view.world_from_view[2].xyz;
    }
    let lobe = make_lobe(surface, incident, unpack4x8unorm(deferred.r).a, 1.0);
    // Strength in fifteenths and roughness in thirtieths, as in bevy_pbr/src/deferred/pbr_deferred_functions.wgsl.
    let coat_bits = deferred.b >> 24u;
    let coat_lobe = make_lobe(surface, incident, f32(coat_bits >> 4u) / 30.0, f32(coat_bits & 15u) / 15.0);
    var lit: Lit;
    let radius = parameters.reach * f32(parameters.tile);
    let tiles = vec2<f32>(parameters.tiles) - 1.0;
    let first = vec2<u32>(clamp(floor((pixel - radius) / f32(parameters.tile)), vec2<f32>(0.0), tiles));
    let last = vec2<u32>(clamp(floor((pixel + radius) / f32(parameters.tile)), vec2<f32>(0.0), tiles));
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let range = ranges[y * parameters.tiles.x + x];
            for (var i = range.x; i < range.y; i++) {
                add_cache(&lit, i, surface, pixel, lobe, coat_lobe);
            }
        }
    }
    return lit;
}

// Mean of a sum, pre-exposed.
fn exposed(sum: vec4<f32>) -> vec4<f32> {
    let mean = sum.rgb * (unit[0] * view.exposure / max(sum.a, 1e-20));
    return vec4<f32>(min(mean, vec3<f32>(6e4)), 1.0);
}

@compute @workgroup_size(8, 8)
fn evaluate(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= parameters.size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, parameters.size, view);
    var lit: Lit;
    if surface.valid {
        let deferred = textureLoad(deferred_texture, id.xy + vec2<u32>(view.main_pass_viewport.xy), 0);
        lit = gather(surface, vec2<f32>(id.xy) + 0.5, deferred);
        if lit.glossy.a <= 0.0 {
            atomicAdd(&missing[COUNTER_MISSING], 1u);
        }
    }
    textureStore(glossy, id.xy, exposed(lit.glossy));
    textureStore(coat, id.xy, exposed(lit.coat));
#ifdef DIFFUSE
    textureStore(diffuse, id.xy, exposed(lit.diffuse));
#endif
}
