// What the passes of the bias compensation share: parameters, and where a texel of any level lies in the world.
//
// Level 0 is the view's pixels; a texel of level n covers 2^n pixels a side.

#define_import_path bevy_bounce::ssbc::common

#import bevy_render::view::View
#import bevy_bounce::interleaved::surface::{Surface, Lens, lens_of, position_at, surface_of}

struct SsbcParameters {
    solid_angle: f32,
    edge_solid_angle: f32,
    // Pixels a side of a texel of the residual: 1 or 2.
    scale: u32,
    // Where the tent ends that blurs the residual, texels of it.
    reach: u32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> parameters: SsbcParameters;
@group(0) @binding(2) var surface_texture: texture_2d<u32>;

fn view_lens() -> Lens {
    return lens_of(view, textureDimensions(surface_texture));
}

/// World position of what is seen at the middle of a texel, and the edge of the texel there.
fn texel_at(lens: Lens, texel: vec2<i32>, level: u32, depth: f32) -> vec4<f32> {
    let scale = f32(1u << level);
    return position_at(lens, (vec2<f32>(texel) + 0.5) * scale, depth) * vec4<f32>(1.0, 1.0, 1.0, scale);
}

/// What a pixel shows.
fn surface_at(lens: Lens, pixel: vec2<u32>) -> Surface {
    return surface_of(lens, textureLoad(surface_texture, pixel, 0).xy, pixel);
}

/// Cosine of 87 degrees.
const GRAZING: f32 = 0.052335956;

/// Surfaces seen at a more grazing angle are sampled too sparsely to stand for their area: what they send decays with the
/// square of the cosine. Novak et al. 2011, 4.3, from 80 degrees on: in a furnished room, where sills and ledges are seen so,
/// that takes a third of what there is to give back. Here the nearest pixels are polygons (`near.wgsl`).
fn grazing_decay(cosine: f32) -> f32 {
    let decay = clamp(cosine / GRAZING, 0.0, 1.0);
    return decay * decay;
}

/// An ellipse along the axes of the screen, pixels.
struct Disc {
    middle: vec2<f32>,
    radius: vec2<f32>,
    inverse_radius: vec2<f32>,
}

/// Where a sphere is seen; all of the screen where it reaches behind the eye. What it has in common with the sphere's picture
/// is the box round both: away from the middle of the screen that is a slanted ellipse, whose ends lie outside of this one.
/// Sigg et al. 2006, "GPU-Based Ray-Casting of Quadratic Surfaces".
fn sphere_on_screen(middle: vec3<f32>, radius: f32) -> Disc {
    let size = vec2<f32>(textureDimensions(surface_texture));
    let rows = transpose(view.clip_from_world);
    let clip = view.clip_from_world * vec4<f32>(middle, 1.0);
    let square = radius * radius;
    let ww = clip.w * clip.w - square * dot(rows[3].xyz, rows[3].xyz);
    if ww <= 0.0 {
        return Disc(0.5 * size, size, 1.0 / size);
    }
    let xx = clip.xy * clip.xy - square * vec2<f32>(dot(rows[0].xyz, rows[0].xyz), dot(rows[1].xyz, rows[1].xyz));
    let xw = clip.xy * clip.w - square * vec2<f32>(dot(rows[0].xyz, rows[3].xyz), dot(rows[1].xyz, rows[3].xyz));
    let half_size = 0.5 * size;
    let extent = sqrt(max(xw * xw - xx * ww, vec2<f32>(0.0)));
    let on_screen = max(extent / ww * half_size, vec2<f32>(1e-3));
    return Disc(half_size + vec2<f32>(xw.x, -xw.y) / ww * half_size, on_screen, 1.0 / on_screen);
}
