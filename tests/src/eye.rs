//! Further cameras of a [`Stage`], each with a target of its own that holds what it measures.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, RenderTarget};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy_bounce::GlobalIllumination;
use bevy_bounce_examples::capture::decode;

use crate::picture::Picture;
use crate::stage::Stage;

/// A camera whose whole picture can be read, in cd/m^2.
#[derive(Clone)]
pub struct Eye {
    /// The camera.
    pub camera: Entity,
    /// Its target: half floats, pre-exposed, not tonemapped.
    pub target: Handle<Image>,
    size: UVec2,
    exposure: Exposure,
}

impl Eye {
    /// Spawns a camera with what `bundle` gives it, over what the stage gives to every camera.
    pub fn open(stage: &mut Stage, size: UVec2, exposure: Exposure, bundle: impl Bundle) -> Self {
        let world = stage.world();
        let target = world.resource_mut::<Assets<Image>>().add(target(size));
        let camera = world.spawn(Camera3d::default()).id();
        let over = RenderTarget::Image(target.clone().into());
        let mut entity = world.entity_mut(camera);
        entity.remove::<GlobalIllumination>();
        entity.insert((over, exposure, Tonemapping::None, DebandDither::Disabled));
        entity.insert(bundle);
        Self { camera, target, size, exposure }
    }

    /// What it saw in the last frame.
    pub fn picture(&self, stage: &Stage) -> Picture {
        let pixels = decode(&stage.read(&self.target), self.exposure);
        Picture { width: self.size.x as usize, height: self.size.y as usize, pixels }
    }

    /// Throws frames away until all that the camera needs has been compiled. In its first it has no target yet.
    pub fn settle(&self, stage: &mut Stage) {
        stage.frame(Duration::ZERO);
        stage.settle();
    }

    /// Gives the target another size.
    pub fn resize(&mut self, stage: &mut Stage, size: UVec2) {
        self.size = size;
        let mut images = stage.world().resource_mut::<Assets<Image>>();
        if let Err(error) = images.insert(&self.target, target(size)) {
            panic!("{error}");
        }
    }

    /// Takes the camera away.
    pub fn close(self, stage: &mut Stage) {
        stage.world().despawn(self.camera);
    }
}

fn target(size: UVec2) -> Image {
    let size = Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let usages = RenderAssetUsages::RENDER_WORLD;
    let mut image = Image::new_uninit(size, TextureDimension::D2, TextureFormat::Rgba16Float, usages);
    image.texture_descriptor.usage |=
        TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC;
    image
}
