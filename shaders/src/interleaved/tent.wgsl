// Mean of a surface's light along a row or a column of texels, weighted by a tent: rows first and then columns give the mean
// over a tent in both directions, at every pixel, also where a texel is two pixels wide.
//
// Cost: a load; two more, and some 40 operations, a texel of the tent. Where it is known which of them are of the surface, one load a
// texel, and some ten operations.

#define_import_path bevy_bounce::interleaved::tent

#import bevy_bounce::interleaved::surface::{Surface, Lens, NORMAL_EDGE, PLANE_EDGE}
#import bevy_bounce::shared::octahedral::decode_direction

/// Texels from the middle of the tent to where it ends: it weighs the sixteen subsets of the virtual lights alike, wherever it
/// stands.
const TENT_REACH: u32 = 4u;

/// Share of the samples below which a pixel is better off by itself.
const TENT_FEW: f32 = 0.125;

/// Beside the bits of texels: that those of a surface were looked for.
const TOLD: u32 = 256u;

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

// A linear function of homogeneous coordinates, relative to the eye, as one along a line: what it is at its start, by how much it grows
// with each texel, and with reverse-z depth.
fn along(lens: Lens, line: Line, tent: Tent, function: vec4<f32>) -> vec3<f32> {
    let start = vec2<f32>(line.pixel) + 0.5;
    let step = vec2<f32>(line.axis * tent.scale);
    // Of world coordinates.
    let of_world = vec4<f32>(function.xyz, function.w - dot(function.xyz, lens.eye));
    let slope = vec2<f32>(dot(of_world, lens.x), dot(of_world, lens.y));
    return vec3<f32>(dot(of_world, lens.origin) + dot(slope, start), dot(slope, step), dot(of_world, lens.depth));
}

struct Mean {
    // Alpha: share of the samples that it is the mean of.
    light: vec4<f32>,
    // Of the texels of the tent, from its first on, bits of those that are of the surface.
    texels: u32,
}

// Texels of a line that a tent may weigh.
struct Span {
    // May lie before the line.
    first: i32,
    end: i32,
    // Where the tent stands.
    middle: f32,
}

fn span_of(line: Line, tent: Tent) -> Span {
    let middle = f32(line.place) / f32(tent.scale);
    let first = i32(middle) - (i32(tent.reach) - 1);
    // At half resolution it may stand between texels.
    let end = min(first + 2 * i32(tent.reach) - 2 + i32(tent.scale), i32((line.pixels + tent.scale - 1u) / tent.scale));
    return Span(first, end, middle);
}

fn weighed(light_texture: texture_2d<f32>, line: Line, tent: Tent, span: Span, texel: i32) -> vec4<f32> {
    let light = textureLoad(light_texture, line.texel + line.axis * u32(texel), 0);
    return vec4<f32>(light.rgb, 1.0) * (light.a * (f32(tent.reach) - abs(f32(texel) - span.middle)));
}

fn mean_of(sum: vec4<f32>, tent: Tent) -> vec4<f32> {
    return vec4<f32>(sum.rgb / max(sum.w, 1e-6), sum.w / f32(tent.reach * tent.reach));
}

// Of texels whose surface is that of the middle's, as `is_same_surface` has it: by how far off its plane they are, without their places
// in the world, far from whose origin these are coarse.
fn line_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, line: Line, tent: Tent,
) -> Mean {
    let span = span_of(line, tent);
    let depth = bitcast<f32>(textureLoad(surfaces, line.pixel + line.axis * line.place, 0).x);
    let center_place = vec3<f32>(1.0, span.middle, depth);
    let w = along(lens, line, tent, vec4<f32>(0.0, 0.0, 0.0, 1.0));
    let across = along(lens, line, tent, vec4<f32>(center.normal, 0.0));
    let height = across - w * (dot(across, center_place) / dot(w, center_place));
    let range = PLANE_EDGE * center.footprint;
    var sum = vec4<f32>(0.0);
    var texels = 0u;
    for (var i = max(span.first, 0); i < span.end; i++) {
        let pixel = line.pixel + line.axis * (u32(i) * tent.scale);
        let surface = textureLoad(surfaces, pixel, 0).xy;
        let place = vec3<f32>(1.0, f32(i), bitcast<f32>(surface.x));
        let is_in_plane = place.z > 0.0 && abs(dot(height, place)) < range * abs(dot(w, place));
        let direction = decode_direction(surface.y);
        let facing = dot(center.normal, direction);
        if is_in_plane && facing * abs(facing) > NORMAL_EDGE * NORMAL_EDGE * dot(direction, direction) {
            sum += weighed(light_texture, line, tent, span, i);
            texels |= 1u << u32(i - span.first);
        }
    }
    return Mean(mean_of(sum, tent), texels);
}

fn row(y: u32, x: u32, surfaces: texture_2d<u32>, tent: Tent) -> Line {
    let start = vec2<u32>(0u, y);
    return Line(start, start * tent.scale, vec2<u32>(1u, 0u), x, textureDimensions(surfaces).x);
}

fn column(x: u32, y: u32, surfaces: texture_2d<u32>) -> Line {
    let start = vec2<u32>(x, 0u);
    return Line(start, start, vec2<u32>(0u, 1u), y, textureDimensions(surfaces).y);
}

/// Mean of the light of a surface along a row of texels, at the pixel of number `id.x`. Alpha, of `light_texture` too: share of
/// the samples that it is the mean of.
fn row_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, id: vec2<u32>, tent: Tent,
) -> vec4<f32> {
    return line_mean(lens, surfaces, light_texture, center, row(id.y, id.x, surfaces, tent), tent).light;
}

/// The same along a column of such means, at a pixel.
fn column_mean(
    lens: Lens, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, center: Surface, id: vec2<u32>, tent: Tent,
) -> Mean {
    return line_mean(lens, surfaces, light_texture, center, column(id.x, id.y, surfaces), tent);
}

/// The same, of texels that are known.
fn column_mean_of(
    texels: u32, surfaces: texture_2d<u32>, light_texture: texture_2d<f32>, id: vec2<u32>, tent: Tent,
) -> vec4<f32> {
    let line = column(id.x, id.y, surfaces);
    let span = span_of(line, tent);
    var sum = vec4<f32>(0.0);
    for (var i = max(span.first, 0); i < span.end; i++) {
        if (texels & (1u << u32(i - span.first))) != 0u {
            sum += weighed(light_texture, line, tent, span, i);
        }
    }
    return mean_of(sum, tent);
}
