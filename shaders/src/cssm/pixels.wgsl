// Bounced light at each pixel from the texels of baked objects: the final gather. Ritschel, Grosch, Kautz and Seidel 2008, 4.4.
//
// The pixel's own position and normal receive, so that normal maps count. Of several objects, the texel that it is on is looked
// up in the hierarchies: its cube map knows what of its own object hides the others.
//
// Glossy light is radiance convolved with the pixel's lobe; what of it the surface reflects is for the picture to say.
//
// While everything rests, each frame lets other texels send, and a pixel has the mean of its frames; once there are as many as asked for,
// it costs no more than a load.
//
// With `CUT` the picture is of how many nodes each pixel gathers from, instead of light.
//
// Cost: one thread a pixel; see cssm/gather.wgsl and cssm/locate.wgsl.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{gather, settings, Gathered, Receiver}
#import bevy_bounce::interleaved::surface::{unpack_surface, toward_eye, Surface}
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
// Of each pixel that rests: mean light, frames and what it shows; then, with glossy light, the mean of that.
@group(0) @binding(8) var<storage, read_write> kept: array<vec4<u32>>;
#ifdef GLOSSY
@group(0) @binding(9) var deferred_texture: texture_2d<u32>;
@group(0) @binding(10) var glossy: texture_storage_2d<rgba16float, write>;
const KEPT_WORDS: u32 = 2u;

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
#else
const KEPT_WORDS: u32 = 1u;
#endif

fn gather_pixel(surface: Surface, deferred: vec4<u32>, pixel: u32, turn: u32) -> Gathered {
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
    receiver.view = toward_eye(view, surface.position);
    read_material(&receiver, deferred);
#endif
    return gather(receiver, hash(pixel), turn);
}

// What tells a pixel from one that shows something else: 24 bits.
fn key_of(texel: vec2<u32>, deferred: vec4<u32>) -> u32 {
    return hash(texel.x ^ hash(texel.y ^ hash(deferred.r ^ hash(deferred.b)))) >> 8u;
}

// A pixel's light; while everything rests, the mean over the frames in which it shows the same, this one among them.
fn pixel_light(surface: Surface, key: u32, deferred: vec4<u32>, pixel: u32) -> Gathered {
    let at = KEPT_WORDS * pixel;
    let is_mean = settings.frames > 1u;
    var frames = 0u;
    var mean = Gathered();
    if is_mean && settings.restart == 0u && (kept[at].w & 0xffffffu) == key {
        frames = kept[at].w >> 24u;
        mean.light = bitcast<vec3<f32>>(kept[at].xyz);
#ifdef GLOSSY
        mean.glossy = bitcast<vec3<f32>>(kept[at + 1u].xyz);
#endif
    }
    if frames == 0u || frames < settings.frames {
        let gathered = gather_pixel(surface, deferred, pixel, frames);
        frames += 1u;
        mean.light += (gathered.light - mean.light) / f32(frames);
#ifdef GLOSSY
        mean.glossy += (gathered.glossy - mean.glossy) / f32(frames);
#endif
        if is_mean {
            kept[at] = vec4<u32>(bitcast<vec3<u32>>(mean.light), (frames << 24u) | key);
#ifdef GLOSSY
            kept[at + 1u] = vec4<u32>(bitcast<vec3<u32>>(mean.glossy), 0u);
#endif
        }
    }
    return mean;
}

@compute @workgroup_size(8, 8)
fn pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let texel = textureLoad(surface_texture, id.xy, 0).xy;
    let surface = unpack_surface(texel, id.xy, size, view);
    let pixel = id.x + id.y * size.x;
    var deferred = vec4<u32>(0u);
#ifdef GLOSSY
    deferred = textureLoad(deferred_texture, id.xy + vec2<u32>(view.main_pass_viewport.xy), 0);
#endif
    var gathered = Gathered();
    if surface.valid {
#ifdef CUT
        gathered = gather_pixel(surface, deferred, pixel, 0u);
#else
        gathered = pixel_light(surface, key_of(texel, deferred), deferred, pixel);
#endif
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
