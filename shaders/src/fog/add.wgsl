// What all volumes of fog scatter, onto the picture, by additive blending.
//
// Cost: a thread a pixel, one load.

/// Pre-exposed radiance.
@group(0) @binding(0) var light_texture: texture_2d<f32>;

@fragment
fn add(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    return vec4<f32>(textureLoad(light_texture, vec2<i32>(position.xy), 0).rgb, 0.0);
}
