//! The passes of a view.

use std::num::NonZeroU64;

use bevy::camera::{MainPassResolutionOverride, Viewport};
use bevy::core_pipeline::deferred::copy_lighting_id::DeferredLightingIdDepthTexture;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::pbr::MeshViewBindGroup;
use bevy::pbr::deferred::{PbrDeferredLightingDepthId, SkipDeferredLighting};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::extract_component::{ComponentUniforms, DynamicUniformIndex};
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntries, BindingResource, Buffer, BufferBinding, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, RenderPassDepthStencilAttachment, RenderPassDescriptor, RenderPipeline, ShaderType,
    StoreOp, TextureView,
};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewTarget, ViewUniformOffset, ViewUniforms};

use super::pipelines::{ComposePipelines, ViewPipelines};
use crate::scene::SkyBuffers;
use crate::view::{ViewTextures, view_binding};

/// Edge of a workgroup of `compose/surface.wgsl`, pixels.
const TILE: u32 = 8;

type PassIds<'w> = Res<'w, ComponentUniforms<PbrDeferredLightingDepthId>>;
type PassIdIndex = DynamicUniformIndex<PbrDeferredLightingDepthId>;

/// One element of a buffer of uniforms.
fn element(buffer: &Buffer, offset: u32, size: NonZeroU64) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: offset.into(), size: Some(size) })
}

/// An attachment that is cleared to that value.
fn cleared(view: &TextureView, value: LinearRgba) -> Option<RenderPassColorAttachment<'_>> {
    let ops = Operations { load: LoadOp::Clear(value.into()), store: StoreOp::Store };
    Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops })
}

/// A triangle over everything, with Bevy's view bindings in groups 0 and 1.
pub(super) fn draw<'a>(
    pass: &mut TrackedRenderPass<'a>,
    pipeline: &'a RenderPipeline,
    view: &'a MeshViewBindGroup,
    group: &'a BindGroup,
) {
    pass.set_render_pipeline(pipeline);
    pass.set_bind_group(0, &view.main, &view.main_offsets);
    pass.set_bind_group(1, &view.binding_array, &[]);
    pass.set_bind_group(2, group, &[]);
    pass.draw(0..3, 0..1);
}

/// Packs the G-buffer into `surface`, and clears what light is added to; what of the sky is seen, to all of it.
pub(super) fn surface_pass(
    view: ViewQuery<
        (&ViewTextures, &ViewPrepassTextures, &ViewUniformOffset, &PassIdIndex),
        (With<ViewPipelines>, With<SkipDeferredLighting>),
    >,
    pipelines: Res<ComposePipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    pass_ids: PassIds,
    mut ctx: RenderContext,
) {
    let (textures, prepass, view_offset, pass_id) = view.into_inner();
    let (Some(depth), Some(deferred), Some(pass_id_texture)) =
        (prepass.depth_view(), prepass.deferred_view(), &prepass.deferred_lighting_pass_id)
    else {
        return;
    };
    let (Some(view), Some(pass_ids)) = (view_binding(&view_uniforms, view_offset), pass_ids.buffer()) else { return };
    let bind_group = pipelines.surface.bind(
        ctx.render_device(),
        &cache,
        &[
            view,
            BindingResource::TextureView(depth),
            BindingResource::TextureView(deferred),
            BindingResource::TextureView(&pass_id_texture.texture.default_view),
            element(pass_ids, pass_id.index(), PbrDeferredLightingDepthId::min_size()),
            BindingResource::TextureView(&textures.surface),
        ],
    );
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/gbuffer");
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE)).extend(1);
    pipelines.surface.dispatch(ctx.command_encoder(), &cache, &[&bind_group], tiles);
    let dark = std::iter::once(&textures.indirect).chain(&textures.glossy).map(|texture| (texture, LinearRgba::NONE));
    let open = textures.sky_seen.iter().map(|texture| (texture, LinearRgba::WHITE));
    for (texture, value) in dark.chain(open) {
        ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_clear"),
            color_attachments: &[cleared(texture, value)],
            ..default()
        });
    }
    span.end(ctx.command_encoder());
}

/// Lights what is in `surface`.
pub(super) fn direct_pass(
    view: ViewQuery<(&ViewTextures, &ViewPipelines, &MeshViewBindGroup), With<SkipDeferredLighting>>,
    pipelines: Res<ComposePipelines>,
    cache: Res<PipelineCache>,
    sky: Option<Res<SkyBuffers>>,
    mut ctx: RenderContext,
) {
    let (textures, view_pipelines, view_bindings) = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(view_pipelines.direct) else { return };
    let ambient = sky.as_ref().filter(|_| view_pipelines.mirrors_ambient).and_then(|sky| sky.parameters());
    let group = match ambient {
        None => ctx.render_device().create_bind_group(
            "bounce_direct",
            &cache.get_bind_group_layout(&pipelines.direct_layout),
            &BindGroupEntries::single(&textures.surface),
        ),
        Some(ambient) => ctx.render_device().create_bind_group(
            "bounce_direct_ambient",
            &cache.get_bind_group_layout(&pipelines.ambient_layout),
            &BindGroupEntries::sequential((&textures.surface, ambient)),
        ),
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/direct");
    let targets = [Some(&textures.direct), Some(&textures.direct_diffuse), textures.mirrored_sky.as_ref()];
    let attachments: Vec<_> = targets.into_iter().flatten().map(|target| cleared(target, LinearRgba::NONE)).collect();
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_direct"),
            color_attachments: &attachments,
            ..default()
        });
        draw(&mut pass, pipeline, view_bindings, &group);
    }
    span.end(ctx.command_encoder());
}

/// Group 2 of the composing passes.
fn compose_group(
    ctx: &RenderContext,
    cache: &PipelineCache,
    pipelines: &ComposePipelines,
    pass_ids: &ComponentUniforms<PbrDeferredLightingDepthId>,
    pass_id: &PassIdIndex,
    textures: &ViewTextures,
) -> Option<BindGroup> {
    let pass_id = element(pass_ids.buffer()?, pass_id.index(), PbrDeferredLightingDepthId::min_size());
    Some(ctx.render_device().create_bind_group(
        "bounce_compose",
        &cache.get_bind_group_layout(&pipelines.compose_layout),
        &BindGroupEntries::sequential((pass_id, &textures.light)),
    ))
}

/// Direct light, bounced light and emission into the picture.
pub(super) fn compose_pass(
    view: ViewQuery<
        (&ViewTextures, &ViewPipelines, &MeshViewBindGroup, &ViewTarget, &DeferredLightingIdDepthTexture, &PassIdIndex),
        With<SkipDeferredLighting>,
    >,
    pipelines: Res<ComposePipelines>,
    cache: Res<PipelineCache>,
    pass_ids: PassIds,
    mut ctx: RenderContext,
) {
    let (textures, view_pipelines, view_bindings, target, depth, pass_id) = view.into_inner();
    let Some(pipeline) = cache.get_render_pipeline(view_pipelines.compose) else { return };
    let Some(group) = compose_group(&ctx, &cache, &pipelines, &pass_ids, pass_id, textures) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/compose");
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_compose"),
            color_attachments: &[Some(target.get_color_attachment())],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &depth.texture.default_view,
                depth_ops: Some(Operations { load: LoadOp::Load, store: StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..default()
        });
        draw(&mut pass, pipeline, view_bindings, &group);
    }
    span.end(ctx.command_encoder());
}

/// One term or a picture alone over the finished main pass, where [`GiIsolate`](crate::GiIsolate) asks for it.
pub(super) fn isolate_pass(
    view: ViewQuery<
        (
            &ViewTextures,
            &ViewPipelines,
            &MeshViewBindGroup,
            &ViewTarget,
            &ExtractedCamera,
            Option<&MainPassResolutionOverride>,
            &PassIdIndex,
        ),
        With<SkipDeferredLighting>,
    >,
    pipelines: Res<ComposePipelines>,
    cache: Res<PipelineCache>,
    pass_ids: PassIds,
    mut ctx: RenderContext,
) {
    let (textures, view_pipelines, view_bindings, target, camera, resolution_override, pass_id) = view.into_inner();
    let Some(pipeline) = view_pipelines.isolate.and_then(|id| cache.get_render_pipeline(id)) else { return };
    let Some(group) = compose_group(&ctx, &cache, &pipelines, &pass_ids, pass_id, textures) else { return };
    let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("bounce_isolate"),
        color_attachments: &[Some(target.get_color_attachment())],
        ..default()
    });
    if let Some(viewport) = Viewport::from_viewport_and_override(camera.viewport.as_ref(), resolution_override) {
        pass.set_camera_viewport(&viewport);
    }
    draw(&mut pass, pipeline, view_bindings, &group);
}
