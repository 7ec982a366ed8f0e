// Bounced light at each pixel from a sixteenth of the virtual lights. Interleaved sampling, Keller & Heidrich 2001,
// Segovia et al. 2006; Bashford-Rogers et al. 2012, III-C.
//
// A workgroup takes 8x8 pixels of one of the sixteen sub-images that the 4x4 blocks fall into, so that all its threads read
// the same lights in the same order. The split and the join are in the addressing: no copy of the G-buffer is made.
//
// Cost: about 30 operations a light; besides a ray, or the lookup of a depth, where visibility asks for it.

#import bevy_render::view::View
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::bound::geometry_bound
#import bevy_bounce::vpl::types::{Vpl, VplHeader, SUBSETS}
#import bevy_bounce::interleaved::surface::{Surface, unpack_surface}
#ifdef VISIBILITY_VOXEL
#import bevy_bounce::shared::rays::{grid, trace, to_grid, Ray}
#endif
#ifdef VISIBILITY_ATLAS
#import bevy_bounce::shadow_atlas::lookup::atlas_visible
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> header: VplHeader;
@group(0) @binding(3) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;

const BLOCK: u32 = 4u;
const TILE: u32 = 8u;
// Voxels: a pixel is on a surface that the grid knows only as the mean of its voxel.
const SURFACE_GAP: f32 = 0.25;

#ifdef VISIBILITY_VOXEL
fn is_visible(light: u32, vpl: Vpl, surface: Surface) -> bool {
    var ray: Ray;
    ray.origin = to_grid(vpl.position);
    let to_surface = to_grid(surface.position) - ray.origin;
    ray.length = length(to_surface);
    ray.direction = to_surface / max(ray.length, 1e-6);
    ray.start_normal = vpl.normal;
    ray.end_normal = surface.normal;
    ray.gap = SURFACE_GAP;
    return !trace(ray).found;
}
#else ifdef VISIBILITY_ATLAS
fn is_visible(light: u32, vpl: Vpl, surface: Surface) -> bool {
    return atlas_visible(light, vpl, surface.position, surface.normal);
}
#else
fn is_visible(light: u32, vpl: Vpl, surface: Surface) -> bool {
    return true;
}
#endif

// Irradiance over pi, cd/m^2.
fn gather(surface: Surface, subset: u32) -> vec3<f32> {
    var light = vec3<f32>(0.0);
    let bound = geometry_bound(header, surface.position);
    let end = header.subset_start[subset + 1u];
    for (var i = header.subset_start[subset]; i < end; i++) {
        let vpl = vpls[i];
        let to_vpl = vpl.position - surface.position;
        let square = max(dot(to_vpl, to_vpl), 1e-12);
        let direction = to_vpl * inverseSqrt(square);
        let cosines = max(dot(surface.normal, direction), 0.0) * max(-dot(vpl.normal, direction), 0.0);
        let geometry_term = min(cosines / square, bound);
        if geometry_term > 0.0 && is_visible(i, vpl, surface) {
            light += vpl.flux * geometry_term;
        }
    }
    return light * (f32(SUBSETS) / (PI * PI));
}

@compute @workgroup_size(8, 8)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    let tiles = (size + (BLOCK * TILE - 1u)) / (BLOCK * TILE);
    let offset = group.xy / tiles;
    let pixel = ((group.xy % tiles) * TILE + local.xy) * BLOCK + offset;
    if any(pixel >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, size, view);
    var light = vec3<f32>(0.0);
    if surface.valid {
        light = gather(surface, offset.y * BLOCK + offset.x) * view.exposure;
    }
    textureStore(output, pixel, vec4<f32>(min(light, vec3<f32>(6e4)), 1.0));
}
