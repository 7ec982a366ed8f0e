// Which texel of which baked object a place of the world is on: the nearest one in the hierarchies that faces as the place does.
// So a pixel knows its object without a target that says so, and what is not baked is on none.
//
// Cost: a node visited about 20 operations; those whose spheres hold the place or come near it.

#define_import_path bevy_bounce::cssm::locate

#import bevy_bounce::cssm::gather::{leaf_texel, tree}
#import bevy_bounce::cssm::texels::{bakes, load_texel, scale_of, to_object, turn_to_object}
#import bevy_bounce::cssm::tree::{node_count, unpack_node}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::scene::NONE

/// How far a texel's surface may reach, as a multiple of what a square of the largest texel's area does.
const STRETCH: f32 = 3.0;
/// How much the distance from a texel's plane counts, as a multiple of that along it: the plane of a place's own texel is near.
const OFF_PLANE: f32 = 4.0;

/// A texel of an object, or `NONE`.
struct Located {
    object: u32,
    texel: u32,
    /// Place in the order of leaves.
    rank: u32,
}

fn locate(position: vec3<f32>, normal: vec3<f32>) -> Located {
    var found = Located(NONE, NONE, NONE);
    var nearest = 1e30;
    for (var object = 0u; is_within(object, bakes.count, position.x); object++) {
        let bake = &bakes.objects[object];
        let point = to_object(object, position);
        // Of a surface in the plane of a side, pixels lie a little off it: rasterisation rounds.
        if any(point < (*bake).bounds_min - (*bake).reach) || any(point > (*bake).bounds_max + (*bake).reach) {
            continue;
        }
        let facing = turn_to_object(object, normal);
        // Distances are compared in the world.
        let scale = scale_of(object);
        var limit = min(nearest, STRETCH * (*bake).reach * scale);
        let end = node_count(object);
        var index = 0u;
        var rank = 0u;
        while index < end {
            let node = unpack_node(object, tree[(*bake).first_node + index]);
            let count = (node.skip - index + 1u) / 2u;
            if scale * (distance(point, node.center) - node.radius) < limit {
                if count > 1u {
                    index += 1u;
                    continue;
                }
                let leaf = leaf_texel(object, rank);
                let texel = load_texel(object, leaf);
                let offset = point - texel.position;
                let off_plane = OFF_PLANE * dot(offset, texel.normal);
                // Along an edge both faces are near: the one counts that faces as the place does.
                let alike = max(dot(facing, texel.normal), 1e-3);
                let apart = scale * sqrt(dot(offset, offset) + off_plane * off_plane) / alike;
                if apart < limit {
                    limit = apart;
                    nearest = apart;
                    found = Located(object, leaf, rank);
                }
            }
            rank += count;
            index = node.skip;
        }
    }
    return found;
}
