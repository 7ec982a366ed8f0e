// Three axes for each tile of the screen: the normals that a cache has to stand for. Rehfeld, Zirr and Dachsbacher 2014, 3.2,
// "Adapting to Normals".
//
// A histogram of normals is blurred (binomial, 3x3), the highest bin taken, others lowered the nearer their direction is to
// the line of it: (w + 1)(1 - |cos|^8); so three times. A bin counts 16 a pixel after the blur. All in whole numbers.
//
// Cost: a workgroup a tile; one word a pixel, nine bins a thread, three reductions.

#import bevy_bounce::radiance_cache::normals::{normal_bin, wrapped_bin, apart, BINS, EDGE}
#import bevy_bounce::radiance_cache::types::CacheGrid
#import bevy_bounce::shared::groups::folded_index

@group(0) @binding(0) var<uniform> parameters: CacheGrid;
@group(0) @binding(1) var surface_texture: texture_2d<u32>;
// Of each tile, three bins of six bits.
@group(0) @binding(2) var<storage, read_write> frames: array<u32>;

/// What a pixel counts after the blur.
const PIXEL: u32 = 16u;

var<workgroup> histogram: array<atomic<u32>, BINS>;
// Highest weight, and the lowest bin that has it.
var<workgroup> best: array<atomic<u32>, 3>;

fn count_pixels(tile: vec2<u32>, lane: u32) {
    let count = parameters.tile * parameters.tile;
    for (var i = lane; i < count; i += BINS) {
        let pixel = tile * parameters.tile + vec2<u32>(i % parameters.tile, i / parameters.tile);
        if all(pixel < parameters.size) {
            let surface = textureLoad(surface_texture, pixel, 0);
            if surface.x != 0u {
                atomicAdd(&histogram[normal_bin(surface.y)], 1u);
            }
        }
    }
}

fn blurred(bin: u32) -> u32 {
    let column = i32(bin) % EDGE;
    let row = i32(bin) / EDGE;
    var sum = 0u;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            sum += u32((2 - abs(x)) * (2 - abs(y))) * atomicLoad(&histogram[wrapped_bin(column + x, row + y)]);
        }
    }
    return sum;
}

@compute @workgroup_size(64)
fn choose_axes(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    if index >= parameters.tiles.x * parameters.tiles.y {
        return;
    }
    count_pixels(vec2<u32>(index % parameters.tiles.x, index / parameters.tiles.x), lane);
    workgroupBarrier();
    var weight = blurred(lane);
    var frame = 0u;
    for (var i = 0u; i < 3u; i++) {
        atomicMax(&best[i], (weight << 6u) | (BINS - 1u - lane));
        workgroupBarrier();
        let axis = BINS - 1u - (atomicLoad(&best[i]) & (BINS - 1u));
        frame |= axis << (6u * i);
        weight = ((weight + PIXEL) * apart(lane, axis)) >> 12u;
    }
    if lane == 0u {
        frames[index] = frame;
    }
}
