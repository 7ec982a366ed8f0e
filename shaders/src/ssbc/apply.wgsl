// The residual onto the bounced light, which the blend of the pipeline adds it to: upsampled, and computed anew at pixels
// of whose surface too few samples are near. Cost: four loads a pixel, at those a whole integration.

#import bevy_bounce::interleaved::surface::unpack_surface
#import bevy_bounce::ssbc::common::{view, surface_texture}
#import bevy_bounce::ssbc::integrate::residual_light
#import bevy_bounce::ssbc::upsample::upsample

/// Weight of the samples below which upsampling fails.
const ENOUGH: f32 = 0.7;

@fragment
fn apply(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let surface = unpack_surface(textureLoad(surface_texture, pixel, 0).xy, pixel, textureDimensions(surface_texture), view);
    if !surface.valid {
        return vec4<f32>(0.0);
    }
    let light = upsample(surface, pixel);
    if light.w < ENOUGH {
        return vec4<f32>(residual_light(surface, pixel), 0.0);
    }
    return vec4<f32>(light.rgb, 0.0);
}
