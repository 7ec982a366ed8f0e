//! Volumetric fog.

use bevy::math::{Mat4, UVec3, Vec3};
use bevy::render::render_resource::ShaderType;

/// A volume of fog as a view marches through it.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct FogParameters {
    /// From the world to the volume, a unit cube about the origin.
    pub local_from_world: Mat4,
    /// Colour of the fog, times tint and intensity of light in it.
    pub color: Vec3,
    /// Density, times that of the texture where there is one.
    pub density: f32,
    /// Added to where the texture is read.
    pub density_offset: Vec3,
    /// 1 where there is a texture of densities.
    pub has_texture: u32,
    /// Light that a unit of density absorbs, per world unit.
    pub absorption: f32,
    /// Light that it scatters.
    pub scattering: f32,
    /// World units from the volume's centre to its corners.
    pub radius: f32,
    /// Steps of a ray.
    pub steps: u32,
    /// World units by which a ray's start is moved at most.
    pub jitter: f32,
}

/// Lattice in the space of a view at which it is known what fog scatters to the eye; see `fog/types.wgsl`.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct FroxelParameters {
    /// Columns, rows, slices.
    pub dims: UVec3,
    /// Mean cosine of the angle by which fog scatters.
    pub asymmetry: f32,
    /// World units from the eye to the first slice, or from its plane where rays are parallel.
    pub near: f32,
    /// From there to the far side of the last.
    pub extent: f32,
}
