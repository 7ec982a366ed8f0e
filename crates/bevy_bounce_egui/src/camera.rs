//! The panel's camera, which is there while the panel is open: it draws over the picture of the first camera with bounced light,
//! whose own render passes it leaves alone.

use bevy::camera::visibility::RenderLayers;
use bevy::camera::{CameraOutputMode, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy::window::PrimaryWindow;
use bevy_bounce::GlobalIllumination;
use bevy_egui::{EguiManagedTextures, EguiMultipassSchedule};

use crate::{BouncePanel, BouncePanelPass};

/// Marks the panel's camera.
#[derive(Component, Clone, Copy, Debug)]
pub struct PanelCamera;

/// Spawns and despawns the camera, and keeps it on top of the picture.
pub(crate) fn follow(
    mut commands: Commands,
    mut panel: ResMut<BouncePanel>,
    mut textures: ResMut<EguiManagedTextures>,
    cameras: Query<(&Camera, &RenderTarget, Has<GlobalIllumination>), Without<PanelCamera>>,
    window: Query<Entity, With<PrimaryWindow>>,
    mut ours: Query<(Entity, &mut Camera, &RenderTarget), With<PanelCamera>>,
) {
    let lit =
        cameras.iter().filter(|(camera, _, lit)| *lit && camera.is_active).min_by_key(|(camera, ..)| camera.order);
    let Some((_, target, _)) = lit.filter(|_| panel.open) else {
        for (camera, ..) in &ours {
            commands.entity(camera).despawn();
            textures.retain(|(context, _), _| *context != camera);
        }
        panel.bypass_change_detection().settings = 0;
        return;
    };
    let highest = cameras.iter().map(|(camera, ..)| camera.order).max().unwrap_or_default();
    let order = highest.saturating_add(1);
    let Ok((entity, mut camera, over)) = ours.single_mut() else {
        commands.spawn(panel_camera(target.clone(), order));
        return;
    };
    if camera.order != order {
        camera.order = order;
    }
    let primary = window.single().ok();
    if over.normalize(primary) != target.normalize(primary) {
        commands.entity(entity).insert(target.clone());
    }
}

/// Draws nothing but the panel, and blends it over what is in the target.
fn panel_camera(target: RenderTarget, order: isize) -> impl Bundle {
    let camera = Camera {
        order,
        clear_color: ClearColorConfig::Custom(Color::NONE),
        output_mode: CameraOutputMode::Write {
            blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
            clear_color: ClearColorConfig::None,
        },
        ..default()
    };
    (
        Name::new("bounce panel"),
        PanelCamera,
        Camera2d,
        camera,
        target,
        // Gizmos are of the scene.
        RenderLayers::none(),
        Msaa::Off,
        Tonemapping::None,
        DebandDither::Disabled,
        EguiMultipassSchedule::new(BouncePanelPass),
    )
}
