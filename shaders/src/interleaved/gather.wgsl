// Bounced light at a point: a sum over virtual lights, with a bounded geometry term and their visibility. Where there is a sky,
// its light straight from there, too.
//
// Cost: 32 bytes and about 30 operations a light; besides a ray, or the lookup of a depth, where visibility asks for it.

#define_import_path bevy_bounce::interleaved::gather

#import bevy_bounce::interleaved::surface::Surface
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::bound::geometry_bound
#import bevy_bounce::vpl::compact::{CompactVpl, UNIFORM_VPLS, flux_of}
#import bevy_bounce::vpl::types::{VplHeader, SUBSETS, subset_at, sky_subset_at}
#ifdef VISIBILITY_VOXEL
#import bevy_bounce::shared::rays::{grid, is_blocked, to_grid, Ray}
#endif
#ifdef SKY
#import bevy_bounce::interleaved::sky::{sky_light, open_sky}
#endif
#ifdef VISIBILITY_ATLAS
#import bevy_bounce::shadow_atlas::lookup::atlas_visible
#endif

@group(0) @binding(2) var<storage, read> header: VplHeader;
#ifdef FEW_LIGHTS
@group(0) @binding(3) var<uniform> compact_vpls: array<CompactVpl, UNIFORM_VPLS>;
#else
@group(0) @binding(3) var<storage, read> compact_vpls: array<CompactVpl>;
#endif

// Voxels: a pixel is on a surface that the grid knows only as the mean of its voxel.
const SURFACE_GAP: f32 = 0.25;

/// Whether the light of that number in the list, and of that position and normal, sees a surface.
#ifdef VISIBILITY_VOXEL
fn is_visible(light: u32, position: vec3<f32>, normal: vec3<f32>, surface: Surface) -> bool {
    var ray: Ray;
    ray.origin = to_grid(position);
    let to_surface = to_grid(surface.position) - ray.origin;
    ray.length = length(to_surface);
    ray.direction = to_surface / max(ray.length, 1e-6);
    ray.start_normal = normal;
    ray.end_normal = surface.normal;
    ray.gap = SURFACE_GAP;
    return !is_blocked(ray);
}
#else ifdef VISIBILITY_ATLAS
fn is_visible(light: u32, position: vec3<f32>, normal: vec3<f32>, surface: Surface) -> bool {
    return atlas_visible(light, position, normal, surface.position, surface.normal);
}
#else
fn is_visible(light: u32, position: vec3<f32>, normal: vec3<f32>, surface: Surface) -> bool {
    return true;
}
#endif

/// What of the geometry term counts: from there to there, 1/m^2.
struct Band {
    above: f32,
    below: f32,
}

/// Part of the bound up to which the geometry term is interleaved, where the bound is not scaled; what is above that is gathered at each
/// texel (`near.wgsl`). A sixteenth would let no light of a subset weigh more than the bound does; an eighth has nine tenths of what
/// that takes off the noise of the Cornell box, and fewer lights are as near.
const NEAR: f32 = 0.125;

fn near_band(surface: Surface) -> Band {
    let bound = geometry_bound(header, surface.position);
    return Band(min(NEAR * bound / max(header.bound_scale, 1e-12), bound), bound);
}

fn far_band(surface: Surface) -> Band {
    return Band(0.0, near_band(surface).above);
}

fn whole_band(surface: Surface) -> Band {
    return Band(0.0, geometry_bound(header, surface.position));
}

/// Of a light, 1/m^2; above 0 where it counts.
fn geometry_term(surface: Surface, vpl: CompactVpl, band: Band) -> f32 {
    let to_vpl = vpl.position - surface.position;
    let square = max(dot(to_vpl, to_vpl), 1e-12);
    let direction = to_vpl * inverseSqrt(square);
    let cosines = max(dot(surface.normal, direction), 0.0) * max(-dot(vpl.normal, direction), 0.0);
    return min(cosines / square, band.below) - band.above;
}

/// Irradiance over pi from the lights of a part of the list, cd/m^2.
fn gather(surface: Surface, first: u32, end: u32, band: Band) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    for (var i = first; i < end; i++) {
        let vpl = compact_vpls[i];
        let term = geometry_term(surface, vpl, band);
        if term > 0.0 && is_visible(i, vpl.position, vpl.normal, surface) {
            light += flux_of(vpl) * term;
        }
    }
    return light / (PI * PI);
}

struct Gathered {
    // Irradiance over pi, cd/m^2.
    light: vec3<f32>,
    // Shares of the sky's light that come past what stands in its way: into the cosine lobe, and into that of `mirrored_lobe`.
    sky_seen: vec2<f32>,
}

// The same straight from one of `step` directions of the sky, which stands for all. `to_eye`: unit length.
fn gather_sky(surface: Surface, to_eye: vec3<f32>, first: u32, step: u32) -> Gathered {
    var sky = Gathered(vec3<f32>(0.0), vec2<f32>(1.0));
#ifdef SKY
    let mirrored = reflect(-to_eye, surface.normal);
    let light = sky_light(surface.position, surface.normal, surface.normal, mirrored, SURFACE_GAP, first, step);
    sky.light = light.diffuse;
#ifdef SKY_SEEN
    // Where no direction lies in the mirrored lobe, what is known of the surface's whole sky says how much of it is seen.
    let open = open_sky(surface.normal, mirrored);
    let seen = select(vec2<f32>(1.0), light.seen / max(open, vec2<f32>(1e-30)), open > vec2<f32>(0.0));
    sky.sky_seen = vec2<f32>(seen.x, select(seen.x, seen.y, open.y > 0.0));
#endif
#endif
    return sky;
}

/// The same from a subset of both, which stands for all, but for what `near.wgsl` gathers: what belongs to a place in a 4x4 block.
fn gather_subset(surface: Surface, to_eye: vec3<f32>, place: vec2<u32>) -> Gathered {
    let subset = subset_at(place);
    let lights = gather(surface, header.subset_start[subset], header.subset_start[subset + 1u], far_band(surface));
    let sky = gather_sky(surface, to_eye, sky_subset_at(place), SUBSETS);
    return Gathered(f32(SUBSETS) * lights + sky.light, sky.sky_seen);
}

/// The same from all, with that.
fn gather_all(surface: Surface, to_eye: vec3<f32>) -> Gathered {
    let sky = gather_sky(surface, to_eye, 0u, 1u);
    return Gathered(gather(surface, 0u, header.count, whole_band(surface)) + sky.light, sky.sky_seen);
}
