//! What happens to the skies of cameras, and to what mirrors them.

use bevy::light::Skybox;
use bevy::pbr::ScreenSpaceReflections;
use bevy::prelude::*;

use super::Soak;
use super::actions::{camera, color};

/// An even sky, or none.
fn even_sky(soak: &mut Soak) -> Option<EnvironmentMapLight> {
    let color = color(&mut soak.random);
    let (intensity, remove) = (2000.0 * soak.random.f32(), soak.random.u32(0..3) == 0);
    let mut images = soak.stage.world().resource_mut::<Assets<Image>>();
    (!remove).then(|| EnvironmentMapLight { intensity, ..EnvironmentMapLight::solid_color(&mut images, color) })
}

/// One that lights, for a camera, or none.
pub fn sky(soak: &mut Soak) {
    let (camera, even) = (camera(soak), even_sky(soak));
    let mut camera = soak.stage.world().entity_mut(camera);
    match even {
        Some(even) => camera.insert(even),
        None => camera.remove::<EnvironmentMapLight>(),
    };
}

/// One that is seen.
pub fn skybox(soak: &mut Soak) {
    let (camera, even) = (camera(soak), even_sky(soak));
    let mut camera = soak.stage.world().entity_mut(camera);
    match even {
        Some(EnvironmentMapLight { specular_map, intensity, .. }) => {
            camera.insert(Skybox { image: Some(specular_map), brightness: intensity, ..default() })
        }
        None => camera.remove::<Skybox>(),
    };
}

/// Ambient light of the app or of a camera, or none.
pub fn ambient_light(soak: &mut Soak) {
    let camera = camera(soak);
    let (color, brightness) = (color(&mut soak.random), 2000.0 * soak.random.f32());
    let choice = soak.random.u32(0..4);
    let world = soak.stage.world();
    match choice {
        0 => world.insert_resource(GlobalAmbientLight::NONE),
        1 => world.insert_resource(GlobalAmbientLight { color, brightness, ..default() }),
        2 => _ = world.entity_mut(camera).insert(AmbientLight { color, brightness, ..default() }),
        _ => _ = world.entity_mut(camera).remove::<AmbientLight>(),
    }
}

/// Bevy's reflections on the screen, or none.
pub fn reflections(soak: &mut Soak) {
    let (camera, remove) = (camera(soak), soak.random.u32(0..3) == 0);
    let mut camera = soak.stage.world().entity_mut(camera);
    match remove {
        true => camera.remove::<ScreenSpaceReflections>(),
        false => camera.insert(ScreenSpaceReflections::default()),
    };
}

pub fn drop_sky_asset(soak: &mut Soak) {
    let camera = camera(soak);
    let world = soak.stage.world();
    if let Some(map) = world.get::<EnvironmentMapLight>(camera).map(|sky| sky.specular_map.clone()) {
        world.resource_mut::<Assets<Image>>().remove(&map);
    }
}
