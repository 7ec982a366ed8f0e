// Light straight from the sky, at a point: rays through the voxel grid in some of the sky's directions.
//
// Cost: a ray for each direction that the surface faces.

#define_import_path bevy_bounce::interleaved::sky

#import bevy_bounce::shared::rays::{trace, to_grid, Ray}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Light, Scene}

// Beside the grid.
@group(1) @binding(3) var<uniform> scene: Scene;
@group(1) @binding(4) var<storage, read> lights: array<Light>;

/// Longer than any way through the grid, voxels.
const FAR: f32 = 1e6;

/// Irradiance over pi by one of `step` directions, which stands for all, cd/m^2. `on`: normal of the surface that the point is on, zero
/// in the air. `gap`: voxels around the point within which nothing blocks.
fn sky_light(position: vec3<f32>, normal: vec3<f32>, on: vec3<f32>, gap: f32, first: u32, step: u32) -> vec3<f32> {
    var ray: Ray;
    ray.origin = to_grid(position);
    ray.length = FAR;
    ray.start_normal = on;
    ray.gap = gap;
    var sum = vec3<f32>(0.0);
    for (var i = first; i < scene.sky_count; i += step) {
        let light = lights[scene.light_count + i];
        ray.direction = -light.direction;
        let cosine = dot(normal, ray.direction);
        if cosine > 0.0 && !trace(ray).found {
            sum += light.color * cosine;
        }
    }
    return sum * (f32(step) / PI);
}
