//! From the GPU to a file: what the display shows as PNG, what the camera measures as EXR.

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::core_pipeline::tonemapping::tonemapping;
use bevy::core_pipeline::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, PollType, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TextureDimension, TextureFormat, TextureUsages,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::ViewTarget;
use half::f16;
use image::{DynamicImage, ImageFormat, Rgb32FImage, RgbImage};

use crate::run::Output;
use crate::{Error, Run};

/// Render targets of a windowless run.
pub struct CapturePlugin;

/// Where windowless cameras render to.
#[derive(Resource, Clone, Debug)]
pub struct Targets {
    /// Tonemapped, sRGB, 8 bits a channel.
    pub display: Handle<Image>,
    /// Copy of the pre-exposed picture before tonemapping, half floats.
    pub scene: Handle<Image>,
}

/// On a camera: copies its picture before tonemapping into this image.
#[derive(Component, ExtractComponent, Clone, Debug)]
pub struct CaptureScene(pub Handle<Image>);

impl Plugin for CapturePlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(ExtractComponentPlugin::<CaptureScene>::default());
        let run = app.world().resource::<Run>();
        if run.headless {
            let size = run.size;
            let mut images = app.world_mut().resource_mut::<Assets<Image>>();
            let attachment = TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
            let targets = Targets {
                display: images.add(image(size, TextureFormat::Rgba8UnormSrgb, attachment)),
                scene: images.add(scene_image(size)),
            };
            app.insert_resource(targets);
        }
        if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
            let order = copy_scene.after(Core3dSystems::EarlyPostProcess).before(tonemapping);
            render_app.add_systems(Core3d, order.in_set(Core3dSystems::PostProcess));
        }
    }
}

fn copy_scene(
    view: ViewQuery<(&ViewTarget, &CaptureScene)>,
    images: Res<RenderAssets<GpuImage>>,
    mut context: RenderContext,
) {
    let (target, capture) = view.into_inner();
    let Some(image) = images.get(&capture.0) else { return };
    let source = target.main_texture();
    if source.size() == image.texture.size() && source.format() == image.texture.format() {
        let (from, to) = (source.as_image_copy(), image.texture.as_image_copy());
        context.command_encoder().copy_texture_to_texture(from, to, source.size());
    }
}

/// Reads the first mip level of a finished image, rows packed. Needs the frame to be rendered, not pipelined.
pub fn read(app: &App, image: &Handle<Image>) -> Result<Vec<u8>, Error> {
    let failed = |what: &str| Error::Render(format!("reading back the picture: {what}"));
    let world = app.get_sub_app(RenderApp).ok_or_else(|| failed("no renderer"))?.world();
    let texture = &world
        .resource::<RenderAssets<GpuImage>>()
        .get(image)
        .ok_or_else(|| failed("the target is not on the GPU"))?
        .texture;
    let (device, queue) = (world.resource::<RenderDevice>(), world.resource::<RenderQueue>());
    let size = texture.size();
    let texel = texture.format().block_copy_size(None).ok_or_else(|| failed("no such format"))?;
    let row = size.width * texel;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("capture_readback"),
        size: u64::from(padded) * u64::from(size.height),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("capture_readback") });
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), TexelCopyBufferInfo { buffer: &buffer, layout }, size);
    queue.submit([encoder.finish()]);
    buffer.slice(..).map_async(MapMode::Read, |_| ());
    device.poll(PollType::wait_indefinitely()).map_err(|error| failed(&error.to_string()))?;
    let mapped = buffer.slice(..).get_mapped_range();
    Ok(mapped.chunks_exact(padded as usize).flat_map(|line| &line[..row as usize]).copied().collect())
}

/// The captured picture in cd/m^2: what was stored, divided by the camera's exposure.
pub fn luminances(app: &mut App) -> Result<Vec<[f32; 3]>, Error> {
    let targets = app.world().resource::<Targets>().clone();
    let mut cameras = app.world_mut().query_filtered::<Option<&Exposure>, With<CaptureScene>>();
    let exposure = cameras.iter(app.world()).next().flatten().copied().unwrap_or_default();
    Ok(decode(&read(app, &targets.scene)?, exposure))
}

/// Half-float texels in cd/m^2.
pub fn decode(texels: &[u8], exposure: Exposure) -> Vec<[f32; 3]> {
    let exposure = exposure.exposure();
    let channel = |bytes: &[u8]| f16::from_le_bytes([bytes[0], bytes[1]]).to_f32() / exposure;
    texels.chunks_exact(8).map(|texel| [channel(&texel[0..2]), channel(&texel[2..4]), channel(&texel[4..6])]).collect()
}

/// An image that a camera's picture can be copied into.
pub fn scene_image(size: UVec2) -> Image {
    image(size, TextureFormat::Rgba16Float, TextureUsages::COPY_DST | TextureUsages::TEXTURE_BINDING)
}

fn image(size: UVec2, format: TextureFormat, usage: TextureUsages) -> Image {
    let size = Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::RENDER_WORLD);
    image.texture_descriptor.usage = usage | TextureUsages::COPY_SRC;
    image
}

/// Writes every picture that the run asks for.
pub fn write(app: &mut App, run: &Run) -> Result<(), Error> {
    for output in &run.outputs {
        let (path, picture, format) = match output {
            Output::Png(path) => {
                let display = app.world().resource::<Targets>().display.clone();
                let rgb =
                    read(app, &display)?.chunks_exact(4).flat_map(|texel| [texel[0], texel[1], texel[2]]).collect();
                (path, RgbImage::from_raw(run.size.x, run.size.y, rgb).map(DynamicImage::from), ImageFormat::Png)
            }
            Output::Exr(path) => {
                let rgb = luminances(app)?.into_iter().flatten().collect();
                (path, Rgb32FImage::from_raw(run.size.x, run.size.y, rgb).map(DynamicImage::from), ImageFormat::OpenExr)
            }
        };
        let picture = picture.ok_or_else(|| Error::Render("the picture has another size than asked for".into()))?;
        picture
            .save_with_format(path, format)
            .map_err(|error| Error::file(path, format!("cannot be written: {error}")))?;
    }
    Ok(())
}
