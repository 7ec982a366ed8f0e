//! The fog of a view: its ambient term, its volumes, and the texture that their light is gathered in.

use bevy::light::{FogVolume, VolumetricFog};
use bevy::math::primitives::ViewFrustum;
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
use bevy_bounce_shaders::types::{FogParameters, FroxelParameters};

use super::extract::FogCamera;
use super::pipelines::{FogPipelines, FroxelKernels, FroxelKey, LIGHT_FORMAT, Pass, bevys_fog_is_drawn};
use crate::avg::VoxelGrid;
use crate::compute::GiShaders;
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::shadow_atlas::ShadowAtlas;
use crate::view::GiView;
use crate::vpl::VplBuffers;
use crate::{GiIsolate, VplVisibility};

/// Fog of a view that bounced light falls on.
#[derive(Component)]
pub(crate) struct LitFog {
    /// A volume's light.
    pub(super) scatter: CachedRenderPipelineId,
    /// Onto the picture.
    pub(super) add: CachedRenderPipelineId,
    /// What lights its froxels.
    pub(super) key: FroxelKey,
    /// What is drawn in this frame, in Bevy's order.
    pub(super) volumes: Vec<LitVolume>,
    /// Light in the space of the view, for each asymmetry that its volumes have.
    pub(super) froxels: Vec<Froxels>,
    /// What they scatter, where there are any.
    pub(super) light: Option<CachedTexture>,
}

impl LitFog {
    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let bytes = |texture: &CachedTexture| {
            let Extent3d { width, height, depth_or_array_layers } = texture.texture.size();
            let texels = u64::from(width) * u64::from(height) * u64::from(depth_or_array_layers);
            texels * u64::from(LIGHT_FORMAT.block_copy_size(None).unwrap_or(0))
        };
        let froxels = self.froxels.iter().map(|froxels| bytes(&froxels.texture)).sum();
        [("fog: froxels", froxels), ("fog: light", self.light.as_ref().map_or(0, bytes))]
    }
}

/// A volume of fog in a view.
pub(super) struct LitVolume {
    /// Where its [`FogParameters`] are.
    pub offset: u32,
    /// Which of [`LitFog::froxels`] it takes its light from.
    pub froxels: usize,
    /// Its density, where it has a texture that is loaded.
    pub density: Option<AssetId<Image>>,
}

/// What fog of one asymmetry scatters to the eye.
pub(super) struct Froxels {
    /// Where their [`FroxelParameters`] are.
    pub offset: u32,
    pub dims: UVec3,
    /// Pre-exposed radiance per unit of what scatters.
    pub texture: CachedTexture,
}

/// [`FogParameters`] of all volumes in all views, and [`FroxelParameters`] of these.
#[derive(Resource, Default)]
pub(super) struct FogUniforms {
    pub volumes: DynamicUniformBuffer<FogParameters>,
    pub froxels: DynamicUniformBuffer<FroxelParameters>,
}

/// Where bounced light is ready to take its place, leaves out the ambient term of Bevy's fog. Bevy extracts it anew in each frame.
pub(super) fn take_over_from_ambient_light(
    mut commands: Commands,
    settings: Res<GiWorldSettings>,
    scene: Option<Res<SceneBuffers>>,
    (lights, grid, atlas): (Option<Res<VplBuffers>>, Option<Res<VoxelGrid>>, Option<Res<ShadowAtlas>>),
    pipelines: Option<Res<FogPipelines>>,
    kernels: Option<ResMut<FroxelKernels>>,
    mut specialized: ResMut<SpecializedRenderPipelines<FogPipelines>>,
    shaders: Res<GiShaders>,
    cache: Res<PipelineCache>,
    mut views: Query<(Entity, &ExtractedView, &Msaa, &mut VolumetricFog, &FogCamera, Option<&mut LitFog>)>,
) {
    let (Some(pipelines), Some(mut kernels)) = (pipelines, kernels) else { return };
    let are_lights = settings.0.is_some() && lights.is_some() && grid.is_some();
    let may_be = are_lights && bevys_fog_is_drawn(&cache);
    let is_sky = scene.is_some_and(|scene| scene.sky_count() > 0);
    for (entity, view, msaa, mut fog, camera, lit) in &mut views {
        let multisampled = *msaa != Msaa::Off;
        let mut pipeline = |pass| specialized.specialize(&cache, &pipelines, pass);
        let scatter = pipeline(Pass::Scatter { multisampled });
        let add = pipeline(Pass::Add { format: view.target_format });
        // Without maps lights see by rays, as `bind_visibility` has it.
        let is_seen_by_rays = camera.visibility > VplVisibility::Voxel && atlas.is_none();
        let visibility = if is_seen_by_rays { VplVisibility::Voxel } else { camera.visibility };
        let key = FroxelKey::new(visibility, camera.sky && is_sky, multisampled);
        let is_lit = kernels.is_ready(key, &cache, &shaders);
        if !may_be || !is_lit || [scatter, add].into_iter().any(|id| cache.get_render_pipeline(id).is_none()) {
            commands.entity(entity).remove::<LitFog>();
            continue;
        }
        fog.ambient_intensity = 0.0;
        match lit {
            Some(mut lit) => (lit.scatter, lit.add, lit.key) = (scatter, add, key),
            None => {
                let (volumes, froxels, light) = (Vec::new(), Vec::new(), None);
                commands.entity(entity).insert(LitFog { scatter, add, key, volumes, froxels, light });
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
        radius: radius(place),
        steps: fog.step_count,
        jitter: fog.jitter,
    })
}

/// World units from a volume's centre to its corners, as Bevy has it.
fn radius(place: &GlobalTransform) -> f32 {
    place.affine().transform_vector3(Vec3::splat(0.5)).length()
}

/// World units from a volume's centre to the farthest of its corners.
fn reach(place: &GlobalTransform) -> f32 {
    let diagonals = [Vec3::ONE, Vec3::new(-1.0, 1.0, 1.0), Vec3::new(1.0, -1.0, 1.0), Vec3::new(1.0, 1.0, -1.0)];
    let lengths = diagonals.map(|diagonal| place.affine().transform_vector3(0.5 * diagonal).length());
    lengths.into_iter().fold(0.0, f32::max)
}

/// What a view looks at.
fn frustum_of(view: &ExtractedView) -> ViewFrustum {
    let clip_from_world = || view.clip_from_view * view.world_from_view.to_matrix().inverse();
    ViewFrustum::from_clip_from_world(&view.clip_from_world.unwrap_or_else(clip_from_world))
}

/// World units from the eye, or from its plane where rays are parallel, between which a volume lies, however the eye turns: a function
/// of its sphere. `None` where the view does not look at that.
fn distances(view: &ExtractedView, frustum: &ViewFrustum, place: &GlobalTransform) -> Option<(f32, f32)> {
    let (centre, reach) = (place.translation(), reach(place));
    // But for the far plane, which Bevy's fog does not end at.
    let planes = &frustum.half_spaces[..ViewFrustum::FAR_PLANE_IDX];
    if planes.iter().any(|plane| plane.normal_d().dot(centre.extend(1.0)) <= -reach) {
        return None;
    }
    let to_centre = centre - view.world_from_view.translation();
    let is_parallel = view.clip_from_view.w_axis.w == 1.0;
    let (distance, nearest) = if is_parallel {
        let near_plane = -view.clip_from_view.inverse().project_point3(Vec3::Z).z;
        (to_centre.dot(*view.world_from_view.forward()), near_plane)
    } else {
        (to_centre.length(), 0.0)
    };
    Some(((distance - reach).max(nearest), distance + reach))
}

/// Columns, rows and slices of a viewport of those pixels.
fn froxel_dims(longest: u32, viewport: UVec2) -> UVec3 {
    let edge = viewport.max_element().max(1);
    (viewport * longest).map(|pixels| pixels.div_ceil(edge).max(1)).extend(longest)
}

/// Finds each view its volumes, and the textures for their light.
pub(super) fn prepare_fog(
    mut views: Query<(
        &mut LitFog,
        &FogCamera,
        Option<&VolumetricFog>,
        &ExtractedCamera,
        &ExtractedView,
        Option<&GiView>,
    )>,
    volumes: Query<(&FogVolume, &GlobalTransform)>,
    mut uniforms: ResMut<FogUniforms>,
    mut textures: ResMut<TextureCache>,
    images: Res<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    uniforms.volumes.clear();
    uniforms.froxels.clear();
    for (mut lit, asked, fog, camera, view, gi) in &mut views {
        lit.volumes.clear();
        lit.froxels.clear();
        lit.light = None;
        let Some((fog, size)) = fog.zip(camera.physical_target_size) else { continue };
        if gi.is_some_and(|gi| gi.isolate != GiIsolate::All) {
            continue;
        }
        let dims = froxel_dims(asked.froxels, view.viewport.zw());
        let frustum = frustum_of(view);
        let mut froxels = Vec::<FroxelParameters>::new();
        for (volume, place) in &volumes {
            let asymmetry = volume.scattering_asymmetry;
            if volume.density_factor == 0.0 || !asymmetry.is_finite() {
                continue;
            }
            let Some((near, far)) = distances(view, &frustum, place) else { continue };
            let Some(parameters) = parameters(fog, volume, place) else { continue };
            let known = join(&mut froxels, FroxelParameters { dims, asymmetry, near, extent: far - near });
            let density = volume.density_texture.as_ref().map(Handle::id).filter(|id| images.get(*id).is_some());
            let has_texture = u32::from(density.is_some());
            let offset = uniforms.volumes.push(&FogParameters { has_texture, ..parameters });
            lit.volumes.push(LitVolume { offset, froxels: known, density });
        }
        if !lit.volumes.is_empty() {
            lit.light = Some(textures.get(&device, texture("bounce_fog_light", size.extend(1), TextureDimension::D2)));
        }
        for parameters in &froxels {
            let texture = textures.get(&device, texture("bounce_fog_froxels", dims, TextureDimension::D3));
            lit.froxels.push(Froxels { offset: uniforms.froxels.push(parameters), dims, texture });
        }
    }
    uniforms.volumes.write_buffer(&device, &queue);
    uniforms.froxels.write_buffer(&device, &queue);
}

/// Volumes of one asymmetry share froxels that reach over all of them: which these are.
fn join(froxels: &mut Vec<FroxelParameters>, wanted: FroxelParameters) -> usize {
    let index = froxels.iter().position(|known| known.asymmetry == wanted.asymmetry).unwrap_or(froxels.len());
    match froxels.get_mut(index) {
        Some(known) => {
            let end = (known.near + known.extent).max(wanted.near + wanted.extent);
            known.near = known.near.min(wanted.near);
            known.extent = end - known.near;
        }
        None => froxels.push(wanted),
    }
    index
}

fn texture(label: &'static str, size: UVec3, dimension: TextureDimension) -> TextureDescriptor<'static> {
    let written = match dimension {
        TextureDimension::D3 => TextureUsages::STORAGE_BINDING,
        _ => TextureUsages::RENDER_ATTACHMENT,
    };
    TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: size.z },
        mip_level_count: 1,
        sample_count: 1,
        dimension,
        format: LIGHT_FORMAT,
        usage: written | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheared_volume_reaches_to_its_farthest_corner() {
        let stretched = GlobalTransform::from(Transform::from_scale(Vec3::new(4.0, 1.0, 1.0)));
        let turned = GlobalTransform::from(Transform::from_rotation(Quat::from_rotation_z(-0.7)));
        let sheared = stretched * turned;
        let corner = |x, y, z| sheared.affine().transform_vector3(Vec3::new(x, y, z)).length();
        let corners = [corner(0.5, 0.5, 0.5), corner(0.5, -0.5, 0.5), corner(-0.5, 0.5, 0.5), corner(0.5, 0.5, -0.5)];
        assert_eq!(reach(&sheared), corners.into_iter().fold(0.0, f32::max));
        let square = GlobalTransform::from(Transform::from_scale(Vec3::new(1.0, 2.0, 3.0)));
        assert_eq!(reach(&square), radius(&square));
    }

    #[test]
    fn froxels_are_as_many_along_the_longest_edge() {
        assert_eq!(froxel_dims(40, UVec2::new(1920, 1080)), UVec3::new(40, 23, 40));
        assert_eq!(froxel_dims(8, UVec2::new(100, 4000)), UVec3::new(1, 8, 8));
        assert_eq!(froxel_dims(8, UVec2::ZERO), UVec3::new(1, 1, 8));
    }
}
