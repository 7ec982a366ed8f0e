//! Into the picture.

use bevy::prelude::*;
use bevy::render::extract_component::ExtractComponent;

/// What the picture of this camera holds; for looking at one term alone.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub enum GiIsolate {
    /// Everything.
    #[default]
    All,
    /// What Bevy lights by itself, and emission.
    Direct,
    /// Bounced light alone: no sky, fog, forward or blended surfaces.
    Indirect,
}

/// Replaces Bevy's deferred lighting on cameras with [`GlobalIllumination`](crate::GlobalIllumination).
pub struct GiComposePlugin;

impl Plugin for GiComposePlugin {
    fn build(&self, _app: &mut App) {}
}
