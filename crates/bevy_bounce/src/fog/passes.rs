//! Light in the space of a view, what fog scatters of it, into the picture.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindingResource, LoadOp, Operations, PipelineCache, RenderPassColorAttachment,
    RenderPassDescriptor, ShaderType, StoreOp, TextureView,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy::render::view::{ViewDepthTexture, ViewTarget, ViewUniformOffset, ViewUniforms};
use bevy_bounce_shaders::types::FroxelParameters;

use super::extract::FogCamera;
use super::pipelines::{FogPipelines, FroxelKernels, FroxelKey};
use super::prepare::{FogUniforms, Froxels, LitFog, LitVolume};
use crate::avg::VoxelGrid;
use crate::compute::{GiShaders, folded, part, whole};
use crate::scene::SceneBuffers;
use crate::shadow_atlas::{ShadowAtlas, bind_visibility};
use crate::view::view_binding;
use crate::vpl::VplBuffers;

/// Threads of a workgroup, a froxel each.
const GROUP: u32 = 64;

/// Where a view is seen from, and its depth.
type Seen<'a> = (&'a ViewUniformOffset, &'a TextureView);

/// What lights froxels.
#[derive(SystemParam)]
pub(super) struct Lights<'w> {
    kernels: Option<ResMut<'w, FroxelKernels>>,
    shaders: Res<'w, GiShaders>,
    vpl: Option<Res<'w, VplBuffers>>,
    grid: Option<Res<'w, VoxelGrid>>,
    atlas: Option<Res<'w, ShadowAtlas>>,
    scene: Option<Res<'w, SceneBuffers>>,
}

/// What volumes are drawn with.
#[derive(SystemParam)]
pub(super) struct Inputs<'w> {
    pipelines: Res<'w, FogPipelines>,
    cache: Res<'w, PipelineCache>,
    fog: Res<'w, FogUniforms>,
    views: Res<'w, ViewUniforms>,
    images: Res<'w, RenderAssets<GpuImage>>,
    fallback: Res<'w, FallbackImage>,
}

impl Inputs<'_> {
    fn froxels(&self, froxels: &Froxels) -> Option<BindingResource<'_>> {
        let size = FroxelParameters::min_size().get();
        Some(part(self.fog.froxels.buffer()?, (froxels.offset.into(), size)))
    }

    /// Group 0 of a volume.
    fn bind(&self, ctx: &RenderContext, fog: &LitFog, volume: &LitVolume, (view, depth): Seen) -> Option<BindGroup> {
        let density = volume.density.and_then(|id| self.images.get(id)).unwrap_or(&self.fallback.d3);
        let froxels = fog.froxels.get(volume.froxels)?;
        Some(ctx.render_device().create_bind_group(
            "bounce_fog",
            &self.cache.get_bind_group_layout(self.pipelines.scatter_layout(fog.key.multisampled)),
            &BindGroupEntries::sequential((
                view_binding(&self.views, view)?,
                self.fog.volumes.binding()?,
                depth,
                self.froxels(froxels)?,
                &froxels.texture.default_view,
                &self.pipelines.linear,
                &density.texture_view,
                &density.sampler,
            )),
        ))
    }

    /// Lights all froxels of a view; `None` while anything is missing. Until what lights them by the sky is compiled, they go without.
    fn light(
        &self,
        ctx: &mut RenderContext,
        lights: &mut Lights,
        fog: &LitFog,
        asked: &FogCamera,
        (view, depth): Seen,
    ) -> Option<()> {
        let Lights { kernels, shaders, vpl, grid, atlas, scene } = lights;
        let (kernels, vpl, grid) = (kernels.as_mut()?, vpl.as_ref()?, grid.as_ref()?);
        let device = ctx.render_device().clone();
        let sky = scene.as_deref().filter(|scene| asked.sky && scene.sky_count() > 0);
        let (key, see_groups) = [sky, None].into_iter().find_map(|sky| {
            let (visibility, groups) =
                bind_visibility(asked.visibility, atlas.as_deref(), grid, sky, &device, &self.cache)?;
            let key = FroxelKey { sky: sky.is_some(), ..fog.key.seeing(visibility) };
            kernels.is_ready(key, &self.cache, shaders).then_some((key, groups))
        })?;
        let kernel = kernels.get(key)?;
        let bind = |froxels: &Froxels| {
            let resources = [
                view_binding(&self.views, view)?,
                self.froxels(froxels)?,
                whole(&vpl.header),
                whole(&vpl.vpls),
                BindingResource::TextureView(&froxels.texture.default_view),
                grid.uniform.binding()?,
                whole(&vpl.densities),
                BindingResource::TextureView(depth),
            ];
            Some(kernel.bind(&device, &self.cache, &resources))
        };
        let groups = fog.froxels.iter().map(bind).collect::<Option<Vec<_>>>()?;
        for (froxels, group) in fog.froxels.iter().zip(&groups) {
            let with_sight: Vec<_> = std::iter::once(group).chain(&see_groups).collect();
            let workgroups = folded(froxels.dims.element_product().div_ceil(GROUP));
            kernel.dispatch(ctx.command_encoder(), &self.cache, &with_sight, workgroups);
        }
        Some(())
    }
}

/// Gathers what all volumes of a view scatter, and adds it to the picture.
pub(super) fn fog_pass(
    view: ViewQuery<(&LitFog, &FogCamera, &ViewTarget, &ViewDepthTexture, &ViewUniformOffset, &ExtractedCamera)>,
    inputs: Inputs,
    mut lights: Lights,
    mut ctx: RenderContext,
) {
    let (fog, asked, target, depth, offset, camera) = view.into_inner();
    let cache = &inputs.cache;
    let Some(light) = fog.light.as_ref().map(|light| &light.default_view) else { return };
    let Some((scatter, add)) = cache.get_render_pipeline(fog.scatter).zip(cache.get_render_pipeline(fog.add)) else {
        return;
    };
    let seen = (offset, depth.view());
    let bind = |volume| inputs.bind(&ctx, fog, volume, seen);
    let Some(groups) = fog.volumes.iter().map(bind).collect::<Option<Vec<_>>>() else { return };
    let add_group = ctx.render_device().create_bind_group(
        "bounce_fog_add",
        &cache.get_bind_group_layout(&inputs.pipelines.add_layout),
        &BindGroupEntries::single(light),
    );
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/fog");
    if inputs.light(&mut ctx, &mut lights, fog, asked, seen).is_some() {
        let mut pass = begin(&mut ctx, light, true, camera);
        pass.set_render_pipeline(scatter);
        for (volume, group) in fog.volumes.iter().zip(&groups) {
            pass.set_bind_group(0, group, &[volume.offset]);
            pass.draw(0..3, 0..1);
        }
        drop(pass);
        let mut pass = begin(&mut ctx, target.main_texture_view(), false, camera);
        pass.set_render_pipeline(add);
        pass.set_bind_group(0, &add_group, &[]);
        pass.draw(0..3, 0..1);
    }
    span.end(ctx.command_encoder());
}

/// A pass over the camera's viewport, of a target that is cleared or added to.
fn begin<'a>(
    ctx: &'a mut RenderContext,
    view: &'a TextureView,
    is_cleared: bool,
    camera: &ExtractedCamera,
) -> TrackedRenderPass<'a> {
    let load = if is_cleared { LoadOp::Clear(LinearRgba::NONE.into()) } else { LoadOp::Load };
    let ops = Operations { load, store: StoreOp::Store };
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("bounce_fog"),
        color_attachments: &[Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })],
        ..default()
    });
    if let Some(viewport) = &camera.viewport {
        pass.set_camera_viewport(viewport);
    }
    pass
}
