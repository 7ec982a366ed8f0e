//! Shade the subsets, join them.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindingResource, BufferBinding, PipelineCache, ShaderType, TextureView};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};

use super::pipelines::InterleavedPipelines;
use crate::VplVisibility;
use crate::avg::{VoxelGrid, bind_grid};
use crate::compute::whole;
use crate::settings::GiWorldSettings;
use crate::view::{GiView, ViewTextures};
use crate::vpl::VplBuffers;

/// Edge of a tile of pixels of one sub-image, times the edge of the 4x4 blocks.
const TILE_PIXELS: u32 = 8 * 4;
/// Edge of a workgroup of the filter.
const GROUP: u32 = 8;

pub(super) fn shade(
    view: ViewQuery<(&GiView, &ViewTextures, &ViewUniformOffset)>,
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<InterleavedPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset) = view.into_inner();
    let (Some(_), Some(p), Some(vpl), Some(grid)) = (settings.0, pipelines, vpl, grid) else { return };
    let Some(view_buffer) = view_uniforms.uniforms.buffer() else { return };
    let Some(grid_group) = bind_grid(&grid, ctx.render_device(), &cache) else { return };
    let view_uniform = BindingResource::Buffer(BufferBinding {
        buffer: view_buffer,
        offset: offset.offset.into(),
        size: Some(ViewUniform::min_size()),
    });
    let visibility = gi.settings.visibility;
    let shade = p.shade(visibility);
    let device = ctx.render_device().clone();
    let shade_group = shade.bind(
        &device,
        &cache,
        &[
            view_uniform.clone(),
            texture(&textures.surface),
            whole(&vpl.header),
            whole(&vpl.vpls),
            texture(&textures.interleaved),
        ],
    );
    let filter_group = p.filter.bind(
        &device,
        &cache,
        &[view_uniform, texture(&textures.surface), texture(&textures.interleaved), texture(&textures.indirect)],
    );

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/interleaved");
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE_PIXELS)) * 4;
    let groups: &[_] = match visibility {
        VplVisibility::None => &[&shade_group],
        VplVisibility::Voxel => &[&shade_group, &grid_group],
    };
    shade.dispatch(encoder, &cache, groups, tiles.extend(1));
    let groups = textures.size.map(|pixels| pixels.div_ceil(GROUP));
    p.filter.dispatch(encoder, &cache, &[&filter_group], groups.extend(1));
    span.end(encoder);
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}
