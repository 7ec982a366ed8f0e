//! Which cameras have fog that bounced light falls on.

use bevy::ecs::entity::EntityHashSet;
use bevy::light::VolumetricFog;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

use super::prepare::LitFog;
use crate::{GiSettings, GlobalIllumination, VplVisibility};

/// Froxels along a picture's longest axis for a probe along the scene's: as few as keep fifty points of the Cornell box
/// within 15 % of traced paths in fog that scatters evenly.
const FROXELS_A_PROBE: u32 = 2;

/// A camera whose fog is to be lit.
#[derive(Component)]
pub(super) struct FogCamera {
    /// What virtual lights see fog by.
    pub visibility: VplVisibility,
    /// Whether the sky lights it.
    pub sky: bool,
    /// Froxels along the longest axis.
    pub froxels: u32,
}

type Cameras<'w, 's> = Query<'w, 's, (RenderEntity, &'static Camera, &'static GlobalIllumination), With<VolumetricFog>>;

pub(super) fn extract_fog(
    mut commands: Commands,
    cameras: Extract<Cameras>,
    marked: Query<Entity, With<FogCamera>>,
    mut lit: Local<EntityHashSet>,
) {
    lit.clear();
    for (entity, camera, illumination) in &cameras {
        let GiSettings { visibility, sky, probes, .. } = illumination.quality.settings();
        if camera.is_active && illumination.technique.uses_grid() && probes > 0 {
            lit.insert(entity);
            commands.entity(entity).insert(FogCamera { visibility, sky: sky > 0, froxels: FROXELS_A_PROBE * probes });
        }
    }
    for entity in marked.iter().filter(|entity| !lit.contains(entity)) {
        commands.entity(entity).remove::<(FogCamera, LitFog)>();
    }
}
