//! The volume to the render world, and the scene's bounds back.

use bevy::light::IrradianceVolume;
use bevy::prelude::*;
use bevy::render::{Extract, MainWorld};

use super::volume::{ProbeVolume, SceneBox};
use crate::scene::SceneBuffers;

/// The volume as this frame draws it.
#[derive(Resource, Default)]
pub(super) struct ExtractedProbes(pub Option<Probes>);

/// See [`ExtractedProbes`].
#[derive(Clone, Copy)]
pub(super) struct Probes {
    /// Where it is.
    pub volume: ProbeVolume,
    /// What Bevy's shaders read.
    pub image: AssetId<Image>,
    /// Cd/m^2 of a texel that holds 1.
    pub intensity: f32,
}

pub(super) fn extract_probes(
    mut extracted: ResMut<ExtractedProbes>,
    volumes: Extract<Query<(&ProbeVolume, &IrradianceVolume)>>,
) {
    extracted.0 = volumes.iter().next().map(|(volume, light)| Probes {
        volume: *volume,
        image: light.voxels.id(),
        intensity: light.intensity,
    });
}

/// Tells the main world where the scene was in the last frame that was drawn.
pub(super) fn return_bounds(mut main: ResMut<MainWorld>, scene: Option<Res<SceneBuffers>>) {
    if let (Some(mut held), Some(scene)) = (main.get_resource_mut::<SceneBox>(), scene) {
        *held = SceneBox { bounds: scene.inner_bounds(), moves: scene.regions().len() > 1 };
    }
}
