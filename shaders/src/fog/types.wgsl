// A volume of fog as a view marches through it.

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
    // Mean cosine of the angle by which it scatters.
    asymmetry: f32,
    // World units from the volume's centre to its corners.
    radius: f32,
    // Steps of a ray.
    steps: u32,
    // World units by which a ray's start is moved at most.
    jitter: f32,
}
