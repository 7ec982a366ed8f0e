// A bounce of light between the texels of a baked object: refine and gather for every texel. The paper's figure 8.
//
// Cost: one thread a texel, in the order of the leaves, so that threads of a workgroup are near each other; see
// cssm/gather.wgsl.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::cssm::gather::{gather, leaf_texel, hash}
#import bevy_bounce::cssm::texels::{bake, load_texel}

// Of each texel: irradiance over pi, cd/m^2; nodes of its cut.
@group(0) @binding(5) var<storage, read_write> gathered: array<vec4<f32>>;


@compute @workgroup_size(64)
fn bounce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let rank = folded_index(group) * 64u + lane;
    if rank >= bake.texel_count {
        return;
    }
    let index = leaf_texel(rank);
    let texel = load_texel(index);
    let result = gather(texel.position, texel.normal, hash(index));
    gathered[index] = vec4<f32>(result.light, f32(result.cut));
}
