//! Volumetric fog that comes and goes, the cameras that show it and the lights that Bevy lights it by.

use bevy::asset::RenderAssetUsages;
use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use fastrand::Rng;

use super::Soak;
use super::actions::{camera, color, place, some, unit, vector};

/// Most that there may be at a time.
const FOGS: usize = 3;

/// Any fog, now and then without density, that absorbs nothing, or that scatters all but straight on.
fn volume(random: &mut Rng) -> FogVolume {
    let density_factor = if random.u32(0..8) == 0 { 0.0 } else { 0.5 * random.f32() };
    let absorption = if random.u32(0..8) == 0 { 0.0 } else { random.f32() };
    let scattering_asymmetry = if random.u32(0..8) == 0 { 1.0 } else { unit(random) };
    FogVolume {
        fog_color: color(random),
        density_factor,
        density_texture: None,
        density_texture_offset: vector(random),
        absorption,
        scattering: random.f32(),
        scattering_asymmetry,
        light_tint: color(random),
        light_intensity: 2.0 * random.f32(),
    }
}

/// Densities at random, in a texture of up to four texels an edge.
fn densities(random: &mut Rng) -> Image {
    let [width, height, depth_or_array_layers] = std::array::from_fn(|_| random.u32(1..=4));
    let texels = (0..width * height * depth_or_array_layers).map(|_| random.u8(..)).collect();
    let size = Extent3d { width, height, depth_or_array_layers };
    Image::new(size, TextureDimension::D3, texels, TextureFormat::R8Unorm, RenderAssetUsages::RENDER_WORLD)
}

/// One with a texture, every other time.
fn textured_volume(soak: &mut Soak) -> FogVolume {
    let volume = volume(&mut soak.random);
    let image = soak.random.bool().then(|| densities(&mut soak.random));
    let mut images = soak.stage.world().resource_mut::<Assets<Image>>();
    FogVolume { density_texture: image.map(|image| images.add(image)), ..volume }
}

pub fn spawn_fog(soak: &mut Soak) {
    if soak.fogs.len() < FOGS {
        let mut place = place(&mut soak.random);
        place.scale *= 1.0 + 4.0 * soak.random.f32();
        let fog = textured_volume(soak);
        let fog = soak.stage.world().spawn((fog, place)).id();
        soak.fogs.push(fog);
    }
}

pub fn despawn_fog(soak: &mut Soak) {
    if let Some(fog) = some(&mut soak.random, &soak.fogs) {
        soak.stage.world().despawn(fog);
        soak.fogs.retain(|other| *other != fog);
    }
}

pub fn move_fog(soak: &mut Soak) {
    if let Some(fog) = some(&mut soak.random, &soak.fogs) {
        let place = place(&mut soak.random);
        soak.stage.world().entity_mut(fog).insert(place);
    }
}

pub fn edit_fog(soak: &mut Soak) {
    if let Some(fog) = some(&mut soak.random, &soak.fogs) {
        let volume = textured_volume(soak);
        soak.stage.world().entity_mut(fog).insert(volume);
    }
}

pub fn drop_fog_asset(soak: &mut Soak) {
    let Some(fog) = some(&mut soak.random, &soak.fogs) else { return };
    let world = soak.stage.world();
    if let Some(texture) = world.get::<FogVolume>(fog).and_then(|fog| fog.density_texture.clone()) {
        world.resource_mut::<Assets<Image>>().remove(&texture);
    }
}

/// A camera shows fog, or no longer does.
pub fn camera_fog(soak: &mut Soak) {
    let camera = camera(soak);
    let random = &mut soak.random;
    let remove = random.u32(0..4) == 0;
    let fog = VolumetricFog {
        ambient_color: color(random),
        ambient_intensity: random.f32(),
        jitter: if random.bool() { random.f32() } else { 0.0 },
        step_count: random.u32(0..40),
    };
    let mut camera = soak.stage.world().entity_mut(camera);
    match remove {
        true => camera.remove::<VolumetricFog>(),
        false => camera.insert(fog),
    };
}

/// A light is volumetric, or no longer is.
pub fn volumetric_light(soak: &mut Soak) {
    let Some(light) = some(&mut soak.random, &soak.lights) else { return };
    let mut light = soak.stage.world().entity_mut(light);
    if light.take::<VolumetricLight>().is_none() {
        light.insert(VolumetricLight);
    }
}
