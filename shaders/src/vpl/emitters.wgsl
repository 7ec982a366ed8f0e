// Emissive triangles as area lights: where they are, what they emit, and the running sum of their power, so that paths start
// on them in proportion.
//
// Cost: one thread a triangle of the emissive meshes, then one workgroup over all of them.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::shared::scene::{Chunk, Scene, importance, CHUNK_TRIANGLES}
#import bevy_bounce::shared::triangles::{Triangle, load_triangle, surface_emission, surface_cover}
#import bevy_bounce::vpl::types::{Emitter, VplParameters, luminance}

@group(0) @binding(4) var<storage, read> emissive_chunks: array<Chunk>;
@group(0) @binding(5) var<storage, read_write> emitters: array<Emitter>;
@group(0) @binding(6) var<uniform> scene: Scene;

const GROUP: u32 = 256u;

var<workgroup> scratch: array<f32, 256>;

// Radiance around a point of a surface, holes included.
fn emitted(t: Triangle, p: vec3<f32>) -> vec3<f32> {
    return surface_emission(t, p) * surface_cover(t, p);
}

@compute @workgroup_size(64)
fn collect(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    if index >= scene.emissive_chunk_count {
        return;
    }
    let chunk = emissive_chunks[index];
    let t = load_triangle(chunk.instance, chunk.first_triangle + lane, vec3<f32>(0.0), 1.0);
    var emitter: Emitter;
    if t.valid {
        let sides = select(1.0, 2.0, t.two_sided);
        let area = 0.5 * length(cross(t.b - t.a, t.c - t.a));
        let mean = (emitted(t, mix(t.a, (t.b + t.c) * 0.5, 0.33))
            + emitted(t, mix(t.b, (t.a + t.c) * 0.5, 0.33))
            + emitted(t, mix(t.c, (t.a + t.b) * 0.5, 0.33))) / 3.0;
        emitter.position = t.a;
        emitter.edge_b = t.b - t.a;
        emitter.edge_c = t.c - t.a;
        emitter.normal = t.normal;
        emitter.two_sided = select(0u, 1u, t.two_sided);
        emitter.flux = mean * (PI * area * sides);
        emitter.cumulative_power = luminance(emitter.flux);
        if scene.region_count > 1u {
            emitter.cumulative_power *= importance(scene.regions[0], (t.a + t.b + t.c) / 3.0);
        }
    }
    emitters[index * CHUNK_TRIANGLES + lane] = emitter;
}

@compute @workgroup_size(256)
fn accumulate(@builtin(local_invocation_index) lane: u32) {
    let count = scene.emissive_chunk_count * CHUNK_TRIANGLES;
    var before = 0.0;
    for (var base = 0u; base < count; base += GROUP) {
        let index = base + lane;
        var value = 0.0;
        if index < count {
            value = emitters[index].cumulative_power;
        }
        scratch[lane] = value;
        workgroupBarrier();
        for (var step = 1u; step < GROUP; step <<= 1u) {
            let lower = select(0.0, scratch[max(lane, step) - step], lane >= step);
            workgroupBarrier();
            scratch[lane] += lower;
            workgroupBarrier();
        }
        if index < count {
            emitters[index].cumulative_power = before + scratch[lane];
        }
        before += scratch[GROUP - 1u];
        workgroupBarrier();
    }
}
