//! Average, then keep: diffuse light, then glossy light.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindingResource, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use super::History;
use super::pipelines::HistoryPipelines;
use crate::view::{ViewTextures, view_binding};

/// Edge of a workgroup.
const GROUP: u32 = 8;

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}

pub(super) fn average(
    view: ViewQuery<(&ViewTextures, &History, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Option<Res<HistoryPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (textures, history, prepass, offset) = view.into_inner();
    let Some(p) = pipelines.filter(|p| p.are_ready(&cache)) else { return };
    let (Some(view), Some(parameters), Some(motion)) =
        (view_binding(&view_uniforms, offset), history.parameters.binding(), prepass.motion_vectors_view())
    else {
        return;
    };
    let groups = textures.size.map(|pixels| pixels.div_ceil(GROUP)).extend(1);

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/history");
    let lights = std::iter::once(&textures.indirect).chain(&textures.glossy);
    for (i, (light, kept)) in lights.zip(&history.light).enumerate() {
        let average = [
            view.clone(),
            parameters.clone(),
            texture(&textures.surface),
            texture(motion),
            texture(kept),
            texture(&history.surfaces),
            texture(light),
            texture(&textures.interleaved),
        ];
        let keep = [
            texture(&textures.interleaved),
            texture(light),
            texture(kept),
            texture(&textures.surface),
            texture(&history.surfaces),
        ];
        // What pixels showed is looked at until the last light is averaged.
        let last = i + 1 == history.light.len();
        let (kernel, keep) = if last { (&p.keep_last, &keep[..]) } else { (&p.keep, &keep[..3]) };
        let (average, keep) =
            (p.average.bind(ctx.render_device(), &cache, &average), kernel.bind(ctx.render_device(), &cache, keep));
        p.average.dispatch(ctx.command_encoder(), &cache, &[&average], groups);
        kernel.dispatch(ctx.command_encoder(), &cache, &[&keep], groups);
    }
    span.end(ctx.command_encoder());
    history.keep();
}
