// Points spread over the surfaces, as they stand in the world this frame: each keeps its triangle and its place in it.
//
// Cost: a thread a point, about 100 operations.

#import bevy_bounce::shared::octahedral::encode_unit
#import bevy_bounce::shared::triangles::{load_corners, surface_albedo, is_masked_out}
#import bevy_bounce::shadow_atlas::types::{SurfacePoint, WorldPoint, POINT_NONE}

@group(0) @binding(4) var<storage, read> surface_points: array<SurfacePoint>;
@group(0) @binding(5) var<storage, read_write> world_points: array<WorldPoint>;

@compute @workgroup_size(64)
fn place_points(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= arrayLength(&surface_points) {
        return;
    }
    let point = surface_points[id.x];
    let t = load_corners(point.instance, point.first_index, vec3<f32>(0.0), 1.0);
    let where_on = unpack2x16unorm(point.barycentric);
    let position = t.a + (t.b - t.a) * where_on.x + (t.c - t.a) * where_on.y;
    var normal = POINT_NONE;
    if t.valid && !is_masked_out(t, surface_albedo(t, position).a) {
        // The lowest bit says whether both sides count.
        normal = (encode_unit(t.normal) & ~1u) | select(0u, 1u, t.two_sided);
    }
    world_points[id.x] = WorldPoint(position, normal);
}
