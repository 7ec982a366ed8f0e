// A bounce of light between the texels of baked objects: refine and gather for every texel. The paper's figure 8.
//
// Cost: one thread a texel, in the order of the leaves, so that threads of a workgroup are near each other; see
// cssm/gather.wgsl.

#import bevy_bounce::cssm::gather::{gather, leaf_texel, Receiver}
#import bevy_bounce::cssm::texels::{bakes, load_texel, object_of, to_world, turn_to_world}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::sampling::hash

// Of each texel: irradiance over pi, cd/m^2; nodes of its cuts.
@group(0) @binding(5) var<storage, read_write> gathered: array<vec4<f32>>;

@compute @workgroup_size(64)
fn bounce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let at = folded_index(group) * 64u + lane;
    if at >= bakes.lights {
        return;
    }
    let object = object_of(at);
    let first = bakes.objects[object].first_light;
    let index = leaf_texel(object, at - first);
    let texel = load_texel(object, index);
    var receiver: Receiver;
    receiver.position = to_world(object, texel.position);
    receiver.normal = turn_to_world(object, texel.normal);
#ifdef SEVERAL
    receiver.object = object;
    receiver.texel = texel;
#endif
    let result = gather(receiver, hash(first + index), 0u);
    gathered[first + index] = vec4<f32>(result.light, f32(result.cut));
}
