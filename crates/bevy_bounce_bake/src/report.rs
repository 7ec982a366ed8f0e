//! What a bake came to.

use bevy_bounce_cssm::CssmFile;

use crate::BakeSettings;

/// The machine-readable report.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Report {
    /// Side of the atlas that was asked for, in texels.
    pub atlas: u32,
    /// Side of a cube map's face in pixels.
    pub depth: u32,
    /// Name of the traversal.
    pub strategy: String,
    /// Texels with a cube map.
    pub depth_maps: u32,
    /// Constant pieces stored.
    pub runs: u64,
    /// Bytes of the cube maps at 16 bits a pixel.
    pub uncompressed_bytes: u64,
    /// Bytes that stand for them in the file.
    pub compressed_bytes: u64,
    /// The former over the latter.
    pub ratio: f64,
    /// From the triangles to the finished maps.
    pub seconds: f64,
}

impl Report {
    /// Of a finished bake.
    pub fn new(file: &CssmFile, settings: &BakeSettings, seconds: f64) -> Self {
        let (uncompressed_bytes, compressed_bytes) = (file.uncompressed_bytes(), file.compressed_bytes());
        Self {
            atlas: settings.atlas,
            depth: settings.depth,
            strategy: settings.strategy.to_string(),
            depth_maps: file.meta.texels,
            runs: file.meta.runs,
            uncompressed_bytes,
            compressed_bytes,
            ratio: uncompressed_bytes as f64 / compressed_bytes as f64,
            seconds,
        }
    }
}
