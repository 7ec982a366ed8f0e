// The hierarchies of baked objects where they lie on surfaces. Every node is split in two halves, the first dark, the second bright: the
// root in red, its children in green, theirs in blue, the next in red again, but half as much, and so on. So nodes of every level
// stand out against their neighbours, the upper ones most. What is on no baked object is black.
//
// Cost: cssm/locate.wgsl for each pixel, and a step for each level.

#import bevy_render::view::View
#import bevy_bounce::cssm::locate::locate
#import bevy_bounce::cssm::texels::bakes
#import bevy_bounce::interleaved::surface::unpack_surface
#import bevy_bounce::shared::scene::NONE

@group(0) @binding(5) var<uniform> view: View;
@group(0) @binding(6) var surface_texture: texture_2d<u32>;
@group(0) @binding(7) var picture: texture_storage_2d<rgba16float, write>;

/// What is on a baked object is not black.
const DARK: f32 = 0.1;

// By the way from the root to the leaf of that rank.
fn color_of(object: u32, rank: u32) -> vec3<f32> {
    var color = vec3<f32>(0.0);
    var left = rank;
    var count = bakes.objects[object].texel_count;
    var weight = 0.5;
    for (var level = 0u; count > 1u; level++) {
        let half = (count + 1u) / 2u;
        if left < half {
            count = half;
        } else {
            left -= half;
            count -= half;
            color[level % 3u] += weight;
        }
        weight *= select(1.0, 0.5, level % 3u == 2u);
    }
    return DARK + (1.0 - DARK) * color;
}

@compute @workgroup_size(8, 8)
fn show_tree(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(surface_texture);
    if any(id.xy >= size) {
        return;
    }
    let surface = unpack_surface(textureLoad(surface_texture, id.xy, 0).xy, id.xy, size, view);
    var color = vec3<f32>(0.0);
    if surface.valid {
        let found = locate(surface.position, surface.normal);
        if found.object != NONE {
            color = color_of(found.object, found.rank);
        }
    }
    textureStore(picture, id.xy, vec4<f32>(color, 1.0));
}
