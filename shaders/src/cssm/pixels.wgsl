// Bounced light at each pixel from the texels of baked objects: the final gather. Ritschel, Grosch, Kautz and Seidel 2008, 4.4.
//
// The pixel's own position and normal receive, so that normal maps count. The texel that it is on is looked up in the hierarchies:
// its cube map knows what of its own object hides the others.
//
// Cost: one thread a pixel; see cssm/gather.wgsl and cssm/locate.wgsl.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{gather, hash, Receiver}
#import bevy_bounce::cssm::locate::locate
#import bevy_bounce::cssm::texels::{load_texel, Texel}
#import bevy_bounce::interleaved::surface::unpack_surface
#import bevy_bounce::shared::scene::NONE

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
        let found = locate(surface.position, surface.normal);
        var receiver = Receiver(surface.position, surface.normal, found.object, Texel());
        if found.object != NONE {
            receiver.texel = load_texel(found.object, found.texel);
        }
        light = gather(receiver, hash(id.x + id.y * size.x)).light * view.exposure;
    }
    textureStore(output, id.xy, vec4<f32>(min(light, vec3<f32>(6e4)), 1.0));
}
