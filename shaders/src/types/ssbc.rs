//! Bias compensation in screen space.

use bevy::render::render_resource::ShaderType;

/// How the bias compensation integrates.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct SsbcParameters {
    /// Projected solid angle above which a texel is refined, sr.
    pub solid_angle: f32,
    /// The same for a texel that spans an edge, sr.
    pub edge_solid_angle: f32,
    /// Pixels a side of a texel of the residual: 1 or 2.
    pub scale: u32,
    /// Where the tent ends that blurs the residual, texels of it: as wide as [`TENT_REACH`](super::TENT_REACH) of bounded light.
    pub reach: u32,
}

/// Levels of the hierarchy of the bias compensation above the pixels.
pub const SSBC_LEVELS: u32 = 6;

/// Words before the pixels in the list of those at which the residual is integrated anew.
pub const SSBC_REPAIR_HEADER: u32 = 4;
