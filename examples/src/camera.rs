//! What a run asks of every camera: target, exposure, global illumination.

use bevy::camera::{Hdr, ImageRenderTarget, RenderTarget, ShadowLodOrigin};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::core_pipeline::tonemapping::DebandDither;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use crate::Run;
use crate::capture::Targets;
use crate::options::Sky;

/// Applies the run's options to every [`Camera3d`] as it is spawned.
pub struct CameraPlugin;

impl Plugin for CameraPlugin {
    fn build(&self, app: &mut App) {
        app.add_observer(apply);
    }
}

fn apply(
    add: On<Add, Camera3d>,
    run: Res<Run>,
    targets: Option<Res<Targets>>,
    mut images: ResMut<Assets<Image>>,
    mut commands: Commands,
) {
    let mut camera = commands.entity(add.entity);
    camera.insert((Hdr, run.isolate, DebandDither::Disabled));
    if let Some(ev100) = run.exposure {
        camera.insert(bevy::camera::Exposure { ev100 });
    }
    if let Some(targets) = targets {
        let target = ImageRenderTarget { handle: targets.display.clone(), scale_factor: 1.0 };
        camera.insert((RenderTarget::Image(target), ShadowLodOrigin));
    }
    if let Some(sky) = run.sky {
        camera.insert(constant_sky(sky, &mut images));
    }
    match &run.illumination {
        Some(illumination) => camera.insert(illumination.clone()),
        None => camera.remove::<GlobalIllumination>(),
    };
    if run.plain_bevy {
        camera.insert((DepthPrepass, DeferredPrepass, Msaa::Off));
    }
}

/// The same radiance from everywhere, as light and as background.
fn constant_sky(Sky(radiance): Sky, images: &mut Assets<Image>) -> (EnvironmentMapLight, Skybox) {
    let intensity = radiance.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    let [red, green, blue] = radiance.map(|channel| channel / intensity);
    let light = EnvironmentMapLight::solid_color(images, Color::linear_rgb(red, green, blue));
    let background = Skybox { image: Some(light.specular_map.clone()), brightness: intensity, ..default() };
    (EnvironmentMapLight { intensity, ..light }, background)
}
