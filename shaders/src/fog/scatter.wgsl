// What a volume of fog scatters of bounced light, to the eye, and what share of light from behind it takes.
//
// A ray through the volume as Bevy's `volumetric_fog.wgsl` marches it, so that light here and the picture there are dimmed alike: the
// same start, length, steps and jitter, the same density, and the same loss on the way from where light comes from, which Bevy
// takes to be the radius of the volume whatever the light. Like there, a ray is as long as it is deep.
//
// Cost: a thread a pixel; for each step in the volume a lookup for the light and one for the density, about 40 operations.

#import bevy_pbr::utils::interleaved_gradient_noise
#import bevy_render::view::View
#import bevy_bounce::fog::rays::{eye_ray, uv_to_ndc, position_in_view}
#import bevy_bounce::fog::types::{FogParameters, FroxelParameters, froxel_slice}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> fog: FogParameters;
/// Reverse depth.
#ifdef MULTISAMPLED
@group(0) @binding(2) var depth_texture: texture_multisampled_2d<f32>;
#else
@group(0) @binding(2) var depth_texture: texture_2d<f32>;
#endif
@group(0) @binding(3) var<uniform> froxels: FroxelParameters;
/// Pre-exposed radiance per unit of what scatters.
@group(0) @binding(4) var froxel_texture: texture_3d<f32>;
@group(0) @binding(5) var froxel_sampler: sampler;
@group(0) @binding(6) var density_texture: texture_3d<f32>;
@group(0) @binding(7) var density_sampler: sampler;

/// Share of the background below which Bevy's march ends.
const OPAQUE: f32 = 0.001;

// A ray's part within the fog, world space.
struct Segment {
    start: vec3<f32>,
    direction: vec3<f32>,
    // World units from the eye to its start, as froxels count them.
    distance: f32,
    // How much deeper its end is than its start; 0 where there is none.
    depth: f32,
}

fn segment_at(pixel: vec2<f32>, uv: vec2<f32>) -> Segment {
    let ndc = uv_to_ndc(uv);
    let ray = eye_ray(view, ndc);
    let eye = (fog.local_from_world * vec4<f32>(ray.origin, 1.0)).xyz;
    let along = (fog.local_from_world * vec4<f32>(ray.direction, 0.0)).xyz;
    let slope = select(along, vec3<f32>(1e-20), abs(along) < vec3<f32>(1e-20));
    let low = (-0.5 - eye) / slope;
    let high = (0.5 - eye) / slope;
    let enters = min(low, high);
    let leaves = max(low, high);
    let start = max(max(enters.x, enters.y), max(enters.z, 0.0));
    let end = min(leaves.x, min(leaves.y, leaves.z));

    var end_depth = ray.depth + ray.deepens * end;
    let depth = textureLoad(depth_texture, vec2<i32>(pixel), 0).x;
    if depth > 0.0 {
        end_depth = min(end_depth, -position_in_view(view, vec3<f32>(ndc, depth)).z);
    }
    let start_depth = ray.depth + ray.deepens * start;
    let position = ray.origin + ray.direction * start;
    return Segment(position, ray.direction, ray.distance + start, max(end_depth - start_depth, 0.0));
}

fn density_at(position: vec3<f32>) -> f32 {
    if fog.has_texture == 0u {
        return fog.density;
    }
    let uvw = (fog.local_from_world * vec4<f32>(position, 1.0)).xyz + 0.5;
    if any(uvw < vec3<f32>(0.0)) || any(uvw > vec3<f32>(1.0)) {
        return 0.0;
    }
    return fog.density * textureSampleLevel(density_texture, density_sampler, uvw + fog.density_offset, 0.0).r;
}

// Pre-exposed radiance; alpha: what of the light behind is taken.
@fragment
fn scatter(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let uv = (position.xy - view.viewport.xy) / view.viewport.zw;
    let segment = segment_at(position.xy, uv);
    if segment.depth == 0.0 {
        return vec4<f32>(0.0);
    }
    let extinction = fog.absorption + fog.scattering;
    let step_size = segment.depth / f32(fog.steps);
    let jitter = interleaved_gradient_noise(position.xy, view.frame_count) * fog.jitter;
    var transmittance = 1.0;
    var light = vec3<f32>(0.0);
    for (var i = 0u; i < fog.steps && transmittance >= OPAQUE; i++) {
        let along = jitter + f32(i) * step_size;
        let density = density_at(segment.start + segment.direction * along);
        transmittance *= exp(-step_size * density * extinction);
        if density > 0.0 {
            let slice = froxel_slice(froxels, segment.distance + along);
            let radiance = textureSampleLevel(froxel_texture, froxel_sampler, vec3<f32>(uv, slice), 0.0).rgb;
            let on_the_way = exp(-density * fog.radius * extinction);
            light += radiance * (transmittance * on_the_way * fog.scattering * density * step_size);
        }
    }
    return vec4<f32>(light * fog.color, 1.0 - transmittance);
}
