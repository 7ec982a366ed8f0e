// The residual onto the bounced light, which the blend of the pipeline adds it to: upsampled, and computed anew at pixels
// of whose surface too few samples are near. Where no sample near has any, of whatever surface, there is none: two surfaces
// that are near enough take from each other. Cost: four loads a pixel,
// where one has some eight more, at those a whole integration.

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
