// The residual as the mean over a tent within its surface, the one through which bounded light goes: what each has lost, or
// holds too much, next to a seam, the other has there. Where both are of one resolution it takes the samples that bounded light
// is the mean of: where a seam passes between them, what falls through is missing from one and left over in the other. At half
// resolution a pixel for which the tent finds too few samples of its surface goes on the list, as that of bounded light is shaded
// anew.
//
// There the filter of bounded light has said which texels of a column are of the pixel's surface (`SAME_TEXELS`).
//
// Cost: 23 loads a pixel where both are of one resolution.

#import bevy_bounce::interleaved::surface::{Surface, Lens}
#ifdef SAME_TEXELS
#import bevy_bounce::interleaved::tent::{Tent, row_mean, column_mean_of, TENT_FEW}
#else
#import bevy_bounce::interleaved::tent::{Tent, row_mean, column_mean, TENT_FEW}
#endif
#import bevy_bounce::ssbc::common::{parameters, surface_texture, surface_at, view_lens}
#import bevy_bounce::ssbc::list::list_pixels

// At its own texels, then the means along rows.
@group(0) @binding(3) var light_texture: texture_2d<f32>;
@group(0) @binding(4) var output: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn blur_rows(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= textureDimensions(surface_texture).x || id.y >= textureDimensions(light_texture).y {
        return;
    }
    let lens = view_lens();
    let center = surface_at(lens, vec2<u32>(id.x, id.y * parameters.scale));
    var light = vec4<f32>(0.0);
    if center.valid {
        let tent = Tent(parameters.reach, parameters.scale);
        light = row_mean(lens, surface_texture, light_texture, center, id.xy, tent);
    }
    textureStore(output, id.xy, light);
}

#ifdef SAME_TEXELS
// Alpha: as in `interleaved/filter.wgsl`.
@group(0) @binding(6) var bounded: texture_2d<f32>;
#endif

fn mean_of_column(lens: Lens, center: Surface, pixel: vec2<u32>) -> vec4<f32> {
    let tent = Tent(parameters.reach, parameters.scale);
#ifdef SAME_TEXELS
    return column_mean_of(u32(textureLoad(bounded, pixel, 0).a), surface_texture, light_texture, pixel, tent);
#else
    return column_mean(lens, surface_texture, light_texture, center, pixel, tent).light;
#endif
}

@compute @workgroup_size(8, 8)
fn blur_columns(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(surface_texture);
    let lens = view_lens();
    let inside = all(id.xy < size);
    let center = surface_at(lens, min(id.xy, size - 1u));
    var light = vec4<f32>(0.0);
    if center.valid && inside {
        light = mean_of_column(lens, center, id.xy);
    }
    if inside {
        textureStore(output, id.xy, vec4<f32>(light.rgb, 1.0));
    }
    let has_few = parameters.scale > 1u && inside && center.valid && light.a < TENT_FEW;
    list_pixels(id.xy, select(0u, 1u, has_few), lane);
}
