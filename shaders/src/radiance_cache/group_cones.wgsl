// Cones through groups with a grid of their own: each has a cube of texels, in the directions of its grid, down to a level of a single
// one. See `volume.wgsl`.
//
// Around a cube there is nothing: what its outermost texels cover fades within a texel beyond their middles, as it would in a larger
// grid. A cone that is wider than the cube meets a texel of its own width, of which the cube fills a part.
//
// Cost: two products with a matrix a cone and a step for each group near; where the cone is in it, six filtered loads a step.

#define_import_path bevy_bounce::radiance_cache::group_cones

#import bevy_bounce::radiance_cache::cone::{grid, Start, Step, texel_width, sample_axis, meet}
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
        // A texel is half as wide as the cone; it fades over its whole width.
        let reach = radius + 2.0 + spread * max(along + radius, 0.0);
        if along > -reach && length(to_middle - way * along) < reach {
            near |= 1u << i;
        }
    }
    return near;
}

/// What a cone meets of a group on a step, which is in voxels of the world's grid.
fn sample_group(world: Step, index: u32) -> vec4<f32> {
    let group = voxel_groups.groups[index];
    let way = way_to_group(group, world.direction) * grid.voxel_size;
    let ratio = length(way);
    var at: Step;
    at.level = max(world.level + log2(ratio), 0.0);
    at.place = to_group(group, from_grid(world.place));
    let edge = f32(GROUP_EDGE);
    let level = min(at.level, LAST_LEVEL);
    let margin = 0.5 * exp2(ceil(level));
    let place = clamp(at.place, vec3<f32>(margin), vec3<f32>(edge - margin));
    let texel = texel_width(at.level);
    let fades = clamp(1.0 - abs(at.place - place) / texel, vec3<f32>(0.0), vec3<f32>(1.0));
    let part = min(edge / texel, 1.0);
    let share = fades.x * fades.y * fades.z * part * part;
    if share <= 0.0 {
        return vec4<f32>(0.0);
    }
    at.direction = way / ratio;
    at.distance = world.distance * ratio;
    at.length = world.length * ratio;
    at.start = Start(
        to_group(group, from_grid(world.start.position)),
        normal_to_group(group, world.start.normal),
    );
    let size = vec3<f32>(textureDimensions(group_x));
    let other = vec3<f32>(0.5, 0.0, 0.0);
    let in_texture = (place + vec3<f32>(0.0, 0.0, f32(index) * edge)) / size;
    let x = sample_axis(group_x, in_texture, other, at.direction.x > 0.0, level);
    let y = sample_axis(group_y, in_texture, other, at.direction.y > 0.0, level);
    let z = sample_axis(group_z, in_texture, other, at.direction.z > 0.0, level);
    return share * meet(at, x, y, z);
}
