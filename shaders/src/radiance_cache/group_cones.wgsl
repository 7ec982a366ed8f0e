// Cones through groups with a grid of their own: each has a cube of texels, in the directions of its grid, down to a level of a single
// one. See `volume.wgsl`.
//
// Around a cube there is nothing: what its outermost texels cover fades within a texel beyond their middles, as it would in a larger
// grid. A cone that is wider than the cube meets a texel of its own width, of which the cube fills a part.
//
// Cost: two products with a matrix a cone and a step for each group near; where the cone is in it, twelve filtered loads a step.

#define_import_path bevy_bounce::radiance_cache::group_cones

#import bevy_bounce::radiance_cache::cone::{grid, Start, Step, Sides, sample_axis, meet}
#import bevy_bounce::shared::voxel_groups::{VoxelGroups, to_group, way_to_group, normal_to_group, GROUP_EDGE}

@group(1) @binding(6) var<uniform> voxel_groups: VoxelGroups;
@group(1) @binding(7) var group_x: texture_3d<f32>;
@group(1) @binding(8) var group_y: texture_3d<f32>;
@group(1) @binding(9) var group_z: texture_3d<f32>;

/// Level at which a cube is one texel.
const LAST_LEVEL: f32 = 5.0;

fn from_grid(place: vec3<f32>) -> vec3<f32> {
    return place * grid.voxel_size + grid.origin;
}

/// Which groups a cone may come near, a bit each. Places are in voxels of the world's grid.
fn groups_near(origin: vec3<f32>, direction: vec3<f32>, spread: f32) -> u32 {
    var near = 0u;
    for (var i = 0u; i < voxel_groups.count; i++) {
        let group = voxel_groups.groups[i];
        let middle = 0.5 * vec3<f32>(group.dims);
        let way = normalize(way_to_group(group, direction));
        let to_middle = middle - to_group(group, from_grid(origin));
        let along = dot(to_middle, way);
        let radius = length(middle);
        // A texel is as wide as half the cone, to the next level; it fades over its whole width.
        let reach = radius + 2.0 + spread * max(along + radius, 0.0);
        if along > -reach && length(to_middle - way * along) < reach {
            near |= 1u << i;
        }
    }
    return near;
}

// Light and coverage along an axis on one level, of a group's cube; `level` is whole, and may be beyond the last.
fn sample_cube(light: texture_3d<f32>, index: u32, place: vec3<f32>, against: bool, level: f32) -> Sides {
    let edge = f32(GROUP_EDGE);
    let texel = exp2(level);
    let margin = min(0.5 * texel, 0.5 * edge);
    let within = clamp(place, vec3<f32>(margin), vec3<f32>(edge - margin));
    let fades = clamp(1.0 - abs(place - within) / texel, vec3<f32>(0.0), vec3<f32>(1.0));
    let part = min(edge / texel, 1.0);
    let share = fades.x * fades.y * fades.z * part * part;
    if share <= 0.0 {
        return Sides(vec4<f32>(0.0), 0.0);
    }
    let in_texture = (within + vec3<f32>(0.0, 0.0, f32(index) * edge)) / vec3<f32>(textureDimensions(light));
    let sides = sample_axis(light, in_texture, vec3<f32>(0.5, 0.0, 0.0), against, min(level, LAST_LEVEL));
    return Sides(sides.toward * share, sides.away * share);
}

// The same between two levels: each fades in its own way.
fn sample_cubes(light: texture_3d<f32>, index: u32, place: vec3<f32>, against: bool, level: f32) -> Sides {
    let fine = sample_cube(light, index, place, against, floor(level));
    let coarse = sample_cube(light, index, place, against, ceil(level));
    return Sides(mix(fine.toward, coarse.toward, fract(level)), mix(fine.away, coarse.away, fract(level)));
}

/// What a cone meets of a group on a step, which is in voxels of the world's grid.
fn sample_group(world: Step, index: u32) -> vec4<f32> {
    let group = voxel_groups.groups[index];
    let way = way_to_group(group, world.direction) * grid.voxel_size;
    let ratio = length(way);
    var at: Step;
    at.level = max(world.level + log2(ratio), 0.0);
    at.place = to_group(group, from_grid(world.place));
    let reach = exp2(ceil(at.level));
    if any(at.place < vec3<f32>(-reach)) || any(at.place > vec3<f32>(group.dims) + reach) {
        return vec4<f32>(0.0);
    }
    at.direction = way / ratio;
    at.distance = world.distance * ratio;
    at.length = world.length * ratio;
    at.start = Start(
        to_group(group, from_grid(world.start.position)),
        normal_to_group(group, world.start.normal),
    );
    let x = sample_cubes(group_x, index, at.place, at.direction.x > 0.0, at.level);
    let y = sample_cubes(group_y, index, at.place, at.direction.y > 0.0, at.level);
    let z = sample_cubes(group_z, index, at.place, at.direction.z > 0.0, at.level);
    return meet(at, x, y, z);
}
