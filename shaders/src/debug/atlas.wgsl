// The shadow maps of the virtual lights, tile by tile in the order of their list: white is near, black far, blue empty.
//
// Cost: one load a pixel.

#import bevy_bounce::shadow_atlas::tile::{AtlasParameters, TILE_EMPTY, word_of, texel_depth}
#import bevy_bounce::vpl::types::VplHeader

@group(0) @binding(0) var<uniform> parameters: AtlasParameters;
@group(0) @binding(1) var<storage, read> header: VplHeader;
@group(0) @binding(2) var<storage, read> atlas: array<u32>;
@group(0) @binding(3) var picture: texture_storage_2d<rgba16float, write>;

const EMPTY: vec3<f32> = vec3<f32>(0.0, 0.0, 0.1);

@compute @workgroup_size(8, 8)
fn show_atlas(@builtin(global_invocation_id) id: vec3<u32>) {
    let size = textureDimensions(picture);
    if any(id.xy >= size) {
        return;
    }
    let place = id.xy / parameters.tile;
    let columns = max(size.x / parameters.tile, 1u);
    let light = place.y * columns + place.x;
    var color = vec3<f32>(0.0);
    if place.x < columns && light < header.count {
        let word = atlas[word_of(parameters, light, id.xy % parameters.tile)];
        let near = 1.0 - min(texel_depth(word, parameters.far) / parameters.far, 1.0);
        color = select(vec3<f32>(near * near), EMPTY, word == TILE_EMPTY);
    }
    textureStore(picture, id.xy, vec4<f32>(color, 1.0));
}
