// Points spread over the surfaces, as they stand in the world this frame: each keeps its triangle and its place in it,
// but for a part of its disc's radius, so that discs hardly reach beyond the triangle's edges, and yet into its
// corners. Where a triangle has no room for that, its disc stands for the narrow ones around it, too, and is no larger
// than its share of their area. Of masked surfaces as many are there as the share of the surface around them; discs
// cover more than that, for they overlap.
//
// Cost: a thread a point, about 130 operations.

#import bevy_bounce::shadow_atlas::tile::AtlasParameters
#import bevy_bounce::shadow_atlas::types::{
    SurfacePoint, WorldPoint, POINT_NONE, POINT_TWO_SIDED, POINT_WIDE, disc_radius,
}
#import bevy_bounce::shared::octahedral::encode_unit
#import bevy_bounce::shared::sampling::{hash, unit_float}
#import bevy_bounce::shared::triangles::{Triangle, load_corners, surface_cover}

@group(0) @binding(4) var<storage, read> surface_points: array<SurfacePoint>;
@group(0) @binding(5) var<storage, read_write> world_points: array<WorldPoint>;
@group(0) @binding(6) var<uniform> parameters: AtlasParameters;

/// Of a disc's radius, how far its middle stays away from edges at least: as far as the disc still reaches corners of
/// 45 degrees, such as half a square has; the sine of half of that.
const INSET: f32 = 0.383;

// The circle within a triangle.
struct Incircle {
    center: vec3<f32>,
    radius: f32,
}

fn incircle(t: Triangle) -> Incircle {
    let sides = vec3<f32>(distance(t.b, t.c), distance(t.c, t.a), distance(t.a, t.b));
    let perimeter = max(sides.x + sides.y + sides.z, 1e-30);
    let center = (sides.x * t.a + sides.y * t.b + sides.z * t.c) / perimeter;
    return Incircle(center, length(cross(t.b - t.a, t.c - t.a)) / perimeter);
}

@compute @workgroup_size(64)
fn place_points(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&surface_points) {
        return;
    }
    let point = surface_points[id.x];
    let t = load_corners(point.instance, point.first_index, vec3<f32>(0.0), 1.0);
    let where_on = unpack2x16unorm(point.barycentric);
    let even = t.a + (t.b - t.a) * where_on.x + (t.c - t.a) * where_on.y;
    let inner = incircle(t);
    let is_wide = inner.radius > INSET * disc_radius(parameters.point_area, true);
    let inset = INSET * disc_radius(parameters.point_area, is_wide) / max(inner.radius, 1e-30);
    // Its edges move inwards by that much.
    let position = mix(even, inner.center, min(inset, 1.0));
    var normal = POINT_NONE;
    if t.valid && surface_cover(t, position) > unit_float(hash(id.x)) {
        let flags = select(0u, POINT_TWO_SIDED, t.two_sided) | select(0u, POINT_WIDE, is_wide);
        normal = (encode_unit(t.normal) & ~(POINT_TWO_SIDED | POINT_WIDE)) | flags;
    }
    world_points[id.x] = WorldPoint(position, normal);
}
