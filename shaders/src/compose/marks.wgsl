// What the alpha of direct light, and of its diffuse part, says of a pixel.

#define_import_path bevy_bounce::compose::marks

/// A surface is lit there. Where none is, alpha is 0.
const LIT: f32 = 1.0;
/// A surface with a lightmap is, which has the light that bounces to it.
const LIGHTMAPPED: f32 = 0.5;

/// How much of the diffuse light that bounces to a pixel is added to it.
fn share_of_bounced_light(alpha: f32) -> f32 {
    return f32(alpha > 0.5 * (LIGHTMAPPED + LIT));
}
