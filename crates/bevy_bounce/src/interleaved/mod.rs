//! interleaved

use bevy::prelude::*;

/// InterleavedShadingPlugin
pub struct InterleavedShadingPlugin;

impl Plugin for InterleavedShadingPlugin {
    fn build(&self, _app: &mut App) {}
}
