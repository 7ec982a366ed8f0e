// Bounced light at each pixel from what the texels around it have gathered: a smooth picture of the atlases on the
// surfaces, whose cost does not depend on how much light there is. Ritschel, Grosch, Kautz and Seidel 2008, 5,
// "view-dependent lightmapping".
//
// The filter is the cubic B-spline, as of bicubic filtering, over the distance along the surface in sides of a texel: so it runs on over
// seams of the atlas. Texels that face elsewhere or lie off the pixel's plane are left out.
//
// A pixel without texels around it gathers by itself.
//
// Cost: one thread a pixel; nodes whose spheres come near it some 20 operations each, and some 16 texels 40.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{gather, leaf_texel, tree, Receiver}
#import bevy_bounce::cssm::texels::{bakes, load_texel, to_object, turn_to_object}
#import bevy_bounce::cssm::tree::{node_count, unpack_node}
#import bevy_bounce::interleaved::surface::{unpack_surface, Surface}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::sampling::hash
#ifdef SEVERAL
#import bevy_bounce::shared::scene::NONE
#endif

@group(0) @binding(5) var<uniform> view: View;
@group(0) @binding(6) var surface_texture: texture_2d<u32>;
@group(0) @binding(7) var output: texture_storage_2d<rgba16float, write>;
// Of each texel: irradiance over pi, cd/m^2; nodes of its cuts.
@group(0) @binding(8) var<storage, read> received: array<vec4<f32>>;

/// How far a texel reaches, in its sides.
const SUPPORT: f32 = 2.0;
/// Of the longest side, what `reach` is: half the diagonal of its square.
const SIDES_OF_REACH: f32 = 1.4142136;
/// Cosine between normals below which a texel is of another surface.
const SAME_FACING: f32 = 0.5;
/// Sides of a texel off its plane at which a pixel is on another surface.
const OFF_PLANE: f32 = 1.0;
/// Weight below which a pixel has no texels.
const LEAST_WEIGHT: f32 = 1e-3;

// Cubic B-spline, 2/3 at 0.
fn b_spline(t: f32) -> f32 {
    let far = max(SUPPORT - t, 0.0);
    let near = max(1.0 - t, 0.0);
    return (far * far * far - 4.0 * near * near * near) / 6.0;
}

// Light and weight of an object's texels around a place.
fn smooth_from(object: u32, surface: Surface) -> vec4<f32> {
    let bake = &bakes.objects[object];
    let position = to_object(object, surface.position);
    let longest = SUPPORT * SIDES_OF_REACH * (*bake).reach;
    if any(position < (*bake).bounds_min - longest) || any(position > (*bake).bounds_max + longest) {
        return vec4<f32>(0.0);
    }
    let normal = turn_to_object(object, surface.normal);
    let end = node_count(object);
    var sum = vec4<f32>(0.0);
    var index = 0u;
    var rank = 0u;
    while index < end {
        let node = unpack_node(object, tree[(*bake).first_node + index]);
        let count = (node.skip - index + 1u) / 2u;
        if distance(position, node.center) - node.radius < longest {
            if count > 1u {
                index += 1u;
                continue;
            }
            let leaf = leaf_texel(object, rank);
            let texel = load_texel(object, leaf);
            let side = sqrt(texel.area);
            let offset = position - texel.position;
            let above = dot(offset, texel.normal);
            let facing = dot(normal, texel.normal);
            if facing > SAME_FACING && abs(above) < OFF_PLANE * side {
                let along = sqrt(max(dot(offset, offset) - above * above, 0.0));
                let weight = b_spline(along / side) * (facing - SAME_FACING);
                sum += vec4<f32>(received[(*bake).first_light + leaf].rgb, 1.0) * weight;
            }
        }
        rank += count;
        index = node.skip;
    }
    return sum;
}

fn light_at(surface: Surface, pixel: u32) -> vec3<f32> {
    var sum = vec4<f32>(0.0);
    for (var object = 0u; is_within(object, bakes.count, surface.position.x); object++) {
        sum += smooth_from(object, surface);
    }
    if sum.w > LEAST_WEIGHT {
        return sum.rgb / sum.w;
    }
    var receiver: Receiver;
    receiver.position = surface.position;
    receiver.normal = surface.normal;
#ifdef SEVERAL
    receiver.object = NONE;
#endif
    return gather(receiver, hash(pixel), 0u).light;
}

@compute @workgroup_size(8, 8)
fn smooth_pixels(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
    var light = vec3<f32>(0.0);
    if surface.valid {
        light = light_at(surface, id.x + id.y * size.x) * view.exposure;
    }
    textureStore(output, id.xy, vec4<f32>(min(light, vec3<f32>(6e4)), 1.0));
}
