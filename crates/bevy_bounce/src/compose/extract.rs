//! Which cameras have bounced light.

use bevy::pbr::deferred::SkipDeferredLighting;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::sync_world::RenderEntity;
use bevy::render::{Extract, MainWorld};

use super::pipelines::{EnvironmentMaps, ViewPipelines};
use crate::view::{GiView, ViewTextures};
use crate::{GiBudget, GiIsolate, GlobalIllumination};

type Cameras<'w, 's> = Query<
    'w,
    's,
    (RenderEntity, &'static Camera, &'static GlobalIllumination, Option<&'static GiIsolate>, Option<&'static GiBudget>),
    With<Camera3d>,
>;

/// Marks the views of cameras with bounced light, and takes everything from those that no longer have it.
pub(crate) fn extract_views(
    mut commands: Commands,
    cameras: Extract<Cameras>,
    views: Query<Entity, With<GiView>>,
    mut active: Local<HashSet<Entity>>,
) {
    active.clear();
    for (entity, camera, illumination, isolate, budget) in &cameras {
        if camera.is_active && illumination.is_active() {
            active.insert(entity);
            let technique = illumination.technique;
            let (settings, stated) = (illumination.given(budget), illumination.settings());
            let isolate = isolate.copied().unwrap_or_default();
            let reset = illumination.reset;
            commands.entity(entity).insert(GiView { isolate, technique, settings, stated, reset });
        }
    }
    for entity in views.iter().filter(|entity| !active.contains(entity)) {
        commands
            .entity(entity)
            .remove::<(GiView, ViewTextures, ViewPipelines, EnvironmentMaps, SkipDeferredLighting)>();
    }
}

/// Resets have been seen to.
pub(crate) fn hand_back_resets(mut main_world: ResMut<MainWorld>) {
    let mut cameras = main_world.query::<(&Camera, &mut GlobalIllumination)>();
    for (camera, mut illumination) in cameras.iter_mut(&mut main_world) {
        if camera.is_active && illumination.reset {
            illumination.bypass_change_detection().reset = false;
        }
    }
}
