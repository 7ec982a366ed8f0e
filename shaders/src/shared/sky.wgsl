// The sky's table: means over the texels of an octahedral map.

#define_import_path bevy_bounce::shared::sky

#import bevy_bounce::shared::octahedral::unit_to_octahedral

/// Edge of the table, texels.
const SKY_EDGE: u32 = 32u;
const SKY_TEXELS: u32 = SKY_EDGE * SKY_EDGE;
/// Share of its ambient light that Bevy's `ambient_light` has a white diffuse surface send: `F_AB` of
/// bevy_pbr/src/render/pbr_lighting.wgsl at a roughness of 1.
const AMBIENT_SHARE: f32 = (1.04 - 0.572) - 1.04 * (0.0425 - 0.0275);

struct Sky {
    rotation: vec4<f32>,
    radiance: vec3<f32>,
    samples: u32,
    max_bounces: u32,
    share: f32,
}

/// Texel in which a direction lies.
fn sky_texel(direction: vec3<f32>) -> u32 {
    let at = (unit_to_octahedral(direction) * 0.5 + 0.5) * f32(SKY_EDGE);
    let texel = min(vec2<u32>(max(at, vec2<f32>(0.0))), vec2<u32>(SKY_EDGE - 1u));
    return texel.y * SKY_EDGE + texel.x;
}
