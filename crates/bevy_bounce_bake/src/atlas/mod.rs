//! The atlas: which place of the surface each texel stands for.

mod charts;
mod raster;
mod unwrap;

pub use charts::{Charted, UvSource};

use bevy_bounce_cssm::Texel;
use glam::UVec2;

use crate::{BakeError, scene::Scene};

/// Texels and where they lie.
#[derive(Clone, Debug)]
pub struct Atlas {
    /// Width and height in texels.
    pub size: UVec2,
    /// Texels that show some surface, row by row.
    pub texels: Vec<AtlasTexel>,
    /// Number of charts.
    pub charts: u32,
    /// Texture coordinates of the triangles.
    pub charted: Charted,
}

/// A texel that shows some surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasTexel {
    /// What the file holds of it.
    pub texel: Texel,
    /// Which triangle its centre lies on, counted over all parts.
    pub triangle: u32,
}

impl Atlas {
    /// Lays the scene out in at most `size` by `size` texels.
    pub fn build(scene: &Scene, size: u32, source: UvSource) -> Result<Self, BakeError> {
        let charted = Charted::new(scene, size, source)?;
        raster::rasterize(scene, charted)
    }
}
