// Three levels of the hierarchy from the one below them.
//
// Position (as depth) and normal are means, area is a sum, radiance is the mean by area. A texel is an edge where one of its
// four is, where some show nothing, or where they do not lie in its plane.
//
// Cost: a workgroup makes 8x8 texels of the first of the three levels, and from them 4x4 and 2x2 through its memory, where they are
// packed as in the textures.

#import bevy_bounce::interleaved::surface::Lens
#import bevy_bounce::ssbc::common::{surface_texture, view_lens, texel_at}
#import bevy_bounce::ssbc::hierarchy::{Node, encode_node, decode_node, SSBC_LEVELS}

@group(0) @binding(3) var source: texture_2d<u32>;
#ifdef FROM_PIXELS
const BELOW: u32 = 0u;
#else
const BELOW: u32 = SSBC_LEVELS / 2u;
#endif
@group(0) @binding(4) var fine: texture_storage_2d<rgba32uint, write>;
@group(0) @binding(5) var middle: texture_storage_2d<rgba32uint, write>;
@group(0) @binding(6) var coarse: texture_storage_2d<rgba32uint, write>;

/// Cosine of the angle from the mean normal beyond which there is an edge.
const NORMAL_EDGE: f32 = 0.95;
/// Distance off the plane, in edges of the texel, beyond which there is one.
const PLANE_EDGE: f32 = 0.25;
const GROUP: u32 = 8u;

var<workgroup> nodes: array<vec4<u32>, 64>;

fn load_below(lens: Lens, texel: vec2<i32>) -> Node {
    return decode_node(lens, textureLoad(source, texel, 0), texel, BELOW);
}

// Whether a texel of that level has pixels.
fn is_in_view(texel: vec2<i32>, level: u32) -> bool {
    return all(texel << vec2<u32>(level) < vec2<i32>(textureDimensions(surface_texture)));
}

// One texel from the four below it.
fn merge(lens: Lens, four: array<Node, 4>, texel: vec2<i32>, level: u32) -> Node {
    var below = four;
    var node: Node;
    node.far = 1e30;
    var seen = 0.0;
    for (var i = 0; i < 4; i++) {
        if below[i].area > 0.0 {
            seen += 1.0;
            node.depth += below[i].depth;
            node.near = max(node.near, below[i].near);
            node.far = min(node.far, below[i].far);
            node.area += below[i].area;
            node.normal += below[i].normal * below[i].area;
            node.radiance += below[i].radiance * below[i].area;
            node.edge = node.edge || below[i].edge;
        }
    }
    if seen == 0.0 {
        return node;
    }
    node.depth /= seen;
    node.radiance /= node.area;
    let sum = length(node.normal);
    node.normal = select(vec3<f32>(0.0, 1.0, 0.0), node.normal / sum, sum > 1e-3 * node.area);
    let position = texel_at(lens, texel, level, node.depth);
    for (var i = 0; i < 4; i++) {
        let child = 2 * texel + vec2<i32>(i & 1, i >> 1u);
        if below[i].area > 0.0 {
            let offset = texel_at(lens, child, level - 1u, below[i].depth).xyz - position.xyz;
            let off_plane = abs(dot(node.normal, offset)) > PLANE_EDGE * position.w;
            node.edge = node.edge || off_plane || dot(node.normal, below[i].normal) < NORMAL_EDGE;
        } else {
            node.edge = node.edge || is_in_view(child, level - 1u);
        }
    }
    return node;
}

// The four of `nodes` below a texel of a level that has `edge` texels a side in this workgroup.
fn merge_shared(lens: Lens, local: vec2<u32>, edge: u32, texel: vec2<i32>, level: u32) -> vec4<u32> {
    let first = 2u * (local.y * 2u * edge + local.x);
    var four: array<Node, 4>;
    for (var i = 0u; i < 4u; i++) {
        let place = vec2<u32>(i & 1u, i >> 1u);
        four[i] = decode_node(lens, nodes[first + place.y * 2u * edge + place.x], 2 * texel + vec2<i32>(place), level - 1u);
    }
    return encode_node(lens, merge(lens, four, texel, level), texel, level);
}

@compute @workgroup_size(8, 8)
fn reduce(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let lens = view_lens();
    var local = vec2<u32>(lane % GROUP, lane / GROUP);
    var texel = vec2<i32>(group.xy * GROUP + local);
    let four = array<Node, 4>(
        load_below(lens, 2 * texel),
        load_below(lens, 2 * texel + vec2<i32>(1, 0)),
        load_below(lens, 2 * texel + vec2<i32>(0, 1)),
        load_below(lens, 2 * texel + vec2<i32>(1, 1)),
    );
    var node = encode_node(lens, merge(lens, four, texel, BELOW + 1u), texel, BELOW + 1u);
    textureStore(fine, texel, node);
    nodes[lane] = node;
    workgroupBarrier();

    local = vec2<u32>(lane % 4u, lane / 4u);
    if lane < 16u {
        texel = vec2<i32>(group.xy * 4u + local);
        node = merge_shared(lens, local, 4u, texel, BELOW + 2u);
        textureStore(middle, texel, node);
    }
    workgroupBarrier();
    if lane < 16u {
        nodes[lane] = node;
    }
    workgroupBarrier();

    local = vec2<u32>(lane % 2u, lane / 2u);
    if lane < 4u {
        texel = vec2<i32>(group.xy * 2u + local);
        node = merge_shared(lens, local, 2u, texel, BELOW + 3u);
        textureStore(coarse, texel, node);
    }
}
