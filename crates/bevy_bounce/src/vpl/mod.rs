//! vpl

use bevy::prelude::*;

/// VplPlugin
pub struct VplPlugin;

impl Plugin for VplPlugin {
    fn build(&self, _app: &mut App) {}
}
