// The triangles that cast shadows, as they stand in the world this frame: of each mesh the level of detail chosen for it.
//
// With `BAKED` each knows the baked object that it is part of.
//
// Cost: a thread a triangle, about 100 operations.

#ifdef BAKED
#import bevy_bounce::shared::scene::NONE
#endif
#import bevy_bounce::shared::triangles::{load_corners, surface_albedo, is_masked_out}
#import bevy_bounce::shadow_atlas::types::{Occluder, OccluderChunk, OCCLUDER_TWO_SIDED, OCCLUDER_ERROR_SHIFT}

@group(0) @binding(4) var<storage, read> occluder_chunks: array<OccluderChunk>;
@group(0) @binding(5) var<storage, read_write> occluders: array<Occluder>;
#ifdef BAKED
@group(0) @binding(6) var<storage, read> instance_objects: array<u32>;
#endif

@compute @workgroup_size(64)
fn place_occluders(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let chunk = occluder_chunks[group.x];
    if lane >= chunk.triangle_count {
        return;
    }
    let t = load_corners(chunk.instance, chunk.first_index + lane * 3u, vec3<f32>(0.0), 1.0);
    var occluder = Occluder();
    if t.valid && !is_masked_out(t, surface_albedo(t, (t.a + t.b + t.c) / 3.0).a) {
        let is_seen = dot(cross(t.b - t.a, t.c - t.a), t.normal) > 0.0;
        occluder.a = t.a;
        occluder.b = select(t.c, t.b, is_seen);
        occluder.c = select(t.b, t.c, is_seen);
#ifdef BAKED
        occluder.object = NONE;
        if chunk.instance < arrayLength(&instance_objects) {
            occluder.object = instance_objects[chunk.instance];
        }
#endif
        occluder.flags = (chunk.error << OCCLUDER_ERROR_SHIFT) | select(0u, OCCLUDER_TWO_SIDED, t.two_sided);
    }
    occluders[chunk.first_occluder + lane] = occluder;
}
