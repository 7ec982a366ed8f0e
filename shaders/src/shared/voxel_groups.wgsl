// Groups of meshes with a grid of their own, as they stand in the world: any number of them may share one. "Voxels" here are those of
// a group's grid, from its lowest corner. Rehfeld, Zirr and Dachsbacher 2014, 3.1, "Multiple Voxel Hierarchies".
//
// With W the matrix from the world to voxels, positions come back by its inverse, the transposed cofactors of W over its
// determinant. Normals come to the world by W's transpose, and back by its inverse. So a group may be turned, stretched, sheared
// and mirrored; which side of a triangle is seen in a mirrored one is settled when it is voxelised.
//
// Cost: two cross products and as many products with a matrix a point; some ten operations for what a ray does not come near.

#define_import_path bevy_bounce::shared::voxel_groups

#import bevy_bounce::shared::grid::GridLevel

/// Edge of the largest grid of a group, voxels.
const GROUP_EDGE: u32 = 32u;
/// Voxels that each has room for, and cells.
const GROUP_VOXELS: u32 = GROUP_EDGE * GROUP_EDGE * GROUP_EDGE;
const GROUP_CELLS: u32 = GROUP_VOXELS / 2u;

struct VoxelGroup {
    voxels_from_world_x: vec4<f32>,
    voxels_from_world_y: vec4<f32>,
    voxels_from_world_z: vec4<f32>,
    dims: vec3<u32>,
    first_voxel: u32,
    first_cell: u32,
    inverse_determinant: f32,
    max_emission: f32,
    radius: f32,
    middle: vec3<f32>,
    padding: u32,
}

struct VoxelGroups {
    count: u32,
    padding_a: u32,
    padding_b: u32,
    padding_c: u32,
    groups: array<VoxelGroup, 32>,
}

/// The grid of a group, in its own voxels.
fn group_level(group: VoxelGroup) -> GridLevel {
    return GridLevel(vec3<f32>(0.0), 1.0, group.dims, group.first_voxel, 0u, 0u, group.first_cell, 0u);
}

/// Whether a line comes within `reach` of the group between its start and a distance; world units, `direction` of unit length.
fn comes_near(group: VoxelGroup, start: vec3<f32>, direction: vec3<f32>, distance: f32, reach: f32) -> bool {
    let to_middle = group.middle - start;
    let along = dot(to_middle, direction);
    let aside = to_middle - direction * along;
    return along > -reach && along < distance + reach && dot(aside, aside) < reach * reach;
}

/// A world position in voxels.
fn to_group(group: VoxelGroup, position: vec3<f32>) -> vec3<f32> {
    let p = vec4<f32>(position, 1.0);
    return vec3<f32>(dot(group.voxels_from_world_x, p), dot(group.voxels_from_world_y, p), dot(group.voxels_from_world_z, p));
}

/// A way through the world in voxels.
fn way_to_group(group: VoxelGroup, way: vec3<f32>) -> vec3<f32> {
    return vec3<f32>(
        dot(group.voxels_from_world_x.xyz, way),
        dot(group.voxels_from_world_y.xyz, way),
        dot(group.voxels_from_world_z.xyz, way),
    );
}

// Rows of the matrix's cofactors, as columns.
fn cofactors(group: VoxelGroup) -> mat3x3<f32> {
    let x = group.voxels_from_world_x.xyz;
    let y = group.voxels_from_world_y.xyz;
    let z = group.voxels_from_world_z.xyz;
    return mat3x3<f32>(cross(y, z), cross(z, x), cross(x, y));
}

fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    return v * inverseSqrt(max(dot(v, v), 1e-30));
}

/// A normal of the world in voxels; zero stays zero.
fn normal_to_group(group: VoxelGroup, normal: vec3<f32>) -> vec3<f32> {
    return unit_or_zero(transpose(cofactors(group)) * normal) * sign(group.inverse_determinant);
}

/// Where voxels are in the world.
fn from_group(group: VoxelGroup, place: vec3<f32>) -> vec3<f32> {
    let offset = vec3<f32>(group.voxels_from_world_x.w, group.voxels_from_world_y.w, group.voxels_from_world_z.w);
    return cofactors(group) * (place - offset) * group.inverse_determinant;
}

/// A voxel face with that normal as an area in the world: along the normal there, square world units long.
fn face_from_group(group: VoxelGroup, normal: vec3<f32>) -> vec3<f32> {
    let face = group.voxels_from_world_x.xyz * normal.x + group.voxels_from_world_y.xyz * normal.y
        + group.voxels_from_world_z.xyz * normal.z;
    return face * abs(group.inverse_determinant);
}

/// A normal in voxels as one of the world.
fn normal_from_group(group: VoxelGroup, normal: vec3<f32>) -> vec3<f32> {
    return unit_or_zero(face_from_group(group, normal));
}
