// Sort keys of the pixels: tile, facing in the tile's frame, slice of depth. What has the same key is one cluster. Rehfeld, Zirr
// and Dachsbacher 2014, 3.2; slices as in Olsson, Billeter and Assarsson 2012, "Clustered Deferred and Forward Shading".
//
// Depth is the lowest part of the key: where room is short, its bits are left out first. A pixel without a surface gets the
// tile after the last, and is sorted to the end.
//
// Cost: one thread a pixel, two words.

#import bevy_bounce::radiance_cache::normals::facing_in
#import bevy_bounce::radiance_cache::types::{CacheGrid, CLUSTER_SLICE_BITS, CLUSTER_FACING_BITS}
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> parameters: CacheGrid;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> frames: array<u32>;
// Key, pixel.
@group(0) @binding(3) var<storage, read_write> pairs: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> pair_count: array<u32>;

/// Bits of the depth 1, that of the near plane.
const NEAR: u32 = 0x3f800000u;

// Slices grow with the distance: the bits of a float are its logarithm but for a piecewise linear curve. Reverse-z depth is near over
// distance, or linear where the view is orthographic.
fn slice_of(depth: u32) -> u32 {
    let last = (1u << CLUSTER_SLICE_BITS) - 1u;
    if parameters.orthographic != 0u {
        return min(u32((1.0 - min(bitcast<f32>(depth), 1.0)) * f32(parameters.slices)), last);
    }
    let octaves = (NEAR - min(depth, NEAR)) >> 8u;
    return min(octaves * parameters.slices >> 15u, last);
}

@compute @workgroup_size(64)
fn write_keys(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group) * 64u + lane;
    if index >= parameters.size.x * parameters.size.y {
        return;
    }
    if index == 0u {
        pair_count[0] = parameters.size.x * parameters.size.y;
    }
    let pixel = vec2<u32>(index % parameters.size.x, index / parameters.size.x);
    let surface = textureLoad(surface_texture, pixel, 0);
    var key = (parameters.tiles.x * parameters.tiles.y) << (CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS);
    if surface.x != 0u {
        let place = pixel / parameters.tile;
        let tile = place.y * parameters.tiles.x + place.x;
        let facing = facing_in(frames[tile], surface.y);
        key = (((tile << CLUSTER_FACING_BITS) | facing) << CLUSTER_SLICE_BITS) | slice_of(surface.x);
    }
    pairs[index] = vec2<u32>(key, index);
}
