//! The sky: light from all around, beyond the scene.
//!
//! It is what the first camera with global illumination, by its order, is lit by: its `EnvironmentMapLight`, which Bevy also makes of
//! a `GeneratedEnvironmentMapLight` and of an atmosphere's `AtmosphereEnvironmentMapLight`; without one, its `Skybox`. A [`GiLight`]
//! on that camera says how the sky takes part: its intensity scales all of it; [`GiLight::OFF`] leaves Bevy's own unshadowed light.
//!
//! A map is the sky's sharp one, `specular_map`, at its finest level. One that Bevy makes each frame is that of the frame before.
//!
//! # Data
//!
//! | buffer | bytes | holds |
//! |---|---|---|
//! | `table` | 16 KiB | octahedral map of 32 x 32 texels: radiance, cd/m^2, and solid angle, sr |
//! | `lights` | 80 B a direction | directional lights after those of Bevy, in the scene's table of lights |

use bevy::light::{EnvironmentMapLight, GeneratedEnvironmentMapLight, Skybox};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{sampler, storage_buffer_sized, texture_cube, uniform_buffer_sized};
use bevy::render::render_resource::{
    BindingResource, Buffer, BufferDescriptor, PipelineCache, SamplerBindingType, TextureSampleType,
    TextureViewDimension, TextureViewId, UniformBuffer,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy_bounce_shaders::types::{SKY_EDGE, Sky};

use super::GiLight;
use super::extract::spawn_order;
use super::prepare::SceneBuffers;
use super::table::STORAGE_USAGES;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, whole};
use crate::settings::GiWorldSettings;
use crate::{GlobalIllumination, Technique};

/// Texels of the table.
const TEXELS: u32 = SKY_EDGE * SKY_EDGE;
/// Samples along a texel of the table for one along the edge of a face: as many samples as there are texels in the map.
const SAMPLES_A_TEXEL: f32 = 0.0766;
/// At most.
const MAX_SAMPLES: u32 = 32;

/// A cube map that lights the scene.
#[derive(Clone, Debug, PartialEq)]
struct SkyMap {
    image: AssetId<Image>,
    parameters: Sky,
    /// Its texels become others without its becoming another image.
    changes: bool,
}

/// The map of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedSky(Option<SkyMap>);

impl SkyMap {
    fn new(image: &Handle<Image>, intensity: f32, rotation: Quat, gi: GiLight, changes: bool) -> Option<Self> {
        let parameters = Sky {
            rotation: rotation.inverse().into(),
            intensity: intensity * gi.intensity,
            samples: 1,
            max_bounces: gi.bounces,
            share: gi.share,
        };
        let shines = parameters.intensity.is_finite() && parameters.intensity > 0.0 && rotation.is_finite();
        let weighted = gi.share.is_finite() && gi.share > 0.0 && gi.bounces > 0;
        (shines && weighted).then(|| Self { image: image.id(), parameters, changes })
    }
}

type SkyCamera = (
    Entity,
    &'static Camera,
    &'static GlobalIllumination,
    Option<&'static EnvironmentMapLight>,
    Has<GeneratedEnvironmentMapLight>,
    Option<&'static Skybox>,
    Option<&'static GiLight>,
);

/// Finds the map.
pub(super) fn extract_sky(mut extracted: ResMut<ExtractedSky>, cameras: Extract<Query<SkyCamera>>) {
    let first = cameras
        .iter()
        .filter(|(_, camera, settings, ..)| camera.is_active && settings.technique != Technique::None)
        .min_by_key(|(entity, camera, ..)| (camera.order, spawn_order(*entity)));
    extracted.0 = first.and_then(|(_, _, _, environment, generated, skybox, gi)| {
        let gi = gi.copied().unwrap_or_default();
        match (environment, skybox) {
            (Some(map), _) => SkyMap::new(&map.specular_map, map.intensity, map.rotation, gi, generated),
            (None, Some(sky)) => SkyMap::new(sky.image.as_ref()?, sky.brightness, sky.rotation, gi, false),
            (None, None) => None,
        }
    });
}

/// What a table was made of.
#[derive(Clone, Debug, PartialEq)]
struct Measured {
    map: SkyMap,
    view: TextureViewId,
}

/// The sky on the GPU.
#[derive(Resource)]
pub(crate) struct SkyBuffers {
    /// `SKY_EDGE`^2 texels: radiance, cd/m^2; solid angle, sr.
    pub table: Buffer,
    parameters: UniformBuffer<Sky>,
    /// What is to be measured, or was.
    map: Option<Measured>,
    /// The table is not that of the map.
    stale: bool,
    measure: Kernel,
    choose: Kernel,
}

/// Kernels, and room for the table.
pub(super) fn init_sky(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cache: Res<PipelineCache>,
    shaders: Res<GiShaders>,
) {
    let uniform = uniform_buffer_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let map = texture_cube(TextureSampleType::Float { filterable: true });
    let kernel = |entry, bindings: &[_]| {
        let path = "scene/sky.wgsl";
        Kernel::new(&cache, &shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
    };
    // Sky, scene; table, lights; map and its sampler.
    let bindings = [uniform, uniform, write, write, map, sampler(SamplerBindingType::Filtering)];
    commands.insert_resource(SkyBuffers {
        table: device.create_buffer(&BufferDescriptor {
            label: Some("bounce_sky"),
            size: u64::from(TEXELS) * 16,
            usage: STORAGE_USAGES,
            mapped_at_creation: false,
        }),
        parameters: UniformBuffer::default(),
        map: None,
        stale: true,
        measure: kernel("measure", &bindings),
        choose: kernel("choose", &bindings[..4]),
    });
}

/// Whether Bevy's shaders can read it as a cube map.
fn is_cube(image: &GpuImage) -> bool {
    let dimension = image.texture_view_descriptor.as_ref().and_then(|view| view.dimension);
    dimension == Some(TextureViewDimension::Cube)
}

/// Samples along a texel of the table, for a map with faces of that edge.
fn samples(face: u32) -> u32 {
    ((face as f32 * SAMPLES_A_TEXEL).ceil() as u32).clamp(2, MAX_SAMPLES)
}

/// Looks whether there is a sky to be lit by, and how many directions are to stand for it.
pub(super) fn update_sky(
    mut sky: ResMut<SkyBuffers>,
    mut scene: ResMut<SceneBuffers>,
    settings: Res<GiWorldSettings>,
    extracted: Res<ExtractedSky>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let found = extracted.0.as_ref().and_then(|map| Some((map, images.get(map.image).filter(|image| is_cube(image))?)));
    let asked = settings.0.map_or(0, |settings| settings.sky);
    let ready = asked > 0 && sky.measure.is_ready(&cache) && sky.choose.is_ready(&cache);
    let (Some((map, image)), true) = (found, ready) else {
        sky.map = None;
        scene.set_sky_count(0);
        return;
    };
    scene.set_sky_count(asked);
    let measured = Some(Measured { map: map.clone(), view: image.texture_view.id() });
    if sky.map != measured || sky.parameters.buffer().is_none() {
        let samples = samples(image.texture_descriptor.size.width);
        sky.parameters.set(Sky { samples, ..map.parameters });
        sky.parameters.write_buffer(&device, &queue);
        sky.map = measured;
        sky.stale = true;
    }
    sky.stale |= map.changes;
}

/// Measures the sky where it became another, and sets its lights behind those of Bevy.
pub(super) fn light_sky(
    mut sky: ResMut<SkyBuffers>,
    scene: Res<SceneBuffers>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let sky = &mut *sky;
    let image = sky.map.as_ref().and_then(|measured| images.get(measured.map.image));
    let (Some(image), Some(parameters), Some(scene_uniform)) = (image, sky.parameters.binding(), scene.uniform())
    else {
        return;
    };
    let device = ctx.render_device().clone();
    let bindings = [
        parameters,
        scene_uniform,
        whole(&sky.table),
        whole(&scene.lights),
        BindingResource::TextureView(&image.texture_view),
        BindingResource::Sampler(&image.sampler),
    ];
    let choose = sky.choose.bind(&device, &cache, &bindings[..4]);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/sky");
    if std::mem::take(&mut sky.stale) {
        let measure = sky.measure.bind(&device, &cache, &bindings);
        sky.measure.dispatch(encoder, &cache, &[&measure], UVec3::new(TEXELS, 1, 1));
    }
    sky.choose.dispatch(encoder, &cache, &[&choose], UVec3::ONE);
    span.end(encoder);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_has_about_as_many_samples_as_texels() {
        for face in [64, 128, 256, 400] {
            let taken = (samples(face).pow(2) * TEXELS) as f32;
            assert!((0.9..1.7).contains(&(taken / (6 * face * face) as f32)), "{face}");
        }
        assert_eq!((samples(1), samples(8192)), (2, MAX_SAMPLES));
    }

    #[test]
    fn skies_that_give_nothing_are_none() {
        let image = Handle::default();
        let sky = |intensity, gi| SkyMap::new(&image, intensity, Quat::IDENTITY, gi, false);
        assert!(sky(100.0, GiLight::default()).is_some());
        assert!(sky(0.0, GiLight::default()).is_none());
        assert!(sky(f32::NAN, GiLight::default()).is_none());
        assert!(sky(100.0, GiLight::OFF).is_none());
    }
}
