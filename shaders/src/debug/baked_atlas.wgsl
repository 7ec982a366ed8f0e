// The atlases of baked objects with the light that their texels send: emission, reflected direct and bounced light. Objects are laid out
// row by row in tiles of one size; an atlas is enlarged to fill its tile by a whole number, or every so many texels of it are shown.
//
// Cost: one thread a texel; a descent through its hierarchy.

#import bevy_render::view::View
#import bevy_bounce::cssm::gather::{leaf_texel, powers}
#import bevy_bounce::cssm::texels::{bakes, load_cell, object_of}
#import bevy_bounce::cssm::tree::leaf_node
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(5) var<uniform> view: View;
@group(0) @binding(7) var picture: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(64)
fn show_baked_atlas(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group) * 64u + lane;
    if light >= bakes.lights {
        return;
    }
    let object = object_of(light);
    let bake = &bakes.objects[object];
    let rank = light - (*bake).first_light;
    let power = powers[2u * (*bake).first_light + leaf_node(object, rank)];
    let color = vec4<f32>(power.rgb / max(power.w, 1e-30) * view.exposure, 1.0);

    let columns = u32(ceil(sqrt(f32(bakes.count))));
    let rows = (bakes.count + columns - 1u) / columns;
    let tile = textureDimensions(picture) / vec2<u32>(columns, rows);
    let corner = vec2<u32>(object % columns, object / columns) * tile;
    let atlas = vec2<u32>((*bake).atlas_width, (*bake).atlas_height);
    let cell = load_cell(object, leaf_texel(object, rank));
    let larger = min(tile.x / atlas.x, tile.y / atlas.y);
    if larger == 0u {
        let shrunk = (atlas + tile - 1u) / max(tile, vec2<u32>(1u));
        let every = max(shrunk.x, shrunk.y);
        if all(cell % every == vec2<u32>(0u)) && all(cell / every < tile) {
            textureStore(picture, corner + cell / every, color);
        }
        return;
    }
    for (var pixel = 0u; pixel < larger * larger; pixel++) {
        textureStore(picture, corner + cell * larger + vec2<u32>(pixel % larger, pixel / larger), color);
    }
}
