// The residual of each pixel onto the bounced light, which the blend of the pipeline adds it to.

@group(0) @binding(0) var residual: texture_2d<f32>;

@fragment
fn apply(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(textureLoad(residual, vec2<u32>(position.xy), 0).rgb, 0.0);
}
