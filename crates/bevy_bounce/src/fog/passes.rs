//! What fog scatters, into the picture.

use bevy::ecs::system::SystemParam;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, LoadOp, Operations, PipelineCache, RenderPassColorAttachment, RenderPassDescriptor,
    StoreOp, TextureView,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy::render::view::{ViewDepthTexture, ViewTarget, ViewUniformOffset, ViewUniforms};

use super::pipelines::FogPipelines;
use super::prepare::{FogUniforms, LitFog, LitVolume};
use crate::probes::{ExtractedProbes, ProbeBuffers};
use crate::view::view_binding;

/// What volumes are drawn with.
#[derive(SystemParam)]
pub(super) struct Inputs<'w> {
    pipelines: Res<'w, FogPipelines>,
    cache: Res<'w, PipelineCache>,
    fog: Res<'w, FogUniforms>,
    views: Res<'w, ViewUniforms>,
    extracted: Option<Res<'w, ExtractedProbes>>,
    probes: Option<Res<'w, ProbeBuffers>>,
    images: Res<'w, RenderAssets<GpuImage>>,
    fallback: Res<'w, FallbackImage>,
}

impl Inputs<'_> {
    /// Group 0 of a volume.
    fn bind(
        &self,
        ctx: &RenderContext,
        fog: &LitFog,
        volume: &LitVolume,
        (view, depth): (&ViewUniformOffset, &TextureView),
    ) -> Option<BindGroup> {
        let probes = self.images.get(self.extracted.as_ref()?.0?.image)?;
        let density = volume.density.and_then(|id| self.images.get(id)).unwrap_or(&self.fallback.d3);
        Some(ctx.render_device().create_bind_group(
            "bounce_fog",
            &self.cache.get_bind_group_layout(self.pipelines.scatter_layout(fog.multisampled)),
            &BindGroupEntries::sequential((
                view_binding(&self.views, view)?,
                self.fog.0.binding()?,
                depth,
                self.probes.as_ref()?.parameters.binding()?,
                &probes.texture_view,
                &probes.sampler,
                &density.texture_view,
                &density.sampler,
            )),
        ))
    }
}

/// Gathers what all volumes of a view scatter, and adds it to the picture.
pub(super) fn fog_pass(
    view: ViewQuery<(&LitFog, &ViewTarget, &ViewDepthTexture, &ViewUniformOffset, &ExtractedCamera)>,
    inputs: Inputs,
    mut ctx: RenderContext,
) {
    let (fog, target, depth, offset, camera) = view.into_inner();
    let cache = &inputs.cache;
    let Some(light) = fog.light.as_ref().map(|light| &light.default_view) else { return };
    let Some((scatter, add)) = cache.get_render_pipeline(fog.scatter).zip(cache.get_render_pipeline(fog.add)) else {
        return;
    };
    let bind = |volume| inputs.bind(&ctx, fog, volume, (offset, depth.view()));
    let Some(groups) = fog.volumes.iter().map(bind).collect::<Option<Vec<_>>>() else { return };
    let add_group = ctx.render_device().create_bind_group(
        "bounce_fog_add",
        &cache.get_bind_group_layout(&inputs.pipelines.add_layout),
        &BindGroupEntries::single(light),
    );
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/fog");
    {
        let mut pass = begin(&mut ctx, light, true, camera);
        pass.set_render_pipeline(scatter);
        for (volume, group) in fog.volumes.iter().zip(&groups) {
            pass.set_bind_group(0, group, &[volume.offset]);
            pass.draw(0..3, 0..1);
        }
    }
    {
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
