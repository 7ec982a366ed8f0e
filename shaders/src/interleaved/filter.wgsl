// Joins the sixteen sub-images: a tent four texels to each side, along rows and then along columns, weighs every subset of the
// virtual lights alike wherever it stands, and leaves no steps between blocks. Samples across an edge are left out and the
// others weigh more. After Bashford-Rogers et al. 2012, III-C, whose 4x4 box weighs them alike, too, and shows its edges
// around near lights.
//
// At half resolution, a pixel for which that finds less than an eighth of the samples is lit by all lights.
//
// What of the sky is seen is joined in the same way (`SKY_SEEN`), in two passes of its own.
//
// Cost: 28 loads a pixel.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{
    Surface, unpack_surface, is_same_surface, toward_eye, texels_shaded, PIXELS_A_TEXEL,
}
#ifdef HALF_RESOLUTION
#import bevy_bounce::interleaved::gather::{gather_all, gather_sky}
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;
// Light, or what of the sky is seen; share of the samples that it is the mean of.
@group(0) @binding(7) var light_texture: texture_2d<f32>;

/// Texels from the middle of the tent to where it ends.
const REACH: i32 = 4;
/// Texels that a tent covers: at half resolution it may stand between them.
const TAPS: i32 = 2 * REACH - 2 + i32(PIXELS_A_TEXEL);
/// Share of the samples below which a pixel is shaded itself.
const FEW: f32 = 0.125;

fn surface_at(pixel: vec2<u32>) -> Surface {
    return unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, textureDimensions(surface_texture), view);
}

// Mean of the light of a surface along a row or column: `texel` is 0 along `axis`, `pixel` the pixel it shows, `place` where the
// tent stands, in texels, of `count`. Alpha: share of the samples.
fn tent(center: Surface, texel: vec2<u32>, pixel: vec2<u32>, axis: vec2<u32>, place: f32, count: u32) -> vec4<f32> {
    let first = i32(place) - (REACH - 1);
    var sum = vec4<f32>(0.0);
    for (var i = max(first, 0); i < min(first + TAPS, i32(count)); i++) {
        let other = surface_at(pixel + axis * (u32(i) * PIXELS_A_TEXEL));
        if is_same_surface(center, other) {
            let light = textureLoad(light_texture, texel + axis * u32(i), 0);
            sum += vec4<f32>(light.rgb, 1.0) * (light.a * (f32(REACH) - abs(f32(i) - place)));
        }
    }
    return vec4<f32>(sum.rgb / max(sum.w, 1e-6), sum.w / f32(REACH * REACH));
}

#ifdef HALF_RESOLUTION
// From all lights, or all directions of the sky.
fn gathered(surface: Surface) -> vec3<f32> {
    let to_eye = toward_eye(view, surface.position);
#ifdef SKY_SEEN
    return vec3<f32>(gather_sky(surface, to_eye, 0u, 1u).sky_seen, 0.0);
#else
    return min(gather_all(surface, to_eye).light * view.exposure, vec3<f32>(6e4));
#endif
}
#endif

// A row of texels at every pixel of its breadth.
@compute @workgroup_size(8, 8)
fn filter_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    let texels = texels_shaded(size);
    if id.x >= size.x || id.y >= texels.y {
        return;
    }
    let row = id.y * PIXELS_A_TEXEL;
    let center = surface_at(vec2<u32>(id.x, row));
    var light = vec4<f32>(0.0);
    if center.valid {
        let place = f32(id.x) / f32(PIXELS_A_TEXEL);
        light = tent(center, vec2<u32>(0u, id.y), vec2<u32>(0u, row), vec2<u32>(1u, 0u), place, texels.x);
    }
    textureStore(output, id.xy, light);
}

@compute @workgroup_size(8, 8)
fn filter_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let center = surface_at(id.xy);
    var light = vec4<f32>(0.0);
    if center.valid {
        let place = f32(id.y) / f32(PIXELS_A_TEXEL);
        let top = vec2<u32>(id.x, 0u);
        light = tent(center, top, top, vec2<u32>(0u, 1u), place, texels_shaded(size).y);
#ifdef HALF_RESOLUTION
        if light.w < FEW {
            light = vec4<f32>(gathered(center), 1.0);
        }
#endif
    }
    textureStore(output, id.xy, vec4<f32>(light.rgb, 1.0));
}
