// Bounced light at each pixel from the texels of baked objects: the final gather. Ritschel, Grosch, Kautz and Seidel 2008, 4.4.
//
// The pixel's own position and normal receive, so that normal maps count. Of several objects, the texel that it is on is looked
// up in the hierarchies: its cube map knows what of its own object hides the others.
//
// Glossy light is radiance convolved with the pixel's lobe; what of it the surface reflects is for the picture to say.
//
// With `CUT` the picture is of how many nodes each pixel gathers from, instead of light.
//
// Cost: one thread a pixel; see cssm/gather.wgsl and cssm/locate.wgsl.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{gather, Gathered, Receiver}
#import bevy_bounce::interleaved::surface::unpack_surface
#import bevy_bounce::shared::sampling::hash
#ifdef CUT
#import bevy_bounce::debug::heat::heat
#endif
#ifdef SEVERAL
#import bevy_bounce::cssm::locate::locate
#import bevy_bounce::cssm::texels::load_texel
#import bevy_bounce::shared::scene::NONE
#endif

@group(0) @binding(5) var<uniform> view: View;
@group(0) @binding(6) var surface_texture: texture_2d<u32>;
@group(0) @binding(7) var output: texture_storage_2d<rgba16float, write>;
#ifdef GLOSSY
@group(0) @binding(8) var deferred_texture: texture_2d<u32>;
@group(0) @binding(9) var glossy: texture_storage_2d<rgba16float, write>;

// Towards the eye.
fn view_direction(position: vec3<f32>) -> vec3<f32> {
    if view.clip_from_view[3].w == 1.0 {
        return view.world_from_view[2].xyz;
    }
    return normalize(view.world_position - position);
}

// Roughness and largest reflectance straight on, as bevy_pbr/src/deferred/pbr_deferred_functions.wgsl packs and
// bevy_pbr/src/render/pbr_functions.wgsl defines them.
fn read_material(receiver: ptr<function, Receiver>, deferred: vec4<u32>) {
    let base = unpack4x8unorm(deferred.r);
    let properties = unpack4x8unorm(deferred.b);
    let dielectric = 0.16 * properties.r * properties.r;
    let color = pow(max(base.r, max(base.g, base.b)), 2.2);
    (*receiver).roughness = base.a;
    (*receiver).f_zero = mix(dielectric, color, properties.g);
}
#endif

@compute @workgroup_size(8, 8)
fn pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
    var gathered = Gathered();
    if surface.valid {
        var receiver: Receiver;
        receiver.position = surface.position;
        receiver.normal = surface.normal;
#ifdef SEVERAL
        let found = locate(surface.position, surface.normal);
        receiver.object = found.object;
        if found.object != NONE {
            receiver.texel = load_texel(found.object, found.texel);
        }
#endif
#ifdef GLOSSY
        receiver.view = view_direction(surface.position);
        read_material(&receiver, textureLoad(deferred_texture, id.xy + vec2<u32>(view.main_pass_viewport.xy), 0));
#endif
        gathered = gather(receiver, hash(id.x + id.y * size.x));
    }
#ifdef CUT
    textureStore(output, id.xy, vec4<f32>(heat(gathered.cut), 1.0));
#else
    let light = gathered.light * view.exposure;
    textureStore(output, id.xy, vec4<f32>(min(light, vec3<f32>(6e4)), 1.0));
#ifdef GLOSSY
    textureStore(glossy, id.xy, vec4<f32>(min(gathered.glossy * view.exposure, vec3<f32>(6e4)), 1.0));
#endif
#endif
}
