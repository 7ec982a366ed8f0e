// The light of the hierarchies' nodes: what each texel sends into its leaf, then level by level what is below each node. The
// paper's pull (section 4.1).
//
// Cost: `leaves` one thread a texel, `pull` one a node of the level; a descent from the root each. `pull_top` one a
// node over the objects, a read for each object below it.

#import bevy_bounce::cssm::texels::{bakes, load_texel, object_of, reflectance, scale_of}
#import bevy_bounce::cssm::tree::{leaf_node, level_node, node_count, top_node_count, top_place}
#import bevy_bounce::cssm::types::CssmLevel
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::scene::NONE

@group(0) @binding(2) var<storage, read> tree: array<vec4<u32>>;
// Of each node, two for a place of light, then of those over the objects: sum of radiance times area, and of the area.
@group(0) @binding(3) var<storage, read_write> powers: array<vec4<f32>>;
// Of each texel: radiance without bounces, share reflected at the surface; irradiance over pi by bounces.
@group(0) @binding(4) var<storage, read> sources: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> gathered: array<vec4<f32>>;
@group(0) @binding(6) var<uniform> level: CssmLevel;

@compute @workgroup_size(64)
fn leaves(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group) * 64u + lane;
    if light >= bakes.lights {
        return;
    }
    let object = object_of(light);
    let bake = &bakes.objects[object];
    let rank = light - (*bake).first_light;
    let index = tree[(*bake).first_node + node_count(object) + rank / 4u][rank % 4u];
    let texel = load_texel(object, index);
    let at = (*bake).first_light + index;
    let radiance = sources[at].rgb + reflectance(texel, sources[at].w) * gathered[at].rgb;
    powers[2u * (*bake).first_light + leaf_node(object, rank)] = vec4<f32>(radiance, 1.0) * texel.area;
}

@compute @workgroup_size(64)
fn pull(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    // One after the other, the complete rows of the objects that have that level.
    var place = folded_index(group) * 64u + lane;
    let row = 1u << level.level;
    var object = 0u;
    while object < bakes.count && (place >= row || level.level >= bakes.objects[object].levels) {
        place -= select(0u, row, level.level < bakes.objects[object].levels);
        object++;
    }
    if object == bakes.count {
        return;
    }
    let found = level_node(object, level.level, place);
    let count = found.y;
    if count > 1u {
        let node = 2u * bakes.objects[object].first_light + found.x;
        powers[node] = powers[node + 1u] + powers[node + 2u * ((count + 1u) / 2u)];
    }
}

// From the roots of the objects, in the world's units of area.
@compute @workgroup_size(64)
fn pull_top(@builtin(global_invocation_id) id: vec3<u32>) {
    let node = id.x;
    if node >= top_node_count() {
        return;
    }
    var sum = vec4<f32>(0.0);
    for (var below = node; below < bakes.top[node].skip; below++) {
        let object = bakes.top[below].object;
        if object != NONE {
            let scale = scale_of(object);
            sum += powers[2u * bakes.objects[object].first_light] * (scale * scale);
        }
    }
    powers[top_place(node)] = sum;
}
