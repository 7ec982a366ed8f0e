// The voxel grid: where it lies and what its words mean.
//
// A large world has several, each within the next, coarser one; all are in the same buffers, the finest first. Positions "in
// voxels" are in voxels of the finest, from its origin, where nothing else is said.
//
// A voxel is one word: first cell (22 bits), which of the six facings have a cell (6 bits), and the Chebyshev distance,
// in blocks of 2^3 voxels, of its block to the nearest that has any (4 bits, at most 15, 0 where it has one itself).
// Cells of a voxel follow each other in the order of their facings, so a facing's cell is the first cell plus the
// number of lower facings.

#define_import_path bevy_bounce::shared::grid

#import bevy_bounce::shared::control::is_within

struct Grid {
    origin: vec3<f32>,
    voxel_size: f32,
    dims: vec3<u32>,
    cell_capacity: u32,
    further: array<GridLevel, 3>,
    further_count: u32,
}

struct GridLevel {
    origin: vec3<f32>,
    voxel_size: f32,
    dims: vec3<u32>,
    first_voxel: u32,
    first_brick: u32,
    first_block: u32,
    first_cell: u32,
    padding: u32,
}

struct Cell {
    albedo: u32,
    normal: u32,
    plane_area: u32,
    bounds: u32,
}

const CELL_BITS: u32 = 22u;
const CELL_MASK: u32 = 0x3fffffu;
const FACING_MASK: u32 = 0x3fu;
const DISTANCE_SHIFT: u32 = 28u;
const MAX_DISTANCE: u32 = 15u;
/// Edge of the blocks that the distance counts, voxels.
const LEAP_BLOCK: u32 = 2u;

/// Fixed point: one voxel face of area.
const AREA_ONE: f32 = 65536.0;
/// Words of a cell's sums: area, albedo, normal, position from the voxel's centre, each times area; then the bounds of the
/// surfaces as maxima, of 0.5 + position and of 0.5 - position, so that zero is empty; the area of what has holes; area and albedo once
/// more, as much of them as counts of what is seen where surfaces lie behind each other.
const SUM_WORDS: u32 = 21u;
const SUM_MASKED: u32 = 16u;
const SUM_FRONT: u32 = 17u;
/// Fixed point: a voxel's edge in the bounds.
const BOUND_ONE: f32 = 65536.0;
/// Steps of a bound in a cell.
const BOUND_STEPS: f32 = 31.0;

/// Words of the counters: cells in use, cells there was no room for, area in the finest grid in 1/256 voxel faces, cells of
/// the finest grid.
const COUNTER_CELLS: u32 = 0u;
const COUNTER_OVERFLOW: u32 = 1u;
const COUNTER_AREA: u32 = 2u;
/// Steps of it, of a voxel's face.
const COUNTER_AREA_STEPS: f32 = 256.0;
const COUNTER_FINEST: u32 = 3u;

/// One of the nested grids: 0 is the finest.
fn grid_level(grid: Grid, level: u32) -> GridLevel {
    switch level {
        case 0u: {
            return GridLevel(grid.origin, grid.voxel_size, grid.dims, 0u, 0u, 0u, 0u, 0u);
        }
        case 1u: {
            return grid.further[0];
        }
        case 2u: {
            return grid.further[1];
        }
        default: {
            return grid.further[2];
        }
    }
}

/// The finest grid that holds a world position; the coarsest, where none does.
fn level_at(grid: Grid, position: vec3<f32>) -> u32 {
    for (var i = 0u; is_within(i, grid.further_count, position.x); i++) {
        let level = grid_level(grid, i);
        let place = to_level(level, position);
        if all(place >= vec3<f32>(0.0)) && all(place < vec3<f32>(level.dims)) {
            return i;
        }
    }
    return grid.further_count;
}

fn level_of(grid: Grid, position: vec3<f32>) -> GridLevel {
    return grid_level(grid, level_at(grid, position));
}

/// World position in voxels of a grid.
fn to_level(level: GridLevel, position: vec3<f32>) -> vec3<f32> {
    return (position - level.origin) / level.voxel_size;
}

fn voxel_index(level: GridLevel, voxel: vec3<i32>) -> u32 {
    let v = vec3<u32>(voxel);
    return level.first_voxel + (v.z * level.dims.y + v.y) * level.dims.x + v.x;
}

fn end_of(level: GridLevel) -> u32 {
    return level.first_voxel + level.dims.x * level.dims.y * level.dims.z;
}

/// Voxels of all grids. Without a branch, as `shared/control.wgsl` says.
fn voxel_count(grid: Grid) -> u32 {
    let second = select(end_of(grid_level(grid, 0u)), end_of(grid.further[0]), grid.further_count > 0u);
    let third = select(second, end_of(grid.further[1]), grid.further_count > 1u);
    return select(third, end_of(grid.further[2]), grid.further_count > 2u);
}

/// Blocks of the distance along each axis.
fn leap_dims(level: GridLevel) -> vec3<u32> {
    return (level.dims + (LEAP_BLOCK - 1u)) / LEAP_BLOCK;
}

/// The grid that a block of the distance belongs to.
fn level_of_block(grid: Grid, block: u32) -> u32 {
    var level = 0u;
    while (level < grid.further_count) & (block >= grid_level(grid, level + 1u).first_block) {
        level++;
    }
    return level;
}

fn voxel_facings(word: u32) -> u32 {
    return (word >> CELL_BITS) & FACING_MASK;
}

fn voxel_distance(word: u32) -> u32 {
    return word >> DISTANCE_SHIFT;
}

fn cell_index(word: u32, facing: u32) -> u32 {
    return (word & CELL_MASK) + countOneBits(voxel_facings(word) & ((1u << facing) - 1u));
}

/// Edge of a brick, voxels.
const BRICK: u32 = 8u;

/// Bricks along each axis.
fn brick_dims(level: GridLevel) -> vec3<u32> {
    return (level.dims + (BRICK - 1u)) / BRICK;
}

/// Index of a brick of voxels.
fn brick_index(level: GridLevel, brick: vec3<u32>) -> u32 {
    let dims = brick_dims(level);
    return level.first_brick + (brick.z * dims.y + brick.y) * dims.x + brick.x;
}

/// Where a brick lies in its grid.
fn brick_place(level: GridLevel, index: u32) -> vec3<u32> {
    let dims = brick_dims(level);
    let place = index - level.first_brick;
    return vec3<u32>(place % dims.x, (place / dims.x) % dims.y, place / (dims.x * dims.y));
}

/// The grid that a brick belongs to.
fn level_of_brick(grid: Grid, index: u32) -> u32 {
    var level = 0u;
    while (level < grid.further_count) & (index >= grid_level(grid, level + 1u).first_brick) {
        level++;
    }
    return level;
}

/// Index of the brick of a world position in a grid; of one outside, that of the nearest.
fn brick_at(level: GridLevel, position: vec3<f32>) -> u32 {
    let voxel = clamp(to_level(level, position), vec3<f32>(0.0), vec3<f32>(level.dims - 1u));
    return brick_index(level, vec3<u32>(voxel) / BRICK);
}

/// Facing of a normal: +x, -x, +y, -y, +z, -z by its longest component.
fn facing_of(normal: vec3<f32>) -> u32 {
    let a = abs(normal);
    if a.x >= a.y && a.x >= a.z {
        return select(0u, 1u, normal.x < 0.0);
    }
    if a.y >= a.z {
        return select(2u, 3u, normal.y < 0.0);
    }
    return select(4u, 5u, normal.z < 0.0);
}

/// Bounds in voxels from the voxel's lowest corner, rounded outwards: 5 bits each, low then high.
fn pack_bounds(low: vec3<f32>, high: vec3<f32>) -> u32 {
    let l = vec3<u32>(clamp(floor(low * BOUND_STEPS), vec3<f32>(0.0), vec3<f32>(BOUND_STEPS)));
    let h = vec3<u32>(clamp(ceil(high * BOUND_STEPS), vec3<f32>(0.0), vec3<f32>(BOUND_STEPS)));
    return l.x | (l.y << 5u) | (l.z << 10u) | (h.x << 15u) | (h.y << 20u) | (h.z << 25u);
}

fn bounds_low(bounds: u32) -> vec3<f32> {
    return vec3<f32>(vec3<u32>(bounds, bounds >> 5u, bounds >> 10u) & vec3<u32>(31u)) / BOUND_STEPS;
}

fn bounds_high(bounds: u32) -> vec3<f32> {
    return vec3<f32>(vec3<u32>(bounds >> 15u, bounds >> 20u, bounds >> 25u) & vec3<u32>(31u)) / BOUND_STEPS;
}

/// Signed distance of the mean plane from the voxel's centre along the normal, in voxels.
fn cell_plane(cell: Cell) -> f32 {
    return unpack2x16float(cell.plane_area).x;
}

/// Share of the rays through its bounds that a cell stops, in 255ths: all, but for masked surfaces.
fn cell_cover(cell: Cell) -> u32 {
    return cell.albedo >> 24u;
}

/// Surface area, voxel faces; 0 for a cell that nothing is in.
fn cell_area(cell: Cell) -> f32 {
    return unpack2x16float(cell.plane_area).y;
}
