// What the texels of baked objects emit: the emission of the material that their triangles have now, with its texture. And what share
// of light that material reflects at its surface, before its colour.
//
// Cost: one thread a texel; a triangle and a word of a thumbnail each.

#import bevy_bounce::cssm::types::CssmSurface
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::scene::NONE
#import bevy_bounce::shared::triangles::{load_triangle, materials, surface_emission}

@group(0) @binding(4) var<storage, read> surfaces: array<CssmSurface>;
// Of each part, its instance, or NONE.
@group(0) @binding(5) var<storage, read> part_instances: array<u32>;
// Of each texel, radiance without bounces, cd/m^2; share reflected at the surface.
@group(0) @binding(6) var<storage, read_write> sources: array<vec4<f32>>;

@compute @workgroup_size(64)
fn emit(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * 64u + lane;
    if index >= arrayLength(&surfaces) {
        return;
    }
    let surface = surfaces[index];
    var source = vec4<f32>(0.0);
    if surface.part != NONE && part_instances[surface.part] != NONE {
        let t = load_triangle(part_instances[surface.part], surface.triangle, vec3<f32>(0.0), 1.0);
        if t.valid {
            let weights = unpack2x16unorm(surface.barycentric);
            let point = t.a + (t.b - t.a) * weights.x + (t.c - t.a) * weights.y;
            source = vec4<f32>(surface_emission(t, point), materials[t.material].specular);
        }
    }
    sources[index] = source;
}
