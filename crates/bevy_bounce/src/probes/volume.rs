//! The volume in the main world: one entity while a camera asks for it, over the scene's bounds.

use std::any::TypeId;

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::camera::visibility::{NoFrustumCulling, VisibleEntities};
use bevy::image::ImageSampler;
use bevy::light::cluster::ClusterVisibilityClass;
use bevy::light::{IrradianceVolume, LightProbe};
use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy::render::get_adreno_model;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages, WgpuFeatures};
use bevy::render::renderer::{RenderAdapterInfo, RenderDevice};

use crate::avg::PHASE;
use crate::{GlobalIllumination, VplVisibility};

/// Steps of the spacing in a doubling: it is a function of the scene's bounds alone, and changes seldom.
const SPACING_STEPS: f32 = 8.0;
/// Probes from the bounds to the end of the volume: one beyond the surfaces there, and half a spacing for what moves out of the bounds.
const BORDER: f32 = 1.5;
/// Weight of the volume beside others, as Bevy takes it: it falls from the middle outwards at a share of this slope. Volumes of
/// the game outweigh it wherever they are, and alone it counts in full, for Bevy divides by the sum of the weights.
const FALLOFF: f32 = 1000.0;

/// The volume of light probes that the plugins keep over the scene, on an entity of its own with `IrradianceVolume`.
///
/// Cameras without virtual point lights do not see it. Irradiance volumes of the game win where they are; on devices on which Bevy
/// reads but one, a camera that sees one of the game's sees no other.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct ProbeVolume {
    /// Lowest corner, world units; the first probe is half a spacing inside.
    pub origin: Vec3,
    /// World units between probes.
    pub spacing: f32,
    /// Probes along each axis.
    pub dims: UVec3,
    #[reflect(ignore)]
    pub(super) visibility: VplVisibility,
}

impl ProbeVolume {
    /// A cubic lattice over the bounds with `count` probes along the longest axis at most. A function of its arguments alone;
    /// place and spacing go in steps, so that a moving object does not make the probes swim. Over bounds that move with a camera the
    /// number of probes is the same wherever they are.
    pub(super) fn over(scene: &SceneBox, count: u32) -> Self {
        let (min, max) = scene.bounds.map_or((Vec3::ZERO, Vec3::ZERO), |b| (Vec3::from(b.min), Vec3::from(b.max)));
        let extent = (max - min).max_element().max(1e-4 * max.abs().max(min.abs()).max_element()).max(1e-6);
        let mut step = (SPACING_STEPS * (extent / count as f32).log2()).floor();
        loop {
            let spacing = (step / SPACING_STEPS).exp2();
            let low = (min / spacing - BORDER - PHASE).floor() + PHASE;
            let end = if scene.moves { (max - min) / spacing + BORDER + 1.0 } else { max / spacing - low };
            let dims = (end + BORDER).ceil().as_uvec3();
            if dims.max_element() <= count {
                return Self { origin: low * spacing, spacing, dims, visibility: VplVisibility::default() };
            }
            step += 1.0;
        }
    }

    /// Bevy's light probes are unit cubes.
    fn transform(&self) -> Transform {
        let size = self.dims.as_vec3() * self.spacing;
        Transform::from_translation(self.origin + 0.5 * size).with_scale(size)
    }

    /// Texels of its image. See `probes/fill.wgsl`.
    pub(super) fn texels(&self) -> UVec3 {
        self.dims * UVec3::new(1, 2, 3)
    }

    fn image(&self) -> Image {
        let texels = self.texels();
        let size = Extent3d { width: texels.x, height: texels.y, depth_or_array_layers: texels.z };
        let usages = RenderAssetUsages::RENDER_WORLD;
        let mut image = Image::new_uninit(size, TextureDimension::D3, TextureFormat::Rgba16Float, usages);
        image.texture_descriptor.usage =
            TextureUsages::TEXTURE_BINDING | TextureUsages::STORAGE_BINDING | TextureUsages::COPY_SRC;
        image.sampler = ImageSampler::linear();
        image
    }
}

/// Whether Bevy's shaders read one irradiance volume a view, the nearest, rather than all.
#[derive(Resource, Clone, Copy)]
pub(super) struct OneVolume(pub bool);

impl OneVolume {
    /// What `binding_arrays_are_usable` of bevy_pbr/src/light_probe/mod.rs asks of a device, which is private.
    pub fn on(device: &RenderDevice, adapter: &RenderAdapterInfo) -> Self {
        /// Textures of a material and of eight volumes.
        const ELEMENTS: u32 = 24;
        let limits = device.limits();
        let features = WgpuFeatures::TEXTURE_BINDING_ARRAY
            | WgpuFeatures::SAMPLED_TEXTURE_AND_STORAGE_BUFFER_ARRAY_NON_UNIFORM_INDEXING;
        let reads_all = device.features().contains(features)
            && limits.max_binding_array_elements_per_shader_stage >= ELEMENTS
            && limits.max_binding_array_sampler_elements_per_shader_stage >= ELEMENTS
            && get_adreno_model(adapter).is_none_or(|model| model > 610);
        Self(!reads_all)
    }
}

/// What probes lie over, as the render world last knew it.
#[derive(Resource, Default)]
pub(super) struct SceneBox {
    /// Bounds of the scene, or of what of it is near the cameras.
    pub bounds: Option<Aabb3d>,
    /// Whether they move with the cameras.
    pub moves: bool,
}

/// What cameras ask of the volume.
#[derive(Clone, Copy)]
struct Wanted {
    count: u32,
    visibility: VplVisibility,
    exposure: f32,
}

impl Wanted {
    /// `None` where that camera asks for none.
    fn by(camera: &Camera, illumination: &GlobalIllumination, exposure: Option<&Exposure>) -> Option<Self> {
        if !camera.is_active || !illumination.technique.uses_grid() {
            return None;
        }
        let settings = illumination.quality.settings();
        let exposure = exposure.copied().unwrap_or_default().exposure();
        let exposure = if exposure.is_normal() && exposure > 0.0 { exposure } else { Exposure::default().exposure() };
        (settings.probes > 0).then_some(Self { count: settings.probes, visibility: settings.visibility, exposure })
    }

    /// What satisfies both; the darkest picture decides on the scale, for bright light has room above it.
    fn and(self, other: Self) -> Self {
        Self {
            count: self.count.max(other.count),
            visibility: self.visibility.max(other.visibility),
            exposure: self.exposure.max(other.exposure),
        }
    }

    /// Cd/m^2 of a texel that holds 1: with it the texels of what is well exposed are near 1.
    fn intensity(&self) -> f32 {
        self.exposure.recip().log2().round().exp2()
    }
}

/// Spawns, places and removes the volume.
pub(super) fn keep_volume(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    scene: Res<SceneBox>,
    cameras: Query<(&Camera, &GlobalIllumination, Option<&Exposure>), With<Camera3d>>,
    mut volumes: Query<(Entity, &mut ProbeVolume, &mut IrradianceVolume, &mut Transform)>,
) {
    let wanted =
        cameras.iter().filter_map(|(camera, gi, exposure)| Wanted::by(camera, gi, exposure)).reduce(Wanted::and);
    let Some(wanted) = wanted else {
        for (entity, ..) in &volumes {
            commands.entity(entity).despawn();
        }
        return;
    };
    let placed = ProbeVolume { visibility: wanted.visibility, ..ProbeVolume::over(&scene, wanted.count) };
    let intensity = wanted.intensity();
    let Ok((_, mut volume, mut light, mut transform)) = volumes.single_mut() else {
        let voxels = images.add(placed.image());
        commands.spawn((
            Name::new("bounced light"),
            placed,
            IrradianceVolume { voxels, intensity, affects_lightmapped_meshes: false },
            LightProbe { falloff: Vec3::splat(FALLOFF) },
            placed.transform(),
            NoFrustumCulling,
        ));
        return;
    };
    if volume.dims != placed.dims {
        let image = placed.image();
        if images.insert(&light.voxels, image.clone()).is_err() {
            light.voxels = images.add(image);
        }
    }
    volume.set_if_neq(placed);
    transform.set_if_neq(placed.transform());
    if light.intensity != intensity {
        light.intensity = intensity;
    }
}

/// Hides the volume from cameras that have no virtual point lights, whose picture is Bevy's own; and from those that see one of
/// the game's, where Bevy reads one alone: of several it would read the nearest in the places of all.
pub(super) fn hide_volume(
    one_volume: Res<OneVolume>,
    volumes: Query<Entity, With<ProbeVolume>>,
    others: Query<(), (With<IrradianceVolume>, Without<ProbeVolume>)>,
    mut cameras: Query<(&mut VisibleEntities, Option<&GlobalIllumination>), With<Camera3d>>,
) {
    if volumes.is_empty() {
        return;
    }
    let class = TypeId::of::<ClusterVisibilityClass>();
    for (mut visible, illumination) in &mut cameras {
        let sees = illumination.is_some_and(|gi| gi.technique.uses_grid() && gi.quality.settings().probes > 0);
        let gives_way = one_volume.0 && visible.get(class).iter().any(|entity| others.contains(*entity));
        if !sees || gives_way {
            visible.get_mut(class).retain(|entity| !volumes.contains(*entity));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(min: Vec3, max: Vec3) -> SceneBox {
        SceneBox { bounds: Some(Aabb3d::new((min + max) * 0.5, (max - min) * 0.5)), moves: false }
    }

    #[test]
    fn probes_lie_beyond_the_bounds_on_every_side() {
        for (min, max) in [
            (Vec3::splat(-2.8), Vec3::splat(2.8)),
            (Vec3::new(-18.0, -0.1, -11.0), Vec3::new(19.0, 15.0, 12.0)),
            (Vec3::new(1000.0, 5.0, 3.0), Vec3::new(1000.0, 5.0, 3.0)),
            (Vec3::ZERO, Vec3::new(1e4, 0.0, 1e4)),
        ] {
            for count in [4, 16, 64] {
                let volume = ProbeVolume::over(&still(min, max), count);
                let low = (min - volume.origin) / volume.spacing;
                let high = (max - volume.origin) / volume.spacing;
                assert!(low.cmpge(Vec3::splat(1.4)).all(), "{volume:?} {low}");
                assert!(high.cmple(volume.dims.as_vec3() - 1.4).all(), "{volume:?} {high}");
                assert!(volume.dims.max_element() <= count);
            }
        }
    }

    #[test]
    fn probes_stay_while_the_bounds_move_a_little() {
        let a = ProbeVolume::over(&still(Vec3::splat(-2.8), Vec3::splat(2.8)), 16);
        let b = ProbeVolume::over(&still(Vec3::splat(-2.8), Vec3::new(2.8, 2.8, 2.81)), 16);
        assert_eq!(a, b);
    }

    #[test]
    fn bounds_that_move_have_as_many_wherever_they_are() {
        let over = |x: f32| {
            let min = Vec3::new(x, 0.0, 0.3 * x);
            ProbeVolume::over(&SceneBox { moves: true, ..still(min, min + Vec3::new(80.0, 22.0, 80.0)) }, 20)
        };
        let first = over(0.0);
        for step in 1..300 {
            let min = 0.77 * step as f32;
            let volume = over(min);
            assert_eq!((volume.dims, volume.spacing), (first.dims, first.spacing));
            let end = (Vec3::new(min + 80.0, 22.0, 0.3 * min + 80.0) - volume.origin) / volume.spacing;
            assert!(end.cmple(volume.dims.as_vec3() - 1.4).all(), "{volume:?} {end}");
        }
    }

    #[test]
    fn probes_use_their_budget() {
        let volume = ProbeVolume::over(&still(Vec3::ZERO, Vec3::new(37.0, 15.0, 23.0)), 24);
        assert!(volume.dims.x > 20, "{volume:?}");
    }

    #[test]
    fn well_exposed_light_is_near_one_in_the_texels() {
        for ev100 in [-4.0, 0.0, 9.7, 16.0] {
            let exposure = Exposure { ev100 }.exposure();
            let wanted = Wanted { count: 16, visibility: VplVisibility::None, exposure };
            let texel = exposure.recip() / wanted.intensity();
            assert!((0.7..1.42).contains(&texel), "{texel} at {ev100}");
        }
    }
}
