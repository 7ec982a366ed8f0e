//! Structs that Rust and WGSL share. A test compares every one with what naga makes of its WGSL twin of the same name.

mod cssm;
mod fog;
mod grid;
mod history;
mod interleaved;
mod probes;
mod radiance_cache;
mod scene;
mod shadow_atlas;
mod ssbc;
mod vpl;

use bevy::render::render_resource::ShaderType;

pub use cssm::*;
pub use fog::*;
pub use grid::*;
pub use history::*;
pub use interleaved::*;
pub use probes::*;
pub use radiance_cache::*;
pub use scene::*;
pub use shadow_atlas::*;
pub use ssbc::*;
pub use vpl::*;

/// No such offset or index.
pub const NONE: u32 = u32::MAX;

/// Most workgroups of a dispatch along an axis, WebGPU's default limit; a longer row is folded into the second axis.
pub const MAX_WORKGROUPS: u32 = 65535;

/// Pairs that one workgroup sorts.
pub const SORT_BLOCK: u32 = 1024;

/// Eight bits of a sort key.
#[derive(ShaderType, Clone, Copy, Debug, Default, PartialEq)]
pub struct Digit {
    /// Lowest bit.
    pub shift: u32,
}
