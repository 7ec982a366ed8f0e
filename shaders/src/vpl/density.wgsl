// How densely virtual lights lie on the surfaces of each brick of the grid: what the bound of the geometry term follows.
//
// Of nested grids, a light counts in each that holds it. Groups with a grid of their own count where they stand.
//
// Cost: a workgroup a brick, one word a voxel and one a cell.

#import bevy_bounce::shared::grid::{
    GridLevel, BRICK, grid_level, level_of_brick, brick_place, voxel_index, voxel_facings, cell_area, CELL_MASK,
}
#import bevy_bounce::shared::groups::folded_index
#import bevy_bounce::shared::rays::{grid, voxels, cells}
#import bevy_bounce::vpl::types::{VplParameters, BRICK_WORDS, BRICK_LIGHTS, BRICK_AREA, BRICK_AREA_STEPS, LIGHT_SHIFT}

@group(0) @binding(0) var<uniform> parameters: VplParameters;
// What is known of each brick of the grid, `BRICK_WORDS` each.
@group(0) @binding(1) var<storage, read> bricks: array<u32>;
// By brick: lights times the scale of the bound, area of the surfaces in square world units.
@group(0) @binding(2) var<storage, read_write> densities: array<vec2<f32>>;

const GROUP: u32 = 64u;

var<workgroup> areas: array<f32, GROUP>;

fn voxel_area(level: GridLevel, voxel: vec3<u32>) -> f32 {
    if any(voxel >= level.dims) {
        return 0.0;
    }
    let word = voxels[voxel_index(level, vec3<i32>(voxel))];
    let count = countOneBits(voxel_facings(word));
    var area = 0.0;
    for (var i = 0u; i < count; i++) {
        area += cell_area(cells[(word & CELL_MASK) + i]);
    }
    return area;
}

@compute @workgroup_size(64)
fn measure_density(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = folded_index(group);
    let level = grid_level(grid, level_of_brick(grid, index));
    let column = brick_place(level, index) * BRICK + vec3<u32>(lane % BRICK, lane / BRICK, 0u);
    var area = 0.0;
    for (var z = 0u; z < BRICK; z++) {
        area += voxel_area(level, column + vec3<u32>(0u, 0u, z));
    }
    areas[lane] = area;
    workgroupBarrier();
    for (var step = GROUP / 2u; step > 0u; step >>= 1u) {
        if lane < step {
            areas[lane] += areas[lane + step];
        }
        workgroupBarrier();
    }
    if lane == 0u && index < arrayLength(&densities) {
        let lights = f32(bricks[index * BRICK_WORDS + BRICK_LIGHTS]) / f32(1u << LIGHT_SHIFT);
        let all = areas[0] + f32(bricks[index * BRICK_WORDS + BRICK_AREA]) / BRICK_AREA_STEPS;
        densities[index] = vec2<f32>(lights * parameters.bound_scale, all * level.voxel_size * level.voxel_size);
    }
}
