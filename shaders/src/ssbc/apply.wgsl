// The residual of each pixel onto the bounced light, which the blend of the pipeline adds it to.

#import bevy_pbr::rgb9e5::rgb9e5_to_vec3_

@group(0) @binding(0) var residual: texture_2d<u32>;

@fragment
fn apply(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(rgb9e5_to_vec3_(textureLoad(residual, vec2<u32>(position.xy), 0).x), 0.0);
}
