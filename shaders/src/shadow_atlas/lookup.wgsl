// Whether a virtual light sees a point, by its tile.
//
// Cost: about 60 operations and one load.

#define_import_path bevy_bounce::shadow_atlas::lookup

#import bevy_bounce::shadow_atlas::tile::{
    AtlasParameters, TILE_EMPTY, DEPTH_STEPS, tile_frame, to_tile, texel_direction, word_of, texel_depth, texel_error,
    texel_normal,
}

@group(2) @binding(0) var<uniform> parameters: AtlasParameters;
@group(2) @binding(1) var<storage, read> atlas: array<u32>;

/// Distance behind the texel's plane for which a point still counts as on it, as a share of its distance from where the texel was
/// sampled: the error of a normal of 16 bits, and some curvature.
const SLACK: f32 = 0.03;
/// Steps of depth, for rounding.
const ROUNDING: f32 = 2.0;

/// A point is hidden by the surface that its texel shows, taken as a plane, where it lies behind that and farther from the light, and
/// the surface lies before the plane of the point's own: what is on the same surface, flat or bent, or on one that meets it in a
/// corner, does not hide it, however coarse the texel. No bias is needed but for what is rounded, and for what casts being coarser
/// than what is seen.
/// `light`: its number in the list; `facing`: its normal.
fn atlas_visible(light: u32, eye: vec3<f32>, facing: vec3<f32>, position: vec3<f32>, normal: vec3<f32>) -> bool {
    let frame = tile_frame(facing);
    let to_surface = (position - eye) * frame;
    let edge = f32(parameters.tile);
    let texel = min(vec2<u32>(to_tile(to_surface) * edge), vec2<u32>(parameters.tile - 1u));
    let word = atlas[word_of(parameters, light, texel)];
    let depth = texel_depth(word, parameters.far);
    let off = to_surface - texel_direction(texel, parameters.tile) * depth;
    let bias = ROUNDING / DEPTH_STEPS * parameters.far + texel_error(word, parameters.error);
    let is_behind = dot(texel_normal(word), off) < -(SLACK * length(off) + bias);
    let is_before = dot(normal * frame, off) < -bias;
    let is_nearer = depth * depth < dot(to_surface, to_surface);
    return word == TILE_EMPTY || !(is_behind && is_before && is_nearer);
}
