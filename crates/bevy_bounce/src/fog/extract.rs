//! Which cameras have fog that bounced light falls on.

use bevy::ecs::entity::EntityHashSet;
use bevy::light::VolumetricFog;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

use super::prepare::LitFog;
use crate::GlobalIllumination;

/// A camera whose fog is to be lit.
#[derive(Component)]
pub(super) struct FogCamera;

type Cameras<'w, 's> = Query<'w, 's, (RenderEntity, &'static Camera, &'static GlobalIllumination), With<VolumetricFog>>;

pub(super) fn extract_fog(
    mut commands: Commands,
    cameras: Extract<Cameras>,
    marked: Query<Entity, With<FogCamera>>,
    mut lit: Local<EntityHashSet>,
) {
    lit.clear();
    for (entity, camera, illumination) in &cameras {
        if camera.is_active && illumination.technique.uses_grid() && illumination.quality.settings().probes > 0 {
            lit.insert(entity);
            commands.entity(entity).insert(FogCamera);
        }
    }
    for entity in marked.iter().filter(|entity| !lit.contains(entity)) {
        commands.entity(entity).remove::<(FogCamera, LitFog)>();
    }
}
