// Light straight from the sky, at a point: rays through the voxel grid in some of the sky's directions.
//
// Cost: a ray for each direction that the surface faces; for the share of them that is seen, some 20 operations for each of all.

#define_import_path bevy_bounce::interleaved::sky

#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::rays::{is_blocked, to_grid, Ray}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene}
#import bevy_bounce::vpl::types::luminance

// Beside the grid.
@group(1) @binding(4) var<uniform> scene: Scene;
@group(1) @binding(5) var<storage, read> lights: array<Light>;

/// Longer than any way through the grid, voxels.
const FAR: f32 = 1e6;

struct SkyLight {
    // Irradiance over pi, cd/m^2.
    diffuse: vec3<f32>,
    // How much of the sky's light, by luminance, comes past what stands in its way: into the cosine lobe, and into `mirrored_lobe`.
    seen: vec2<f32>,
}

/// A lobe about the mirrored direction as wide as that of roughness .7: cos^6, for squared roughness of 1/2. Walter et al. 2007.
fn mirrored_lobe(cosine: f32) -> f32 {
    let square = max(cosine, 0.0) * max(cosine, 0.0);
    return square * square * square;
}

/// What a direction of the sky gives to both lobes of a surface that faces it.
fn lobes(light: Light, cosine: f32, mirrored: vec3<f32>) -> vec2<f32> {
    return luminance(light.color) * vec2<f32>(cosine, mirrored_lobe(-dot(light.direction, mirrored)));
}

/// Of all directions, without anything in their way.
fn open_sky(normal: vec3<f32>, mirrored: vec3<f32>) -> vec2<f32> {
    var sum = vec2<f32>(0.0);
    for (var i = scene.light_count; is_within(i, scene.light_count + scene.sky_count, normal.x); i++) {
        let cosine = -dot(normal, lights[i].direction);
        if cosine > 0.0 {
            sum += lobes(lights[i], cosine, mirrored);
        }
    }
    return sum;
}

/// By one of `step` directions, which stands for all. `on`: normal of the surface that the point is on, zero in the air. `gap`: voxels
/// around the point within which nothing blocks. `mirrored`: where a mirror would reflect the eye's rays.
fn sky_light(
    position: vec3<f32>,
    normal: vec3<f32>,
    on: vec3<f32>,
    mirrored: vec3<f32>,
    gap: f32,
    first: u32,
    step: u32,
) -> SkyLight {
    var ray: Ray;
    ray.origin = to_grid(position);
    ray.length = FAR;
    ray.start_normal = on;
    ray.gap = gap;
    var sum = SkyLight(vec3<f32>(0.0), vec2<f32>(0.0));
    for (var i = first; is_within(i, scene.sky_count, position.x); i += step) {
        let light = lights[scene.light_count + i];
        ray.direction = -light.direction;
        let cosine = dot(normal, ray.direction);
        if cosine > 0.0 && !is_blocked(ray) {
            sum.diffuse += light.color * cosine;
            sum.seen += lobes(light, cosine, mirrored);
        }
    }
    return SkyLight(sum.diffuse * (f32(step) / PI), sum.seen * f32(step));
}
