//! Which cameras have bounced light.

use bevy::pbr::deferred::SkipDeferredLighting;
use bevy::platform::collections::HashSet;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

use super::pipelines::ViewPipelines;
use crate::view::{GiView, ViewTextures};
use crate::{GiIsolate, GlobalIllumination};

/// Marks the views of cameras with bounced light, and takes everything from those that no longer have it.
pub(super) fn extract_views(
    mut commands: Commands,
    cameras: Extract<Query<(RenderEntity, &Camera, &GlobalIllumination, Option<&GiIsolate>), With<Camera3d>>>,
    views: Query<Entity, With<GiView>>,
    mut active: Local<HashSet<Entity>>,
) {
    active.clear();
    for (entity, camera, illumination, isolate) in &cameras {
        if camera.is_active && illumination.is_active() {
            active.insert(entity);
            let technique = illumination.technique;
            let settings = illumination.settings();
            let isolate = isolate.copied().unwrap_or_default();
            commands.entity(entity).insert(GiView { isolate, technique, settings });
        }
    }
    for entity in views.iter().filter(|entity| !active.contains(entity)) {
        commands.entity(entity).remove::<(GiView, ViewTextures, ViewPipelines, SkipDeferredLighting)>();
    }
}
