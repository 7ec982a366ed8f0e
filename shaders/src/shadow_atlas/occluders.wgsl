// The triangles that cast shadows, as they stand in the world this frame: of each mesh the level of detail chosen for it.
//
// Masked ones know how much of each of their parts is there (`masks.wgsl`), by the material's thumbnail at four places in each.
//
// With `BAKED` each knows the baked object that it is part of.
//
// Cost: a thread a triangle, about 100 operations; where it is masked, 64 loads and some 4000 operations more.

#ifdef BAKED
#import bevy_bounce::shared::scene::NONE
#endif
#import bevy_bounce::shadow_atlas::masks::{Cover, part_at, pack_cover, PARTS, PART_COUNT}
#import bevy_bounce::shadow_atlas::types::{
    Occluder, OccluderChunk, OCCLUDER_TWO_SIDED, OCCLUDER_ERROR_SHIFT, OCCLUDER_MOST_SHIFT, OCCLUDER_NAME_SHIFT,
}
#import bevy_bounce::shared::sampling::hash
#import bevy_bounce::shared::triangles::{Triangle, load_corners, surface_cover, is_masked}

@group(0) @binding(4) var<storage, read> occluder_chunks: array<OccluderChunk>;
@group(0) @binding(5) var<storage, read_write> occluders: array<Occluder>;
#ifdef BAKED
@group(0) @binding(6) var<storage, read> instance_objects: array<u32>;
#endif

/// Places along an edge of a part at which the mask is looked at.
const PLACES: u32 = 2u;

// How much is there of each part of a triangle between these corners: the mean over even places.
fn measure_cover(t: Triangle, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>) -> Cover {
    let edge = PLACES * PARTS;
    var shares = array<f32, PART_COUNT>();
    for (var row = 0u; row < edge; row++) {
        for (var i = 0u; i + 2u * row < 2u * edge - 1u; i++) {
            let middle = f32(1u + (i & 1u)) / 3.0;
            let weights = (vec2<f32>(vec2<u32>(i / 2u, row)) + middle) / f32(edge);
            let place = a + (b - a) * weights.x + (c - a) * weights.y;
            shares[part_at(weights)] += surface_cover(t, place) / f32(PLACES * PLACES);
        }
    }
    return pack_cover(shares);
}

@compute @workgroup_size(64)
fn place_occluders(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let chunk = occluder_chunks[group.x];
    if lane >= chunk.triangle_count {
        return;
    }
    let t = load_corners(chunk.instance, chunk.first_index + lane * 3u, vec3<f32>(0.0), 1.0);
    var occluder = Occluder();
    let is_seen = dot(cross(t.b - t.a, t.c - t.a), t.normal) > 0.0;
    let b = select(t.c, t.b, is_seen);
    let c = select(t.b, t.c, is_seen);
    var is_there = t.valid;
    var cover = Cover(0u, 0u);
    if t.valid && is_masked(t) {
        cover = measure_cover(t, t.a, b, c);
        is_there = cover.most != 0u;
    }
    if is_there {
        occluder.a = t.a;
        occluder.b = b;
        occluder.c = c;
        occluder.cover = cover.parts;
#ifdef BAKED
        occluder.object = NONE;
        if chunk.instance < arrayLength(&instance_objects) {
            occluder.object = instance_objects[chunk.instance];
        }
#endif
        let name = hash(hash(chunk.instance) ^ (chunk.first_index + lane * 3u)) << OCCLUDER_NAME_SHIFT;
        let sides = select(0u, OCCLUDER_TWO_SIDED, t.two_sided);
        occluder.flags = name | (cover.most << OCCLUDER_MOST_SHIFT) | (chunk.error << OCCLUDER_ERROR_SHIFT) | sides;
    }
    occluders[chunk.first_occluder + lane] = occluder;
}
