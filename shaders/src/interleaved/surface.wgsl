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

/// World positions, in homogeneous coordinates, as a linear function of pixel coordinates and reverse-z depth.
struct Lens {
    origin: vec4<f32>,
    x: vec4<f32>,
    y: vec4<f32>,
    depth: vec4<f32>,
    // Edges of a pixel where w is 1, world units.
    right: vec3<f32>,
    down: vec3<f32>,
    // Length of the latter.
    pixel: f32,
    // World space.
    eye: vec3<f32>,
}

/// Of a view of that many pixels.
fn lens_of(view: View, size: vec2<u32>) -> Lens {
    let m = view.world_from_clip;
    let step = 2.0 / vec2<f32>(size);
    var lens: Lens;
    lens.origin = m[3] - m[0] + m[1];
    lens.x = m[0] * step.x;
    lens.y = -m[1] * step.y;
    lens.depth = m[2];
    // Where the near plane is oblique w changes across the picture, and what moves with it is the eye.
    lens.right = lens.x.xyz - view.world_position * lens.x.w;
    lens.down = lens.y.xyz - view.world_position * lens.y.w;
    lens.pixel = length(lens.down);
    lens.eye = view.world_position;
    return lens;
}

/// The same, of positions relative to a point.
fn relative_lens(lens: Lens, point: vec3<f32>) -> Lens {
    var relative = lens;
    relative.origin -= vec4<f32>(point * lens.origin.w, 0.0);
    relative.x -= vec4<f32>(point * lens.x.w, 0.0);
    relative.y -= vec4<f32>(point * lens.y.w, 0.0);
    relative.depth -= vec4<f32>(point * lens.depth.w, 0.0);
    relative.eye -= point;
    return relative;
}

/// World position of what is seen at those pixel coordinates, and the edge of a pixel there.
fn position_at(lens: Lens, pixel: vec2<f32>, depth: f32) -> vec4<f32> {
    let p = lens.origin + lens.x * pixel.x + lens.y * pixel.y + lens.depth * depth;
    return vec4<f32>(p.xyz / p.w, lens.pixel / abs(p.w));
}

/// From a texel of the surface texture: bits of the reverse-z depth, octahedral normal.
fn surface_of(lens: Lens, texel: vec2<u32>, pixel: vec2<u32>) -> Surface {
    let depth = bitcast<f32>(texel.x);
    let position = position_at(lens, vec2<f32>(pixel) + 0.5, max(depth, 1e-9));
    return Surface(position.xyz, decode_unit(texel.y), position.w, depth > 0.0);
}

/// The same in a view of that many pixels.
fn unpack_surface(texel: vec2<u32>, pixel: vec2<u32>, size: vec2<u32>, view: View) -> Surface {
    return surface_of(lens_of(view, size), texel, pixel);
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

/// `interleaved/tent.wgsl` asks the same for many along a line.
fn is_same_surface(a: Surface, b: Surface) -> bool {
    let off_plane = abs(dot(a.normal, b.position - a.position));
    return b.valid && dot(a.normal, b.normal) > NORMAL_EDGE && off_plane < PLANE_EDGE * a.footprint;
}
