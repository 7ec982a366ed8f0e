//! Light probes.

use bevy::math::{UVec3, Vec3};
use bevy::render::render_resource::ShaderType;

/// Directions that a probe has a value for.
pub const PROBE_FACES: u32 = 6;

/// Where the light probes are.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeParameters {
    /// Corner of the volume; the first probe is half a spacing inside.
    pub origin: Vec3,
    /// World units between probes.
    pub spacing: f32,
    /// Probes along each axis.
    pub dims: UVec3,
    /// What a texel holds for 1 cd/m^2.
    pub scale: f32,
}

/// Where the light of a probe's face is taken.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbePlace {
    /// World position.
    pub position: Vec3,
    /// Octahedral normal (16 bits), how far the place is known.
    pub word: u32,
}
