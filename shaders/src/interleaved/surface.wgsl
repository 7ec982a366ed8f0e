// What a pixel of the G-buffer shows.

#define_import_path bevy_bounce::interleaved::surface

#import bevy_render::view::View
#import bevy_bounce::shared::octahedral::decode_unit

struct Surface {
    // World space.
    position: vec3<f32>,
    normal: vec3<f32>,
    // Edge of the pixel where the surface is, world units.
    footprint: f32,
    valid: bool,
}

fn unproject(view: View, ndc: vec3<f32>) -> vec3<f32> {
    let p = view.world_from_clip * vec4<f32>(ndc, 1.0);
    return p.xyz / p.w;
}

/// From a texel of the surface texture: bits of the reverse-z depth, octahedral normal.
fn unpack_surface(texel: vec2<u32>, pixel: vec2<u32>, size: vec2<u32>, view: View) -> Surface {
    let depth = bitcast<f32>(texel.x);
    let uv = (vec2<f32>(pixel) + 0.5) / vec2<f32>(size);
    let ndc = vec2<f32>(uv.x * 2.0 - 1.0, 1.0 - uv.y * 2.0);
    var surface: Surface;
    surface.valid = depth > 0.0;
    surface.position = unproject(view, vec3<f32>(ndc, max(depth, 1e-9)));
    surface.normal = decode_unit(texel.y);
    let next = unproject(view, vec3<f32>(ndc.x, ndc.y + 2.0 / f32(size.y), max(depth, 1e-9)));
    surface.footprint = distance(surface.position, next);
    return surface;
}

/// From a point on the way to the eye.
fn toward_eye(view: View, position: vec3<f32>) -> vec3<f32> {
    if view.clip_from_view[3].w == 1.0 {
        return view.world_from_view[2].xyz;
    }
    return normalize(view.world_position - position);
}

/// Edge of a texel at which light is shaded, pixels; it shows the first of them.
#ifdef HALF_RESOLUTION
const PIXELS_A_TEXEL: u32 = 2u;
#else
const PIXELS_A_TEXEL: u32 = 1u;
#endif

/// Texels at which light is shaded in a view of that many pixels.
fn texels_shaded(pixels: vec2<u32>) -> vec2<u32> {
    return (pixels + (PIXELS_A_TEXEL - 1u)) / PIXELS_A_TEXEL;
}

/// Cosine of the angle between normals beyond which there is an edge.
const NORMAL_EDGE: f32 = 0.85;
/// Pixels off the plane of the surface beyond which there is an edge.
const PLANE_EDGE: f32 = 2.0;

fn is_same_surface(a: Surface, b: Surface) -> bool {
    let off_plane = abs(dot(a.normal, b.position - a.position));
    return b.valid && dot(a.normal, b.normal) > NORMAL_EDGE && off_plane < PLANE_EDGE * a.footprint;
}
