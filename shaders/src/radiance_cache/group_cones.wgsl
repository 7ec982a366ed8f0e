// Cones through groups with a grid of their own: each has a cube of texels, in the directions of its grid, down to a level of a single
// one. See `volume.wgsl`.
//
// Around a cube there is nothing: what its outermost texels cover fades within a texel beyond their middles, as it would in a larger
// grid. A cone that is wider than the cube meets a texel of its own width, of which the cube fills a part.
//
// Cost: some ten operations a cone for each group; a product with a matrix a step for each that is near; where the cone
// is in it, four more and up to twelve filtered loads a step.

#define_import_path bevy_bounce::radiance_cache::group_cones

#import bevy_bounce::radiance_cache::cone::{grid, Start, Step, Sides, sample_axis, meet}
#import bevy_bounce::shared::control::is_within
#import bevy_bounce::shared::voxel_groups::{VoxelGroups, comes_near, to_group, way_to_group, normal_to_group, GROUP_EDGE}

@group(1) @binding(6) var<uniform> voxel_groups: VoxelGroups;
@group(1) @binding(7) var group_x: texture_3d<f32>;
@group(1) @binding(8) var group_y: texture_3d<f32>;
@group(1) @binding(9) var group_z: texture_3d<f32>;

fn from_grid(place: vec3<f32>) -> vec3<f32> {
    return place * grid.voxel_size + grid.origin;
}

/// Which groups a cone may come near, a bit each. Places are in voxels of the world's grid.
fn groups_near(origin: vec3<f32>, direction: vec3<f32>, spread: f32) -> u32 {
    var near = 0u;
    let start = from_grid(origin);
    for (var i = 0u; is_within(i, voxel_groups.count, start.x); i++) {
        let group = voxel_groups.groups[i];
        // Texels are half as wide as the cone, to the next level; what they cover fades over their whole width.
        let farthest = max(dot(group.middle - start, direction) + group.radius, 0.0);
        if comes_near(group, start, direction, 1e30, group.radius + grid.voxel_size + spread * farthest) {
            near |= 1u << i;
        }
    }
    return near;
}

// A place in a group's cube on one level, which is whole and may be beyond the last: where that is in the texture, and how much of what
// is there counts.
struct InCube {
    place: vec3<f32>,
    share: f32,
    level: f32,
}

fn in_cube(index: u32, place: vec3<f32>, level: f32) -> InCube {
    let edge = f32(GROUP_EDGE);
    let texel = exp2(level);
    let margin = min(0.5 * texel, 0.5 * edge);
    let within = clamp(place, vec3<f32>(margin), vec3<f32>(edge - margin));
    let fades = clamp(1.0 - abs(place - within) / texel, vec3<f32>(0.0), vec3<f32>(1.0));
    let part = min(edge / texel, 1.0);
    let in_texture = (within + vec3<f32>(0.0, 0.0, f32(index) * edge)) / vec3<f32>(textureDimensions(group_x));
    return InCube(in_texture, fades.x * fades.y * fades.z * part * part, min(level, f32(firstTrailingBit(GROUP_EDGE))));
}

fn add_sides(sum: ptr<function, Sides>, light: texture_3d<f32>, at: InCube, against: bool) {
    let sides = sample_axis(light, at.place, vec3<f32>(0.5, 0.0, 0.0), against, at.level);
    (*sum).toward += sides.toward * at.share;
    (*sum).away += sides.away * at.share;
}

/// What a cone meets of a group on a step, which is in voxels of the world's grid.
fn sample_group(world: Step, index: u32) -> vec4<f32> {
    let group = voxel_groups.groups[index];
    let way = way_to_group(group, world.direction) * grid.voxel_size;
    let ratio = length(way);
    var at: Step;
    at.level = max(world.level + log2(ratio), 0.0);
    at.place = to_group(group, from_grid(world.place));
    // Between two levels, each of which fades in its own way.
    var cubes = array<InCube, 2>(in_cube(index, at.place, floor(at.level)), in_cube(index, at.place, ceil(at.level)));
    cubes[0].share *= 1.0 - fract(at.level);
    cubes[1].share *= fract(at.level);
    if cubes[0].share + cubes[1].share <= 0.0 {
        return vec4<f32>(0.0);
    }
    at.direction = way / ratio;
    at.distance = world.distance * ratio;
    at.length = world.length * ratio;
    at.start = Start(
        to_group(group, from_grid(world.start.position)),
        normal_to_group(group, world.start.normal),
    );
    var x = Sides(vec4<f32>(0.0), 0.0);
    var y = x;
    var z = x;
    for (var i = 0; i < 2; i++) {
        if cubes[i].share > 0.0 {
            add_sides(&x, group_x, cubes[i], at.direction.x > 0.0);
            add_sides(&y, group_y, cubes[i], at.direction.y > 0.0);
            add_sides(&z, group_z, cubes[i], at.direction.z > 0.0);
        }
    }
    return meet(at, x, y, z);
}
