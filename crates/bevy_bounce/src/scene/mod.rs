//! Main world to GPU scene.

use bevy::prelude::*;

/// What a light adds to the bounced light; without it a light takes part as [`GiLight::default`].
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct GiLight {
    /// Scales its bounced light; 1 is physical, 0 is off.
    pub intensity: f32,
    /// Scales its share of the virtual lights; 1 is by power. More is calmer for this light, noisier for the others.
    pub share: f32,
    /// Longest path from it, in bounces.
    pub bounces: u32,
}

impl GiLight {
    /// Does not bounce.
    pub const OFF: Self = Self { intensity: 0.0, share: 0.0, bounces: 0 };
}

impl Default for GiLight {
    fn default() -> Self {
        Self { intensity: 1.0, share: 1.0, bounces: u32::MAX }
    }
}

/// How a mesh takes part; without it a mesh takes part as [`VoxelizedMesh::default`].
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct VoxelizedMesh {
    /// Is there for bounced light: reflects it and blocks it.
    pub enabled: bool,
    /// Diffuse albedo instead of the material's.
    pub albedo: Option<Color>,
    /// Reflects on both sides; `None` follows the material's `double_sided` and `cull_mode`.
    pub two_sided: Option<bool>,
}

impl VoxelizedMesh {
    /// Neither reflects nor blocks bounced light.
    pub const OFF: Self = Self { enabled: false, albedo: None, two_sided: None };
}

impl Default for VoxelizedMesh {
    fn default() -> Self {
        Self { enabled: true, albedo: None, two_sided: None }
    }
}

/// Keeps instances, materials and lights on the GPU.
pub struct GiScenePlugin;

impl Plugin for GiScenePlugin {
    fn build(&self, _app: &mut App) {}
}
