// Imperfect shadow maps: a map for every virtual light, drawn from points. Ritschel et al. 2008.
//
// A workgroup draws a light's tile in its own memory; of tiles above 48 x 48 texels, a part of at most that size. Points are in the order
// of the surfaces; each light takes every fourth, spread over them evenly. A point is a disc on its surface: a texel shows the nearest
// disc that covers its centre, so that silhouettes are no wider than the surfaces. One whose centre none covers takes the nearest point
// within it, and what then is empty continues the planes of coarser levels (pull-push, Marroquim et al. 2007).
//
// Cost: a part and point about 60 operations, a texel in the box of a disc about 30.

#import bevy_bounce::shadow_atlas::tile::{
    AtlasParameters, Part, TILE_EMPTY, OWN_PLANE, SAME_FACING, PART_TEXELS, part_of, part_texel, part_index, light_name, tile_frame,
    to_tile, texel_direction, word_of, pack_texel, texel_depth, texel_normal,
}
#import bevy_bounce::shadow_atlas::types::{
    WorldPoint, POINT_NONE, POINT_SUBSETS, POINT_TWO_SIDED, POINT_WIDE, disc_radius,
}
#import bevy_bounce::shared::grid::Grid
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::octahedral::decode_unit
#import bevy_bounce::vpl::types::{Vpl, VplHeader}

@group(0) @binding(0) var<uniform> parameters: AtlasParameters;
@group(0) @binding(1) var<uniform> grid: Grid;
@group(0) @binding(2) var<storage, read> header: VplHeader;
@group(0) @binding(3) var<storage, read> world_points: array<WorldPoint>;
@group(0) @binding(4) var<storage, read> vpls: array<Vpl>;
@group(0) @binding(5) var<storage, read_write> atlas: array<u32>;

const GROUP: u32 = 256u;
/// Edges of a tile from the middle of a disc to the last texel that is looked at: larger discs are nearer to the light than three times
/// their radius.
const MAX_SPLAT: f32 = 0.375;
/// Edges of a tile that a radian spans where the half octahedron is widest.
const WIDEST: f32 = 1.12;
/// Voxels round a light within which a point less than OWN_HEIGHT voxels above it that looks the same way is its own surface.
const OWN_SURFACE: f32 = 1.0;
const OWN_HEIGHT: f32 = 0.5;
/// Of a word while points are drawn: no disc covers the texel's centre. Above 14 bits of depth, an empty one, 16 of the normal.
const UNCOVERED: u32 = 0x80000000u;

// Of the part.
var<workgroup> nearest: array<atomic<u32>, PART_TEXELS>;
// Places in it of the nearest of 2x2 and of 4x4 texels.
var<workgroup> halves: array<u32, PART_TEXELS / 4u>;
var<workgroup> quarters: array<u32, PART_TEXELS / 16u>;

fn is_own(to: vec3<f32>, normal: vec3<f32>, height: f32) -> bool {
    let is_near = length(to) < OWN_SURFACE * grid.voxel_size && to.z < OWN_HEIGHT * grid.voxel_size;
    return (is_near || abs(height) < OWN_PLANE * grid.voxel_size) && abs(normal.z) > SAME_FACING;
}

fn splat(point: WorldPoint, vpl: Vpl, frame: mat3x3<f32>, part: Part) {
    let to = (point.position - vpl.position) * frame;
    let normal = decode_unit(point.normal) * frame;
    // Of the light above the point's plane.
    let height = -dot(normal, to);
    let is_behind = height <= 0.0 && (point.normal & POINT_TWO_SIDED) == 0u;
    if point.normal == POINT_NONE || to.z <= 0.0 || is_behind || is_own(to, normal, height) {
        return;
    }
    let facing = normal * select(-1.0, 1.0, height > 0.0);
    let edge = f32(parameters.tile);
    let distance = length(to);
    let radius = disc_radius(parameters.point_area, (point.normal & POINT_WIDE) != 0u);
    let middle = to_tile(to) * edge;
    let own = vec2<i32>(min(middle, vec2<f32>(edge - 1.0)));
    let around = min(WIDEST * radius / distance, MAX_SPLAT) * edge;
    // Texels whose centres may be within the disc, and its own.
    let low = max(min(vec2<i32>(ceil(middle - around - 0.5)), own), vec2<i32>(part.low));
    let high = min(max(vec2<i32>(floor(middle + around - 0.5)), own), vec2<i32>(part.low + part.size) - 1);
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let texel = vec2<i32>(x, y);
            let direction = texel_direction(vec2<u32>(texel), parameters.tile);
            let slope = -dot(facing, direction);
            let depth = abs(height) / max(slope, 1e-6);
            let off = direction * depth - to;
            let is_covered = dot(off, off) <= radius * radius;
            if slope > 1e-6 && (is_covered || (x == own.x && y == own.y)) {
                // A centre may see the plane long before the surface.
                let word = pack_texel(select(max(depth, distance), depth, is_covered), 0u, facing, parameters.far);
                let drawn = ((word >> 18u) << 17u) | (word & 0xffffu) | select(UNCOVERED, 0u, is_covered);
                atomicMin(&nearest[part_index(part, texel)], drawn);
            }
        }
    }
}

// A word of the tile, of one that was drawn.
fn of_drawn(drawn: u32) -> u32 {
    let depth = (drawn >> 17u) & 0x3fffu;
    return select((depth << 18u) | (drawn & 0xffffu), TILE_EMPTY, drawn == TILE_EMPTY);
}

fn word_at(place: u32) -> u32 {
    if place == TILE_EMPTY {
        return TILE_EMPTY;
    }
    return atomicLoad(&nearest[place]);
}

// Of four places the one of the nearest texel, where two are known.
fn pull(places: vec4<u32>) -> u32 {
    var found = TILE_EMPTY;
    var least = TILE_EMPTY;
    var known = 0u;
    for (var i = 0u; i < 4u; i++) {
        let word = word_at(places[i]);
        known += u32(word != TILE_EMPTY);
        if word < least {
            found = places[i];
            least = word;
        }
    }
    return select(TILE_EMPTY, found, known >= 2u);
}

// The plane that the texel at `source` shows, where the one at `place` sees it.
fn push(part: Part, source: u32, place: u32) -> u32 {
    let word = word_at(source);
    if word == TILE_EMPTY {
        return TILE_EMPTY;
    }
    let tile = parameters.tile;
    let normal = texel_normal(word);
    let of_source = texel_direction(part_texel(part, source), tile);
    let of_place = texel_direction(part_texel(part, place), tile);
    let depth = texel_depth(word, parameters.far) * dot(normal, of_source) / min(dot(normal, of_place), -1e-6);
    if !(depth > 0.0 && depth < parameters.far) {
        return TILE_EMPTY;
    }
    return pack_texel(depth, 0u, normal, parameters.far);
}

// Draws the light's points into `nearest`.
fn splat_all(vpl: Vpl, part: Part, lane: u32) {
    let frame = tile_frame(vpl.normal);
    let subset = light_name(vpl) % POINT_SUBSETS;
    for (var i = lane; i < arrayLength(&world_points) / POINT_SUBSETS; i += GROUP) {
        splat(world_points[i * POINT_SUBSETS + subset], vpl, frame, part);
    }
}

@compute @workgroup_size(256)
fn splat_points(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let light = folded_index(group);
    if light >= header.count {
        return;
    }
    let part = part_of(parameters.tile, group.z);
    let width = part.size.x;
    let texels = width * part.size.y;
    for (var i = lane; i < texels; i += GROUP) {
        atomicStore(&nearest[i], TILE_EMPTY);
    }
    workgroupBarrier();
    splat_all(vpls[light], part, lane);
    workgroupBarrier();
    for (var i = lane; i < texels; i += GROUP) {
        atomicStore(&nearest[i], of_drawn(atomicLoad(&nearest[i])));
    }
    workgroupBarrier();
    let half = width / 2u;
    for (var i = lane; i < texels / 4u; i += GROUP) {
        let texel = (i / half) * 2u * width + (i % half) * 2u;
        halves[i] = pull(vec4<u32>(texel, texel + 1u, texel + width, texel + width + 1u));
    }
    workgroupBarrier();
    let quarter = half / 2u;
    for (var i = lane; i < texels / 16u; i += GROUP) {
        let texel = (i / quarter) * 2u * half + (i % quarter) * 2u;
        quarters[i] = pull(vec4<u32>(halves[texel], halves[texel + 1u], halves[texel + half], halves[texel + half + 1u]));
    }
    workgroupBarrier();
    for (var i = lane; i < texels; i += GROUP) {
        let x = i % width;
        let y = i / width;
        var word = atomicLoad(&nearest[i]);
        if word == TILE_EMPTY {
            word = push(part, halves[(y / 2u) * half + x / 2u], i);
        }
        if word == TILE_EMPTY {
            word = push(part, quarters[(y / 4u) * quarter + x / 4u], i);
        }
        atlas[word_of(parameters, light, part_texel(part, i))] = word;
    }
}
