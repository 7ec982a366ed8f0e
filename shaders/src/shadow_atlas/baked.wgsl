// What virtual lights on baked objects see of these, as the first layer of their shadow maps: from the cube maps of the texels that they
// are on. Ritschel, Grosch, Kautz and Seidel 2008, 3.2.
//
// A cube map tells surfaces that are seen from those that are not by a depth anywhere between the nearest and the next one, and has none
// where nothing is behind the nearest. That depth is the tile's, as of a surface square to the ray: no part of the object is there, and
// what is behind it is hidden.
//
// Cost: a workgroup a light; a texel one code of three to ten reads, and about 60 operations.

#import bevy_bounce::cssm::query::{cube_center, cube_code, face_point, pixel_of, UNBOUNDED}
#import bevy_bounce::cssm::texels::{bakes, load_texel, scale_of, to_object, turn_to_object, Texel}
#import bevy_bounce::shadow_atlas::tile::{AtlasParameters, TILE_EMPTY, tile_frame, from_tile, tile_words, pack_texel}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::scene::NONE
#import bevy_bounce::vpl::types::Vpl

@group(0) @binding(2) var<uniform> parameters: AtlasParameters;
@group(0) @binding(3) var<storage, read> eyes: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> atlas: array<u32>;

const GROUP: u32 = 64u;

// The word of a direction of the light's frame.
fn look(object: u32, texel: Texel, vpl: Vpl, frame: mat3x3<f32>, toward: vec3<f32>) -> u32 {
    let direction = turn_to_object(object, frame * toward);
    let side = bakes.objects[object].depth;
    let at = face_point(direction, side);
    let code = cube_code(object, texel.slot, at.face, pixel_of(at.at, side));
    if code == UNBOUNDED {
        return TILE_EMPTY;
    }
    // The light is not where the map's rays begin.
    let aside = dot(cube_center(object, texel) - to_object(object, vpl.position), direction);
    let depth = max(f32(code) * bakes.objects[object].quantum / at.depth + aside, 0.0);
    return pack_texel(depth * scale_of(object), 0u, -normalize(toward), parameters.far);
}

@compute @workgroup_size(64)
fn draw_baked(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group);
    if light >= arrayLength(&eyes) {
        return;
    }
    let eye = eyes[light];
    let vpl = vpls[light];
    let frame = tile_frame(vpl.normal);
    let words = tile_words(parameters);
    var texel: Texel;
    if eye.x != NONE {
        texel = load_texel(eye.x, eye.y);
    }
    for (var i = lane; i < words; i += GROUP) {
        var word = TILE_EMPTY;
        if eye.x != NONE {
            let place = vec2<f32>(vec2<u32>(i % parameters.tile, i / parameters.tile)) + 0.5;
            word = look(eye.x, texel, vpl, frame, from_tile(place / f32(parameters.tile)));
        }
        atlas[light * words + i] = word;
    }
}
