// The voxel grid as the camera sees it, by the rays that paths and shadows take: colour of the cells that they meet, normal, or the light
// that the voxels send. Black where nothing is met.
//
// Cost: one ray a pixel.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::unproject
#import bevy_bounce::shared::grid::facing_of
#import bevy_bounce::shared::rays::{cells, to_grid, trace, Hit, Ray}
#ifdef VOXEL_LIGHT
#import bevy_bounce::radiance_cache::types::LightVolume
#import bevy_bounce::shared::rays::{to_world, voxel_groups}
#import bevy_bounce::shared::voxel_groups::{to_group, normal_to_group, GROUP_EDGE}
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var picture: texture_storage_2d<rgba16float, write>;
#ifdef VOXEL_LIGHT
@group(0) @binding(2) var<uniform> volume: LightVolume;
@group(0) @binding(3) var<storage, read> unit: array<f32>;
@group(0) @binding(4) var light_x: texture_3d<f32>;
@group(0) @binding(5) var light_y: texture_3d<f32>;
@group(0) @binding(6) var light_z: texture_3d<f32>;
@group(0) @binding(7) var group_x: texture_3d<f32>;
@group(0) @binding(8) var group_y: texture_3d<f32>;
@group(0) @binding(9) var group_z: texture_3d<f32>;
#endif

/// Voxels: longer than any way through the grid.
const FAR: f32 = 1e6;
/// Voxels from a plane into the voxel that it is in.
const INSIDE: f32 = 1e-3;

/// From the near plane away from the camera.
fn ray_through(pixel: vec2<u32>, size: vec2<u32>) -> Ray {
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(size);
    let ndc = vec2<f32>(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0);
    let near = unproject(view, vec3<f32>(ndc, 1.0));
    let direction = normalize(unproject(view, vec3<f32>(ndc, 0.5)) - near);
    return Ray(to_grid(near), direction, FAR, vec3<f32>(0.0), vec3<f32>(0.0), 0.0);
}

#ifdef VOXEL_LIGHT
/// Light of the voxel on the side of its longest axis, cd/m^2: see `radiance_cache/volume.wgsl`.
fn light_of_world(ray: Ray, hit: Hit) -> vec4<f32> {
    var voxel = vec3<i32>(floor(ray.origin + ray.direction * (hit.t + INSIDE)));
    if any(voxel < vec3<i32>(0)) || any(voxel >= vec3<i32>(volume.dims)) {
        return vec4<f32>(0.0);
    }
    let facing = facing_of(hit.normal);
    voxel.x += i32(facing & 1u) * i32(volume.dims.x + volume.gap);
    switch facing / 2u {
        case 0u: { return textureLoad(light_x, voxel, 0); }
        case 1u: { return textureLoad(light_y, voxel, 0); }
        default: { return textureLoad(light_z, voxel, 0); }
    }
}

fn light_of_group(ray: Ray, hit: Hit) -> vec4<f32> {
    let group = voxel_groups.groups[hit.group - 1u];
    let normal = normal_to_group(group, hit.normal);
    let place = to_group(group, to_world(ray.origin + ray.direction * hit.t)) - normal * INSIDE;
    var voxel = vec3<i32>(clamp(place, vec3<f32>(0.0), vec3<f32>(group.dims) - 1.0));
    let facing = facing_of(normal);
    voxel += vec3<i32>(vec3<u32>(facing & 1u, 0u, hit.group - 1u) * GROUP_EDGE);
    switch facing / 2u {
        case 0u: { return textureLoad(group_x, voxel, 0); }
        case 1u: { return textureLoad(group_y, voxel, 0); }
        default: { return textureLoad(group_z, voxel, 0); }
    }
}

fn light_of(ray: Ray, hit: Hit) -> vec3<f32> {
    var texel: vec4<f32>;
    if hit.group == 0u {
        texel = light_of_world(ray, hit);
    } else {
        texel = light_of_group(ray, hit);
    }
    return texel.rgb / max(texel.a, 1e-6) * unit[0];
}
#endif

@compute @workgroup_size(8, 8)
fn show_voxels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(picture);
    if any(id.xy >= size) {
        return;
    }
    let ray = ray_through(id.xy, size);
    let hit = trace(ray);
    var color = vec3<f32>(0.0);
    if hit.found {
#ifdef VOXEL_LIGHT
        color = light_of(ray, hit) * view.exposure;
#else
#ifdef VOXEL_NORMAL
        color = hit.normal * 0.5 + 0.5;
#else
        color = unpack4x8unorm(cells[hit.cell].albedo).rgb;
#endif
#endif
    }
    textureStore(picture, id.xy, vec4<f32>(color, 1.0));
}
