//! Shade the subsets, join them.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindingResource, BufferBinding, PipelineCache, ShaderType, TextureView};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};

use super::pipelines::InterleavedPipelines;
use crate::avg::{VoxelGrid, bind_grid};
use crate::compute::whole;
use crate::settings::GiWorldSettings;
use crate::shadow_atlas::{ShadowAtlas, bind_atlas};
use crate::view::{GiView, ViewTextures};
use crate::vpl::VplBuffers;
use crate::{Technique, VplVisibility};

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
    atlas: Option<Res<ShadowAtlas>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset) = view.into_inner();
    let (Some(_), Some(p), Some(vpl), Some(grid)) = (settings.0, pipelines, vpl, grid) else { return };
    if gi.technique != Technique::InstantRadiosity {
        return;
    }
    let (Some(view_buffer), Some(grid_uniform)) = (view_uniforms.uniforms.buffer(), grid.uniform.binding()) else {
        return;
    };
    let atlas_group = atlas.and_then(|atlas| bind_atlas(&atlas, ctx.render_device(), &cache));
    let (visibility, visibility_group) = match (gi.settings.visibility, atlas_group) {
        (VplVisibility::None, _) => (VplVisibility::None, None),
        (VplVisibility::Ism | VplVisibility::Atlas, Some(group)) => (VplVisibility::Atlas, Some(group)),
        _ => {
            let Some(group) = bind_grid(&grid, ctx.render_device(), &cache) else { return };
            (VplVisibility::Voxel, Some(group))
        }
    };
    let view_uniform = BindingResource::Buffer(BufferBinding {
        buffer: view_buffer,
        offset: offset.offset.into(),
        size: Some(ViewUniform::min_size()),
    });
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
            grid_uniform,
            whole(&vpl.densities),
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
    let groups: Vec<_> = std::iter::once(&shade_group).chain(&visibility_group).collect();
    shade.dispatch(encoder, &cache, &groups, tiles.extend(1));
    let groups = textures.size.map(|pixels| pixels.div_ceil(GROUP));
    p.filter.dispatch(encoder, &cache, &[&filter_group], groups.extend(1));
    span.end(encoder);
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}
