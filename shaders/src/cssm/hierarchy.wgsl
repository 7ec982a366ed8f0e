// The light of the hierarchy's nodes: what each texel sends into its leaf, then level by level what is below each node. The
// paper's pull (section 4.1).
//
// Cost: `leaves` one thread a texel, `pull` one a node of the level; a descent from the root each.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::cssm::texels::{bake, load_texel}
#import bevy_bounce::cssm::tree::{leaf_node, level_node, node_count}
#import bevy_bounce::cssm::types::CssmLevel

@group(0) @binding(2) var<storage, read> tree: array<vec4<u32>>;
// Of each node: sum of radiance times area, and of the area.
@group(0) @binding(3) var<storage, read_write> powers: array<vec4<f32>>;
// Of each texel: radiance without bounces; irradiance over pi by bounces.
@group(0) @binding(4) var<storage, read> sources: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> gathered: array<vec4<f32>>;
@group(0) @binding(6) var<uniform> level: CssmLevel;


@compute @workgroup_size(64)
fn leaves(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let rank = folded_index(group) * 64u + lane;
    if rank >= bake.texel_count {
        return;
    }
    let index = tree[node_count() + rank / 4u][rank % 4u];
    let texel = load_texel(index);
    let radiance = sources[index].rgb + texel.diffuse * gathered[index].rgb;
    powers[leaf_node(rank)] = vec4<f32>(radiance, 1.0) * texel.area;
}

@compute @workgroup_size(64)
fn pull(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let place = folded_index(group) * 64u + lane;
    if place >= 1u << level.level {
        return;
    }
    let found = level_node(level.level, place);
    let node = found.x;
    let count = found.y;
    if count > 1u {
        powers[node] = powers[node + 1u] + powers[node + 2u * ((count + 1u) / 2u)];
    }
}
