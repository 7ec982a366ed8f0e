// The residual as the mean over a tent within its surface, the one through which bounded light goes: what each has lost, or
// holds too much, next to a seam, the other has there. Where both are of one resolution it takes the samples that bounded light
// is the mean of: where a seam passes between them, what falls through is missing from one and left over in the other. At half
// resolution a pixel for which the tent finds too few samples of its surface goes on the list, as that of bounded light is shaded
// anew.
//
// Where the filter of bounded light has told which texels of a column are of a pixel's surface, none is looked at again
// (`SAME_TEXELS`: virtual lights, both of one resolution). What that has not told in this frame has no light.
//
// Cost: 28 loads a pixel where both are of one resolution, 22 where texels were told.

#import bevy_bounce::ssbc::common::{parameters, surface_texture, surface_at, view_lens}
#import bevy_bounce::ssbc::list::list_pixels
#ifdef SAME_TEXELS
#import bevy_bounce::interleaved::tent::{Tent, row_mean, column_mean_of, TENT_FEW}
#else
#import bevy_bounce::interleaved::tent::{Tent, row_mean, column_mean, TENT_FEW}
#endif

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

@compute @workgroup_size(8, 8)
fn blur_columns(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(surface_texture);
    let pixel = min(id.xy, size - 1u);
    let inside = all(id.xy < size);
    let tent = Tent(parameters.reach, parameters.scale);
    var light = vec4<f32>(0.0);
#ifdef SAME_TEXELS
    let told = u32(textureLoad(bounded, pixel, 0).a);
    let is_lit = inside && told != 0u;
    if is_lit {
        light = column_mean_of(told, surface_texture, light_texture, pixel, tent);
    }
#else
    let lens = view_lens();
    let center = surface_at(lens, pixel);
    let is_lit = inside && center.valid;
    if is_lit {
        light = column_mean(lens, surface_texture, light_texture, center, pixel, tent).light;
    }
#endif
    if inside {
        textureStore(output, id.xy, vec4<f32>(light.rgb, 1.0));
    }
    let has_few = parameters.scale > 1u && is_lit && light.a < TENT_FEW;
    list_pixels(id.xy, select(0u, 1u, has_few), lane);
}
