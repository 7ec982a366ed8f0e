// A volume of fog as a view marches through it, and the lattice that the light in it is known at.

#define_import_path bevy_bounce::fog::types

struct FogParameters {
    // From the world to the volume, a unit cube about the origin.
    local_from_world: mat4x4<f32>,
    // Colour of the fog, times tint and intensity of light in it.
    color: vec3<f32>,
    // Density, times that of the texture where there is one.
    density: f32,
    // Added to where the texture is read.
    density_offset: vec3<f32>,
    // 1 where there is a texture of densities.
    has_texture: u32,
    // Light that a unit of density absorbs, per world unit.
    absorption: f32,
    // Light that it scatters.
    scattering: f32,
    // World units from the volume's centre to its corners.
    radius: f32,
    // Steps of a ray.
    steps: u32,
    // World units by which a ray's start is moved at most.
    jitter: f32,
}

// Froxels: columns and rows of the viewport, and slices by distance from the eye, which become thicker with it.
struct FroxelParameters {
    dims: vec3<u32>,
    // Mean cosine of the angle by which fog scatters.
    asymmetry: f32,
    // World units from the eye, or from its plane where rays are parallel.
    near: f32,
    // From there to the far side.
    extent: f32,
}

/// Where a distance from the eye lies among the slices, 0 to 1.
fn froxel_slice(froxels: FroxelParameters, distance: f32) -> f32 {
    return sqrt(max((distance - froxels.near) / froxels.extent, 0.0));
}

/// The way back.
fn froxel_distance(froxels: FroxelParameters, slice: f32) -> f32 {
    return froxels.near + froxels.extent * slice * slice;
}
