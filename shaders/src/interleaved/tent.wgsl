// Mean of a surface's light along a row or a column of texels, weighted by a tent: rows first and then columns give the mean
// over a tent in both directions, at every pixel, also where a texel is two pixels wide.
//
// Cost: two loads a texel of the tent.

#define_import_path bevy_bounce::interleaved::tent

#import bevy_bounce::interleaved::surface::{Surface, Lens, surface_of, is_same_surface}

/// Texels from the middle of the tent to where it ends: it weighs the sixteen subsets of the virtual lights alike, wherever it
/// stands.
const TENT_REACH: u32 = 4u;

/// Share of the samples below which a pixel is better off by itself.
const TENT_FEW: f32 = 0.125;

struct Tent {
    // Texels from its middle to where it ends.
    reach: u32,
    // Pixels a side of a texel, which shows the first of them: 1 or 2.
    scale: u32,
}

struct Line {
    // Its first texel, and the pixel that this shows.
    texel: vec2<u32>,
    pixel: vec2<u32>,
    // One of them is 1.
    axis: vec2<u32>,
    // Where the tent stands, pixels, of that many.
    place: u32,
    pixels: u32,
}

fn line_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, line: Line, tent: Tent,
) -> vec4<f32> {
    let reach = i32(tent.reach);
    let place = f32(line.place) / f32(tent.scale);
    let first = i32(place) - (reach - 1);
    // At half resolution it may stand between texels.
    let end = min(first + 2 * reach - 2 + i32(tent.scale), i32((line.pixels + tent.scale - 1u) / tent.scale));
    var sum = vec4<f32>(0.0);
    for (var i = max(first, 0); i < end; i++) {
        let pixel = line.pixel + line.axis * (u32(i) * tent.scale);
        if is_same_surface(center, surface_of(lens, textureLoad(surfaces, pixel, 0).xy, pixel)) {
            let light = textureLoad(light_texture, line.texel + line.axis * u32(i), 0);
            sum += vec4<f32>(light.rgb, 1.0) * (light.a * (f32(reach) - abs(f32(i) - place)));
        }
    }
    return vec4<f32>(sum.rgb / max(sum.w, 1e-6), sum.w / f32(reach * reach));
}

/// Mean of the light of a surface along a row of texels, at the pixel of number `id.x`. Alpha, of `light_texture` too: share of
/// the samples that it is the mean of.
fn row_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, id: vec2<u32>, tent: Tent,
) -> vec4<f32> {
    let y = vec2<u32>(0u, id.y);
    let line = Line(y, y * tent.scale, vec2<u32>(1u, 0u), id.x, textureDimensions(surfaces).x);
    return line_mean(lens, surfaces, light_texture, center, line, tent);
}

/// The same along a column of such means, at a pixel.
fn column_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, id: vec2<u32>, tent: Tent,
) -> vec4<f32> {
    let x = vec2<u32>(id.x, 0u);
    let line = Line(x, x, vec2<u32>(0u, 1u), id.y, textureDimensions(surfaces).y);
    return line_mean(lens, surfaces, light_texture, center, line, tent);
}
