// Largest geometry term at a point: that of two surfaces which face each other at the distance between the lights around it, the
// root of the area over their number.
//
// It belongs to the point that is lit: one value serves all lights, and what they lose is what the compensation of the same
// point gives back. Bricks are blended, so that it has no steps.
//
// Cost: eight loads a point.

#define_import_path bevy_bounce::vpl::bound

#import bevy_bounce::shared::grid::{Grid, BRICK, level_of, to_level, brick_dims, brick_index}
#import bevy_bounce::vpl::types::VplHeader

@group(0) @binding(5) var<uniform> grid: Grid;
@group(0) @binding(6) var<storage, read> densities: array<vec2<f32>>;

/// Of the mean bound. Where hardly any light is, the distance between lights says nothing; compensation would look
/// for what they lose more than four times as far away as on the average.
const LOWEST: f32 = 0.0625;

/// 1/m^2.
fn geometry_bound(header: VplHeader, position: vec3<f32>) -> f32 {
    let level = level_of(grid, position);
    let last = vec3<i32>(brick_dims(level)) - 1;
    let place = to_level(level, position) / f32(BRICK) - 0.5;
    let first = vec3<i32>(floor(place));
    let between = place - floor(place);
    var sum = vec2<f32>(0.0);
    for (var i = 0; i < 8; i++) {
        let corner = vec3<i32>(i & 1, (i >> 1u) & 1, i >> 2u);
        let weights = select(1.0 - between, between, corner == vec3<i32>(1));
        let brick = vec3<u32>(clamp(first + corner, vec3<i32>(0), last));
        sum += weights.x * weights.y * weights.z * densities[brick_index(level, brick)];
    }
    return max(sum.x / max(sum.y, 1e-12), LOWEST * header.geometry_bound);
}
