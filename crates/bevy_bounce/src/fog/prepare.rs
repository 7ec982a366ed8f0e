//! The fog of a view: its ambient term, its volumes, and the texture that their light is gathered in.

use bevy::light::{FogVolume, VolumetricFog};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    CachedRenderPipelineId, DynamicUniformBuffer, Extent3d, PipelineCache, SpecializedRenderPipelines,
    TextureDescriptor, TextureDimension, TextureUsages,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::{CachedTexture, GpuImage, TextureCache};
use bevy::render::view::ExtractedView;
use bevy_bounce_shaders::types::FogParameters;

use super::extract::FogCamera;
use super::pipelines::{FogPipelines, LIGHT_FORMAT, Pass, bevys_fog_is_drawn};
use crate::GiIsolate;
use crate::probes::ExtractedProbes;
use crate::view::GiView;

/// Fog of a view that bounced light falls on.
#[derive(Component)]
pub(crate) struct LitFog {
    /// A volume's light.
    pub(super) scatter: CachedRenderPipelineId,
    /// Onto the picture.
    pub(super) add: CachedRenderPipelineId,
    /// Whether the depth has several samples.
    pub(super) multisampled: bool,
    /// What is drawn in this frame, in Bevy's order.
    pub(super) volumes: Vec<LitVolume>,
    /// What they scatter, where there are any.
    pub(super) light: Option<CachedTexture>,
}

impl LitFog {
    /// Whether it is drawn in this frame.
    pub fn is_drawn(&self) -> bool {
        !self.volumes.is_empty()
    }

    /// Name and size of what is held on the GPU, bytes.
    pub fn bytes(&self) -> Option<(&'static str, u64)> {
        let texture = &self.light.as_ref()?.texture;
        let texel = u64::from(LIGHT_FORMAT.block_copy_size(None).unwrap_or(0));
        Some(("fog: light", u64::from(texture.width()) * u64::from(texture.height()) * texel))
    }
}

/// A volume of fog in a view.
pub(super) struct LitVolume {
    /// Where its [`FogParameters`] are.
    pub offset: u32,
    /// Its density, where it has a texture that is loaded.
    pub density: Option<AssetId<Image>>,
}

/// [`FogParameters`] of all volumes in all views.
#[derive(Resource, Default)]
pub(super) struct FogUniforms(pub DynamicUniformBuffer<FogParameters>);

/// Where bounced light is ready to take its place, leaves out the ambient term of Bevy's fog. Bevy extracts it anew in each frame.
pub(super) fn take_over_from_ambient_light(
    mut commands: Commands,
    probes: Option<Res<ExtractedProbes>>,
    pipelines: Option<Res<FogPipelines>>,
    mut specialized: ResMut<SpecializedRenderPipelines<FogPipelines>>,
    cache: Res<PipelineCache>,
    mut views: Query<(Entity, &ExtractedView, &Msaa, &mut VolumetricFog, Option<&mut LitFog>), With<FogCamera>>,
) {
    let Some(pipelines) = pipelines else { return };
    let may_be = probes.is_some_and(|probes| probes.0.is_some()) && bevys_fog_is_drawn(&cache);
    for (entity, view, msaa, mut fog, lit) in &mut views {
        let multisampled = *msaa != Msaa::Off;
        let mut pipeline = |pass| specialized.specialize(&cache, &pipelines, pass);
        let scatter = pipeline(Pass::Scatter { multisampled });
        let add = pipeline(Pass::Add { format: view.target_format });
        if !may_be || [scatter, add].into_iter().any(|id| cache.get_render_pipeline(id).is_none()) {
            commands.entity(entity).remove::<LitFog>();
            continue;
        }
        fog.ambient_intensity = 0.0;
        match lit {
            Some(mut lit) => (lit.scatter, lit.add, lit.multisampled) = (scatter, add, multisampled),
            None => {
                let (volumes, light) = (Vec::new(), None);
                commands.entity(entity).insert(LitFog { scatter, add, multisampled, volumes, light });
            }
        }
    }
}

/// What of a volume does not depend on whether its texture is loaded; `None` where it is flat, which Bevy does not draw.
fn parameters(fog: &VolumetricFog, volume: &FogVolume, place: &GlobalTransform) -> Option<FogParameters> {
    let local_from_world = Some(place.to_matrix().inverse()).filter(Mat4::is_finite)?;
    let light = volume.light_tint.to_linear().to_vec3() * volume.light_intensity;
    Some(FogParameters {
        local_from_world,
        color: volume.fog_color.to_linear().to_vec3() * light,
        density: volume.density_factor,
        density_offset: volume.density_texture_offset,
        has_texture: 0,
        absorption: volume.absorption,
        scattering: volume.scattering,
        asymmetry: volume.scattering_asymmetry,
        radius: place.affine().transform_vector3(Vec3::splat(0.5)).length(),
        steps: fog.step_count,
        jitter: fog.jitter,
    })
}

/// Finds each view its volumes, and the texture for their light.
pub(super) fn prepare_fog(
    mut views: Query<(&mut LitFog, Option<&VolumetricFog>, &ExtractedCamera, Option<&GiView>)>,
    volumes: Query<(&FogVolume, &GlobalTransform)>,
    mut uniforms: ResMut<FogUniforms>,
    mut textures: ResMut<TextureCache>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    uniforms.0.clear();
    for (mut lit, fog, camera, gi) in &mut views {
        lit.volumes.clear();
        lit.light = None;
        let Some((fog, size)) = fog.zip(camera.physical_target_size) else { continue };
        if gi.is_some_and(|gi| gi.isolate != GiIsolate::All) {
            continue;
        }
        for (volume, place) in &volumes {
            let Some(parameters) = parameters(fog, volume, place) else { continue };
            let density = volume.density_texture.as_ref().map(Handle::id).filter(|id| images.get(*id).is_some());
            let has_texture = u32::from(density.is_some());
            let offset = uniforms.0.push(&FogParameters { has_texture, ..parameters });
            lit.volumes.push(LitVolume { offset, density });
        }
        if lit.is_drawn() {
            lit.light = Some(textures.get(&device, light_texture(size)));
        }
    }
    uniforms.0.write_buffer(&device, &queue);
}

fn light_texture(size: UVec2) -> TextureDescriptor<'static> {
    TextureDescriptor {
        label: Some("bounce_fog_light"),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: LIGHT_FORMAT,
        usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    }
}
