// The residual onto the bounced light, which the blend of the pipeline adds it to: upsampled, and computed anew at pixels
// of whose surface too few samples are near. Where no sample near has any, of whatever surface, none is taken to be: two
// surfaces that are near enough give to each other. A surface that is narrower than the samples are apart may lose its share.
//
// Cost: four loads a pixel, some eight more where a sample has light, at pixels that are computed anew a whole integration.

#import bevy_bounce::ssbc::common::{surface_at, view_lens}
#import bevy_bounce::ssbc::integrate::residual_light
#import bevy_bounce::ssbc::upsample::{is_lit_near, upsample}

/// Weight of the samples below which upsampling fails.
const ENOUGH: f32 = 0.7;

@fragment
fn apply(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    if !is_lit_near(pixel) {
        return vec4<f32>(0.0);
    }
    let lens = view_lens();
    let surface = surface_at(lens, pixel);
    if !surface.valid {
        return vec4<f32>(0.0);
    }
    let upsampled = upsample(lens, surface, pixel);
    if upsampled.weight < ENOUGH {
        return vec4<f32>(residual_light(lens, surface), 0.0);
    }
    return vec4<f32>(upsampled.light, 0.0);
}
