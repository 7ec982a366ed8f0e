//! The atlas: which place of the surface each texel stands for.

mod charts;
mod raster;
mod unwrap;

pub use charts::{Charted, UvSource};

use bevy_bounce_cssm::Texel;
use glam::{UVec2, Vec2};

use crate::{BakeError, Progress, scene::Scene};

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
    pub fn build(scene: &Scene, size: u32, source: UvSource, progress: &dyn Progress) -> Result<Self, BakeError> {
        let charted = Charted::new(scene, size, source, progress)?;
        raster::rasterize(scene, charted)
    }
}

/// Weights of a triangle's corners at `at`.
pub(crate) fn barycentric([a, b, c]: [Vec2; 3], at: Vec2) -> [f32; 3] {
    let whole = (b - a).perp_dot(c - a);
    let wb = (at - a).perp_dot(c - a) / whole;
    let wc = (b - a).perp_dot(at - a) / whole;
    [1.0 - wb - wc, wb, wc]
}
