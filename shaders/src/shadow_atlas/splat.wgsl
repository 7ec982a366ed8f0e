// Imperfect shadow maps: a map for every virtual light, drawn from points. Ritschel et al. 2008.
//
// A workgroup a light, its tile in workgroup memory. Of the points, which are in the order of the surfaces they were spread over
// evenly, each light takes every sixteenth. A point covers as many texels as its share of the surface, and holes are filled
// from coarser levels (pull-push, Marroquim et al. 2007).
//
// Cost: a light and point about 80 operations.

#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::grid::Grid
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::shadow_atlas::tile::{AtlasParameters, TILE_EMPTY, tile_frame, to_tile, from_tile, tile_words, pack_texel}
#import bevy_bounce::shadow_atlas::types::{WorldPoint, POINT_NONE, POINT_SUBSETS}
#import bevy_bounce::shared::sampling::PI
#import bevy_bounce::vpl::types::{Vpl, VplHeader}

@group(0) @binding(0) var<uniform> parameters: AtlasParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> header: VplHeader;
@group(0) @binding(3) var<storage, read> world_points: array<WorldPoint>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> atlas: array<u32>;

const GROUP: u32 = 64u;
const MAX_TILE_TEXELS: u32 = 2304u;
/// Texels along the edge of a splat, at most.
const MAX_SPLAT: f32 = 5.0;
/// Voxels round a light within which a point less than OWN_HEIGHT voxels above it that looks the same way is its own surface.
const OWN_SURFACE: f32 = 6.0;
const OWN_HEIGHT: f32 = 0.5;

var<workgroup> nearest: array<atomic<u32>, MAX_TILE_TEXELS>;
// Of 2x2 and 4x4 texels.
var<workgroup> halves: array<u32, 576>;
var<workgroup> quarters: array<u32, 144>;

fn splat(point: WorldPoint, vpl: Vpl, frame: mat3x3<f32>) {
    let to = (point.position - vpl.position) * frame;
    let distance = length(to);
    let normal = decode_unit(point.normal) * frame;
    let cosine = -dot(normal, to) / max(distance, 1e-12);
    let is_own = distance < OWN_SURFACE * grid.voxel_size && to.z < OWN_HEIGHT * grid.voxel_size && abs(normal.z) > 0.5;
    if point.normal == POINT_NONE || to.z <= 0.0 || is_own || (cosine <= 0.0 && (point.normal & 1u) == 0u) {
        return;
    }
    let edge = f32(parameters.tile);
    let solid_angle = parameters.point_area * abs(cosine) / (distance * distance);
    let size = clamp(sqrt(solid_angle / (2.0 * PI)) * edge, 1.0, MAX_SPLAT);
    let low = max(vec2<i32>(floor(to_tile(to) * edge - 0.5 * size + 0.5)), vec2<i32>(0));
    let high = min(low + vec2<i32>(i32(size + 0.5) - 1), vec2<i32>(i32(parameters.tile) - 1));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let direction = from_tile((vec2<f32>(f32(x), f32(y)) + 0.5) / edge);
            let slope = dot(normal, direction);
            let on_plane = -cosine * distance / select(-1e-6, slope, abs(slope) > 1e-6) * length(direction);
            let depth = clamp(on_plane, 0.8 * distance, 1.25 * distance);
            let word = pack_texel(depth, 0u, normal * sign(cosine), parameters.far);
            atomicMin(&nearest[u32(y) * parameters.tile + u32(x)], word);
        }
    }
}

// The nearest of four texels, where two are known.
fn pull(a: u32, b: u32, c: u32, d: u32) -> u32 {
    let known = vec4<u32>(a, b, c, d) < vec4<u32>(TILE_EMPTY);
    let count = dot(select(vec4<u32>(0u), vec4<u32>(1u), known), vec4<u32>(1u));
    return select(TILE_EMPTY, min(min(a, b), min(c, d)), count >= 2u);
}

@compute @workgroup_size(64)
fn splat_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group);
    if light >= header.count {
        return;
    }
    let edge = parameters.tile;
    for (var i = lane; i < edge * edge; i += GROUP) {
        atomicStore(&nearest[i], TILE_EMPTY);
    }
    workgroupBarrier();
    let vpl = vpls[light];
    let frame = tile_frame(vpl.normal);
    for (var i = lane; i < arrayLength(&world_points) / POINT_SUBSETS; i += GROUP) {
        splat(world_points[i * POINT_SUBSETS + light % POINT_SUBSETS], vpl, frame);
    }
    workgroupBarrier();
    let half = edge / 2u;
    for (var i = lane; i < half * half; i += GROUP) {
        let texel = (i / half) * 2u * edge + (i % half) * 2u;
        halves[i] = pull(
            atomicLoad(&nearest[texel]),
            atomicLoad(&nearest[texel + 1u]),
            atomicLoad(&nearest[texel + edge]),
            atomicLoad(&nearest[texel + edge + 1u]),
        );
    }
    workgroupBarrier();
    let quarter = half / 2u;
    for (var i = lane; i < quarter * quarter; i += GROUP) {
        let texel = (i / quarter) * 2u * half + (i % quarter) * 2u;
        quarters[i] = pull(halves[texel], halves[texel + 1u], halves[texel + half], halves[texel + half + 1u]);
    }
    workgroupBarrier();
    for (var i = lane; i < edge * edge; i += GROUP) {
        let x = i % edge;
        let y = i / edge;
        var word = atomicLoad(&nearest[i]);
        if word == TILE_EMPTY {
            word = halves[(y / 2u) * half + x / 2u];
        }
        if word == TILE_EMPTY {
            word = quarters[min(y / 4u, quarter - 1u) * quarter + min(x / 4u, quarter - 1u)];
        }
        atlas[light * tile_words(parameters) + i] = word;
    }
}
