// Joins the sixteen sub-images: a tent four texels to each side, along rows and then along columns, weighs every subset of the
// virtual lights alike wherever it stands, and leaves no steps between blocks. Samples across an edge are left out and the
// others weigh more. After Bashford-Rogers et al. 2012, III-C, whose 4x4 box weighs them alike, too, and shows its edges
// around near lights.
//
// At half resolution, a pixel for which that finds less than an eighth of the samples is lit by all lights.
//
// Alpha of the result says which texels of the column are of the pixel's surface, bits as a number, with `TOLD`; 0 where nothing is seen.
// The tents of bias compensation are over the same.
//
// What of the sky is seen is joined in the same way (`SKY_SEEN`), in two passes of its own.
//
// Cost: 28 loads a pixel; for one that is lit by all lights, as much as sixteen texels of `shade.wgsl` besides.

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, lens_of, surface_of, toward_eye, texels_shaded, PIXELS_A_TEXEL}
#import bevy_bounce::interleaved::tent::{Tent, Mean, row_mean, column_mean, TENT_FEW, TENT_REACH, TOLD}
#ifdef HALF_RESOLUTION
#import bevy_bounce::interleaved::brightest::BRIGHTEST_PART
#import bevy_bounce::interleaved::gather::{gather_all, gather_sky}
#endif

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;
// Light, or what of the sky is seen; share of the samples that it is the mean of.
@group(0) @binding(7) var light_texture: texture_2d<f32>;

const TENT: Tent = Tent(TENT_REACH, PIXELS_A_TEXEL);

#ifdef HALF_RESOLUTION
// From all lights, or all directions of the sky.
fn gathered(surface: Surface) -> vec3<f32> {
    let to_eye = toward_eye(view, surface.position);
#ifdef SKY_SEEN
    return vec3<f32>(gather_sky(surface, to_eye, 0u, 1u).sky_seen, 0.0);
#else
    return min(gather_all(surface, to_eye).light * view.exposure, vec3<f32>(BRIGHTEST_PART));
#endif
}
#endif

// A row of texels at every pixel of its breadth.
@compute @workgroup_size(8, 8)
fn filter_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if id.x >= size.x || id.y >= texels_shaded(size).y {
        return;
    }
    let lens = lens_of(view, size);
    let pixel = vec2<u32>(id.x, id.y * PIXELS_A_TEXEL);
    let center = surface_of(lens, textureLoad(surface_texture, pixel, 0).xy, pixel);
    var light = vec4<f32>(0.0);
    if center.valid {
        light = row_mean(lens, surface_texture, light_texture, center, id.xy, TENT);
    }
    textureStore(output, id.xy, light);
}

@compute @workgroup_size(8, 8)
fn filter_columns(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let lens = lens_of(view, size);
    let center = surface_of(lens, textureLoad(surface_texture, id.xy, 0).xy, id.xy);
    var mean = Mean(vec4<f32>(0.0), 0u);
    var told = 0u;
    if center.valid {
        mean = column_mean(lens, surface_texture, light_texture, center, id.xy, TENT);
#ifdef HALF_RESOLUTION
        if mean.light.a < TENT_FEW {
            mean.light = vec4<f32>(gathered(center), 1.0);
        }
#endif
        told = TOLD | mean.texels;
    }
    textureStore(output, id.xy, vec4<f32>(mean.light.rgb, f32(told)));
}
