// Whether a virtual light sees a point, by its tile.
//
// Cost: about 60 operations and one load.

#define_import_path bevy_bounce::shadow_atlas::lookup

#import bevy_bounce::shadow_atlas::tile::{AtlasParameters, TILE_EMPTY, tile_frame, to_tile, from_tile, tile_words}
#import bevy_bounce::vpl::types::Vpl

@group(1) @binding(0) var<uniform> parameters: AtlasParameters;
@group(1) @binding(1) var<storage, read> atlas: array<u32>;

/// Texels by which the depth of a surface may change within one texel, as a share of the tile: a surface seen at a grazing
/// angle would reach to infinity.
const SLOPE_TEXELS: f32 = 8.0;
/// Steps of depth, for rounding.
const ROUNDING: f32 = 2.0;

fn tile_depth(light: u32, texel: vec2<u32>) -> u32 {
    let index = texel.y * parameters.tile + texel.x;
    let pair = atlas[light * tile_words(parameters) + index / 2u];
    return (pair >> ((index & 1u) * 16u)) & TILE_EMPTY;
}

/// Compares depths where the texel was sampled, at its centre: there the surface is taken to be as far as its tangent plane.
/// A plane thus never shadows itself, whatever its slope, with no bias but for rounding.
fn atlas_visible(light: u32, vpl: Vpl, position: vec3<f32>, normal: vec3<f32>) -> bool {
    let frame = tile_frame(vpl.normal);
    let to_surface = (position - vpl.position) * frame;
    let surface_normal = normal * frame;
    let edge = f32(parameters.tile);
    let texel = min(vec2<u32>(to_tile(to_surface) * edge), vec2<u32>(parameters.tile - 1u));
    let center = from_tile((vec2<f32>(texel) + 0.5) / edge);
    let distance = length(to_surface);
    let slope = dot(surface_normal, center);
    let on_plane = dot(surface_normal, to_surface) / min(slope, -1e-6) * length(center);
    let reach = distance * (SLOPE_TEXELS / edge);
    let depth = clamp(on_plane, distance - reach, distance + reach);
    return f32(tile_depth(light, texel)) + ROUNDING >= depth / parameters.far * f32(TILE_EMPTY);
}
