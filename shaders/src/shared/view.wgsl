// What a view sees, one texel a pixel of its main pass viewport: two words, the bits of the reverse-z depth (0: nothing that
// is to be lit) and the world-space normal, octahedral.

#define_import_path bevy_bounce::shared::view

#import bevy_bounce::shared::octahedral::{encode_unit, decode_unit}

/// The surface behind a pixel.
struct Surface {
    /// World space.
    position: vec3<f32>,
    /// Reverse-z depth; 0 for nothing to light.
    depth: f32,
    /// World space, unit length.
    normal: vec3<f32>,
}

/// World position of the centre of a pixel. `size`: of the viewport, in pixels.
fn world_position(pixel: vec2<u32>, size: vec2<u32>, depth: f32, world_from_clip: mat4x4<f32>) -> vec3<f32> {
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(size);
    let world = world_from_clip * vec4<f32>(uv * vec2<f32>(2.0, -2.0) + vec2<f32>(-1.0, 1.0), depth, 1.0);
    return world.xyz / world.w;
}

/// A texel of the surface texture.
fn pack_surface(depth: f32, normal: vec3<f32>) -> vec2<u32> {
    return vec2<u32>(bitcast<u32>(depth), encode_unit(normal));
}

/// What `pack_surface` packed. Position and normal mean nothing where `depth` is 0.
fn unpack_surface(texel: vec2<u32>, pixel: vec2<u32>, size: vec2<u32>, world_from_clip: mat4x4<f32>) -> Surface {
    let depth = bitcast<f32>(texel.x);
    return Surface(world_position(pixel, size, depth, world_from_clip), depth, decode_unit(texel.y));
}
