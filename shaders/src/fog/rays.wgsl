// Rays from the eye through a picture.

#define_import_path bevy_bounce::fog::rays

#import bevy_render::view::View

// World space.
struct EyeRay {
    // On the near plane.
    origin: vec3<f32>,
    direction: vec3<f32>,
    // World units from the eye to there, or, where rays are parallel, from its plane.
    distance: f32,
    // Depth there.
    depth: f32,
    // And how fast it grows along the ray.
    deepens: f32,
}

fn position_in_view(view: View, ndc: vec3<f32>) -> vec3<f32> {
    let position = view.view_from_clip * vec4<f32>(ndc, 1.0);
    return position.xyz / position.w;
}

fn eye_ray(view: View, ndc: vec2<f32>) -> EyeRay {
    let near = position_in_view(view, vec3<f32>(ndc, 1.0));
    let is_parallel = view.clip_from_view[3].w == 1.0;
    let ahead = select(normalize(near), vec3<f32>(0.0, 0.0, -1.0), is_parallel);
    var ray: EyeRay;
    ray.origin = (view.world_from_view * vec4<f32>(near, 1.0)).xyz;
    ray.direction = normalize((view.world_from_view * vec4<f32>(ahead, 0.0)).xyz);
    ray.distance = select(length(near), -near.z, is_parallel);
    ray.depth = -near.z;
    ray.deepens = -ahead.z;
    return ray;
}

/// From a viewport's upper left corner, to normalized device coordinates.
fn uv_to_ndc(uv: vec2<f32>) -> vec2<f32> {
    return uv * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0);
}
