// A pixel next to the receiver as the polygon that it shows, not as a disk: where surfaces touch, the nearest pixels fill half
// of what is seen from there, and how far off their middles are is an accident of the raster.
//
// The polygon is the pixel's share of its plane. Across the seam of the two planes, as that lies on the screen, it goes on to
// the middle of a neighbour that rises from it: the seam is somewhere between the middles, and what lies beyond is below the
// receiver's horizon. Where something else stands in front, it is taken to go on behind that by half a pixel. The bound is
// subtracted from a whole polygon: what of it is above and below the bound balances. A pixel that is seen at a grazing angle is
// long, near at one end alone: it is taken in strips.
//
// Cost: four loads and some 300 operations a pixel, most of them once more for each strip after the first.

#define_import_path bevy_bounce::ssbc::near

#import bevy_bounce::interleaved::surface::{Surface, Lens, position_at, toward_eye}
#import bevy_bounce::shared::polygons::polygon_light
#import bevy_bounce::ssbc::common::{view, surface_texture, surface_at}

/// Cosine of the angle between normals up to which two pixels show one plane.
const ONE_PLANE: f32 = 0.95;
/// How far below the plane a pixel may seem to lie that touches it, pixels.
const SLACK: f32 = 0.05;
/// Length of a strip over the pixel's width, and how many there are at most.
const STRIP: f32 = 2.0;
const MOST_STRIPS: f32 = 8.0;

// How far a pixel's plane goes on towards a neighbour, pixels.
fn extent(lens: Lens, surface: Surface, neighbor: vec2<i32>) -> f32 {
    let size = vec2<i32>(textureDimensions(surface_texture));
    let next = surface_at(lens, vec2<u32>(clamp(neighbor, vec2<i32>(0), size - 1)));
    let rises = dot(surface.normal, next.position - surface.position) > -SLACK * surface.footprint;
    return select(0.5, 1.0, next.valid && rises && dot(surface.normal, next.normal) < ONE_PLANE);
}

// Reverse-z depth of a surface's plane as a linear function of pixel coordinates.
fn depth_of_plane(lens: Lens, surface: Surface) -> vec3<f32> {
    let equation = vec4<f32>(surface.normal, -dot(surface.normal, surface.position));
    let along = dot(equation, lens.depth);
    let sight = vec3<f32>(dot(equation, lens.x), dot(equation, lens.y), dot(equation, lens.origin));
    return -sight / select(along, 1e-20, abs(along) < 1e-20);
}

// Corners, relative to the receiver, of the part of a plane that lies between two points on the screen, pixels; the plane by
// its depth, as `depth_of_plane` has it.
fn part_of_plane(lens: Lens, receiver: Surface, depth: vec3<f32>, low: vec2<f32>, high: vec2<f32>) -> array<vec3<f32>, 4> {
    let ends = array<vec2<f32>, 4>(low, vec2<f32>(high.x, low.y), high, vec2<f32>(low.x, high.y));
    var corners: array<vec3<f32>, 4>;
    for (var i = 0; i < 4; i++) {
        let depth_there = max(dot(depth, vec3<f32>(ends[i], 1.0)), 1e-9);
        corners[i] = position_at(lens, ends[i], depth_there).xyz - receiver.position;
    }
    return corners;
}

/// Irradiance, of a pixel's radiance, from a pixel next to the receiver that is above the bound.
fn near_light(lens: Lens, receiver: Surface, bound: f32, pixel: vec2<i32>) -> f32 {
    let surface = surface_at(lens, vec2<u32>(pixel));
    let cosine = dot(surface.normal, toward_eye(view, surface.position));
    // At an edge that turns away the middle is below the receiver's horizon, at a seam above it.
    if cosine <= 0.0 || dot(receiver.normal, surface.position - receiver.position) <= 0.0 {
        return 0.0;
    }
    let depth = depth_of_plane(lens, surface);
    let across = abs(depth - depth_of_plane(lens, receiver)).xy;
    let step = select(vec2<i32>(0, 1), vec2<i32>(1, 0), across.x > across.y);
    let middle = vec2<f32>(pixel) + 0.5;
    let low = middle - max(vec2<f32>(0.5), vec2<f32>(step) * extent(lens, surface, pixel - step));
    let high = middle + max(vec2<f32>(0.5), vec2<f32>(step) * extent(lens, surface, pixel + step));
    let strips = clamp(ceil(1.0 / (cosine * STRIP)), 1.0, MOST_STRIPS);
    let along = select(vec2<f32>(0.0, 1.0), vec2<f32>(1.0, 0.0), abs(depth.x) > abs(depth.y));
    var light = 0.0;
    for (var strip = 0.0; strip < strips; strip += 1.0) {
        let start = mix(low, high, along * (strip / strips));
        let end = mix(high, low, along * (1.0 - (strip + 1.0) / strips));
        let found = polygon_light(part_of_plane(lens, receiver, depth, start, end), receiver.normal);
        light += max(found.x - bound * found.y, 0.0);
    }
    return light;
}
