// Bounced light from a sixteenth of the virtual lights, at each pixel or at every second one of every second row, beside what near
// ones bring to all (`near.wgsl`). Interleaved sampling, Keller & Heidrich 2001, Segovia et al. 2006; Bashford-Rogers et al. 2012, III-C.
//
// A workgroup takes 8x8 texels of one of the sixteen sub-images that the 4x4 blocks fall into, so that all its threads read
// the same lights in the same order. The split and the join are in the addressing: no copy of the G-buffer is made.
//
// Cost: see `gather.wgsl`; a sixteenth of the lights a texel.

#import bevy_render::view::View
#import bevy_bounce::interleaved::brightest::BRIGHTEST_PART
#import bevy_bounce::interleaved::gather::{gather_subset, Gathered}
#import bevy_bounce::interleaved::surface::{unpack_surface, toward_eye, texels_shaded, PIXELS_A_TEXEL}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;
// What near lights bring.
@group(0) @binding(7) var near_texture: texture_2d<f32>;
#ifdef SKY_SEEN
@group(0) @binding(8) var sky_seen: texture_storage_2d<rgba16float, write>;
#endif

const BLOCK: u32 = 4u;
const TILE: u32 = 8u;

@compute @workgroup_size(8, 8)
fn shade(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    let texels = texels_shaded(size);
    let tiles = (texels + (BLOCK * TILE - 1u)) / (BLOCK * TILE);
    let offset = group.xy / tiles;
    let texel = ((group.xy % tiles) * TILE + local.xy) * BLOCK + offset;
    if any(texel >= texels) {
        return;
    }
    let pixel = texel * PIXELS_A_TEXEL;
    let surface = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, size, view);
    var gathered = Gathered(vec3<f32>(0.0), vec2<f32>(0.0));
    if surface.valid {
        gathered = gather_subset(surface, toward_eye(view, surface.position), offset);
    }
    let light = gathered.light * view.exposure + textureLoad(near_texture, texel, 0).rgb;
    textureStore(output, texel, vec4<f32>(min(light, vec3<f32>(BRIGHTEST_PART)), 1.0));
#ifdef SKY_SEEN
    textureStore(sky_seen, texel, vec4<f32>(gathered.sky_seen, 0.0, 1.0));
#endif
}
