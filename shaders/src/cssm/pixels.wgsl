// Bounced light at each pixel from the texels of a baked object: the final gather. Ritschel, Grosch, Kautz and Seidel 2008, 4.4.
//
// The pixel's own position and normal receive, so that normal maps count. Visibility is the senders', so that a pixel needs no
// texel of its own.
//
// Cost: one thread a pixel; see cssm/gather.wgsl.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{gather, hash}
#import bevy_bounce::cssm::texels::{to_object, turn_to_object}
#import bevy_bounce::interleaved::surface::unpack_surface

@group(0) @binding(5) var<uniform> view: View;
@group(0) @binding(6) var surface_texture: texture_2d<u32>;
@group(0) @binding(7) var output: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
    var light = vec3<f32>(0.0);
    if surface.valid {
        let normal = normalize(turn_to_object(surface.normal));
        light = gather(to_object(surface.position), normal, hash(id.x + id.y * size.x)).light * view.exposure;
    }
    textureStore(output, id.xy, vec4<f32>(min(light, vec3<f32>(6e4)), 1.0));
}
