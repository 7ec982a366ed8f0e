// Nodes of the hierarchies over baked objects' texels, as crate bevy_bounce packs them (`cssm::tree`): 128 bits each, in
// depth-first order, the first child behind its parent. A node halves its texels, the first half the larger one. Nodes over the objects
// (`cssm::top`) are in the same order.

#define_import_path bevy_bounce::cssm::tree

#import bevy_bounce::cssm::texels::bakes
#import bevy_bounce::shared::octahedral::octahedral_to_unit

struct Node {
    /// Sphere round the texels, in the object's space.
    center: vec3<f32>,
    radius: f32,
    /// Cone round their normals.
    axis: vec3<f32>,
    cosine: f32,
    /// The next node of the object without what is below this one.
    skip: u32,
}

fn unpack_node(object: u32, words: vec4<u32>) -> Node {
    let bake = &bakes.objects[object];
    let part = vec3<f32>(vec3<u32>(words.x & 0xffffu, words.x >> 16u, words.y & 0xffffu)) / 65535.0;
    let square = vec2<f32>(vec2<u32>(words.z & 0xfffu, (words.z >> 12u) & 0xfffu)) / 4095.0 * 2.0 - 1.0;
    var node: Node;
    node.center = (*bake).bounds_min + part * ((*bake).bounds_max - (*bake).bounds_min);
    node.radius = unpack2x16float(words.y).y;
    node.axis = octahedral_to_unit(square);
    let half_sine = f32(words.z >> 24u) / 255.0;
    node.cosine = 1.0 - 2.0 * half_sine * half_sine;
    node.skip = words.w;
    return node;
}

/// Nodes of an object's tree.
fn node_count(object: u32) -> u32 {
    return 2u * bakes.objects[object].texel_count - 1u;
}

/// Nodes over the objects.
fn top_node_count() -> u32 {
    return 2u * bakes.count - 1u;
}

/// Where the light of a node over the objects is, among that of all nodes.
fn top_place(node: u32) -> u32 {
    return 2u * bakes.lights + node;
}

/// Where the leaf of that rank is among an object's nodes.
fn leaf_node(object: u32, rank: u32) -> u32 {
    var node = 0u;
    var left = rank;
    var count = bakes.objects[object].texel_count;
    while count > 1u {
        let half = (count + 1u) / 2u;
        if left < half {
            node += 1u;
            count = half;
        } else {
            node += 2u * half;
            left -= half;
            count -= half;
        }
    }
    return node;
}

/// The node of a level whose place in that level's complete row is `place`, and how many texels it has; 0 where there is none.
fn level_node(object: u32, level: u32, place: u32) -> vec2<u32> {
    var node = 0u;
    var count = bakes.objects[object].texel_count;
    for (var step = 0u; step < level; step++) {
        if count <= 1u {
            return vec2<u32>(0u);
        }
        let half = (count + 1u) / 2u;
        if ((place >> (level - 1u - step)) & 1u) == 0u {
            node += 1u;
            count = half;
        } else {
            node += 2u * half;
            count -= half;
        }
    }
    return vec2<u32>(node, count);
}
