//! avg

use bevy::prelude::*;

/// AvgPlugin
pub struct AvgPlugin;

impl Plugin for AvgPlugin {
    fn build(&self, _app: &mut App) {}
}
