//! The sky: light from all around, beyond the scene.
//!
//! It is what the first camera with global illumination, by its order, is lit by: its `EnvironmentMapLight`, which Bevy also makes of
//! a `GeneratedEnvironmentMapLight` and of an atmosphere's `AtmosphereEnvironmentMapLight`; without one, its `Skybox`; with neither, the
//! ambient light that the game has set, alike from all around. A [`GiLight`] on that camera says how the sky takes part: its intensity
//! scales all of it; [`GiLight::OFF`] leaves Bevy's own unshadowed light by environment maps, and of ambient light nothing.
//!
//! A map is the sky's sharp one, `specular_map`, at its finest level. One that Bevy makes each frame is that of the frame before.
//!
//! # Data
//!
//! | buffer | bytes | holds |
//! |---|---|---|
//! | `table` | 16 KiB | octahedral map of 32 x 32 texels: radiance, cd/m^2, and solid angle, sr |
//! | `lights` | 80 B a direction | directional lights after those of Bevy, in the scene's table of lights |

use bevy::ecs::query::QueryData;
use bevy::light::{
    AmbientLight, AtmosphereEnvironmentMapLight, EnvironmentMapLight, GeneratedEnvironmentMapLight, GlobalAmbientLight,
    Skybox,
};
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
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy_bounce_shaders::types::{AMBIENT_SHARE, SKY_EDGE, Sky};

use super::GiLight;
use super::extract::spawn_order;
use super::prepare::SceneBuffers;
use super::table::STORAGE_USAGES;
use crate::camera::Found;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, whole};
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
    /// `None` for one that is white all around.
    image: Option<AssetId<Image>>,
    parameters: Sky,
    /// Its texels become others without its becoming another image.
    changes: bool,
}

/// The map of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedSky(Option<SkyMap>);

impl SkyMap {
    /// `radiance`: that of a white texel, cd/m^2.
    fn new(image: Option<&Handle<Image>>, radiance: Vec3, rotation: Quat, gi: GiLight) -> Option<Self> {
        let parameters = Sky {
            rotation: rotation.inverse().into(),
            radiance: radiance * gi.intensity,
            samples: 1,
            max_bounces: gi.bounces,
            share: gi.share,
        };
        let shines = parameters.radiance.is_finite() && parameters.radiance.max_element() > 0.0 && rotation.is_finite();
        let weighted = gi.share.is_finite() && gi.share > 0.0 && gi.bounces > 0;
        (shines && weighted).then(|| Self { image: image.map(Handle::id), parameters, changes: false })
    }

    fn texture<'a>(&self, images: &'a RenderAssets<GpuImage>, fallbacks: &'a FallbackImage) -> Option<&'a GpuImage> {
        self.image.map_or(Some(&fallbacks.cube), |image| images.get(image).filter(|image| is_cube(image)))
    }
}

/// Radiance of the sky that ambient light stands for, cd/m^2: an open diffuse surface is as bright under either. A
/// camera's own counts before that of the app, which each app of Bevy's has at its default: that is no game's sky.
fn ambient_radiance(own: Option<&AmbientLight>, global: Option<&GlobalAmbientLight>) -> Option<Vec3> {
    let default = GlobalAmbientLight::default();
    let is_set = |light: &&GlobalAmbientLight| {
        light.brightness != default.brightness || light.color.to_linear() != default.color.to_linear()
    };
    let global = || global.filter(is_set).map(|light| (light.color, light.brightness));
    let (color, brightness) = own.map(|light| (light.color, light.brightness)).or_else(global)?;
    Some(color.to_linear().to_vec3().max(Vec3::ZERO) * brightness * AMBIENT_SHARE)
}

/// What of a camera says which sky it has.
#[derive(QueryData)]
pub(super) struct SkyCamera {
    entity: Entity,
    camera: &'static Camera,
    settings: &'static GlobalIllumination,
    environment: Option<&'static EnvironmentMapLight>,
    generated: Has<GeneratedEnvironmentMapLight>,
    of_atmosphere: Has<AtmosphereEnvironmentMapLight>,
    skybox: Option<&'static Skybox>,
    found: Option<&'static Found>,
    gi: Option<&'static GiLight>,
}

impl SkyCameraItem<'_, '_> {
    fn sky(&self, global: Option<&GlobalAmbientLight>) -> Option<SkyMap> {
        let gi = self.gi.copied().unwrap_or_default();
        if let Some(map) = self.environment {
            let radiance = Vec3::splat(map.intensity);
            let sky = SkyMap::new(Some(&map.specular_map), radiance, map.rotation, gi)?;
            return Some(SkyMap { changes: self.generated, ..sky });
        }
        if let Some(sky) = self.skybox {
            return SkyMap::new(Some(sky.image.as_ref()?), Vec3::splat(sky.brightness), sky.rotation, gi);
        }
        // A map that Bevy has yet to make is the sky already.
        let found = self.found.filter(|_| !self.generated && !self.of_atmosphere)?;
        SkyMap::new(None, ambient_radiance(found.ambient(), global)?, Quat::IDENTITY, gi)
    }
}

/// Finds the map.
pub(super) fn extract_sky(
    mut extracted: ResMut<ExtractedSky>,
    cameras: Extract<Query<SkyCamera>>,
    ambient: Extract<Option<Res<GlobalAmbientLight>>>,
) {
    let first = cameras
        .iter()
        .filter(|item| item.camera.is_active && item.settings.technique != Technique::None)
        .min_by_key(|item| (item.camera.order, spawn_order(item.entity)));
    extracted.0 = first.and_then(|camera| camera.sky(ambient.as_deref()));
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

impl SkyBuffers {
    /// Whether it is ambient light.
    pub fn is_ambient(&self) -> bool {
        self.map.as_ref().is_some_and(|measured| measured.map.image.is_none())
    }

    /// The [`Sky`] on the GPU.
    pub fn parameters(&self) -> Option<BindingResource<'_>> {
        self.parameters.binding()
    }
}

/// Kernels, and room for the table.
pub(super) fn init_sky(mut commands: Commands, device: Res<RenderDevice>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let map = texture_cube(TextureSampleType::Float { filterable: true });
    let kernel = |entry, bindings: &[_]| {
        let path = "scene/sky.wgsl";
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
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
    fallbacks: Res<FallbackImage>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let found = extracted.0.as_ref().and_then(|map| Some((map, map.texture(&images, &fallbacks)?)));
    let asked = settings.0.map_or(0, |settings| settings.sky);
    let ready = asked > 0 && are_ready([&sky.measure, &sky.choose], &cache);
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
    fallbacks: Res<FallbackImage>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let sky = &mut *sky;
    let image = sky.map.as_ref().and_then(|measured| measured.map.texture(&images, &fallbacks));
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
        let sky = |radiance, gi| SkyMap::new(Some(&image), Vec3::splat(radiance), Quat::IDENTITY, gi);
        assert!(sky(100.0, GiLight::default()).is_some());
        assert!(sky(0.0, GiLight::default()).is_none());
        assert!(sky(f32::NAN, GiLight::default()).is_none());
        assert!(sky(100.0, GiLight::OFF).is_none());
    }

    #[test]
    fn ambient_light_that_a_game_has_set_is_a_sky() {
        let [usual, none] = [GlobalAmbientLight::default(), GlobalAmbientLight::NONE];
        let red = GlobalAmbientLight { color: Color::linear_rgb(1.0, 0.0, 0.0), ..usual.clone() };
        let bright = GlobalAmbientLight { brightness: 2000.0, ..usual.clone() };
        let own = AmbientLight { brightness: 50.0, ..default() };
        let radiance = |own, global| ambient_radiance(own, global).map(|radiance| radiance / AMBIENT_SHARE);
        assert_eq!(radiance(None, None), None);
        assert_eq!(radiance(None, Some(&usual)), None, "what each app has");
        assert_eq!(radiance(None, Some(&none)), Some(Vec3::ZERO));
        assert_eq!(radiance(None, Some(&red)), Some(Vec3::new(80.0, 0.0, 0.0)));
        assert_eq!(radiance(None, Some(&bright)), Some(Vec3::splat(2000.0)));
        assert_eq!(radiance(Some(&own), Some(&bright)), Some(Vec3::splat(50.0)));
        assert_eq!(radiance(Some(&AmbientLight::default()), None), Some(Vec3::splat(80.0)));
    }
}
