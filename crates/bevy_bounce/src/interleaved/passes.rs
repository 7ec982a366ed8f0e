//! Shade the subsets, join them.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindingResource, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use super::pipelines::{InterleavedPipelines, PassesKey};
use crate::Technique;
use crate::avg::VoxelGrid;
use crate::compute::{GiShaders, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::shadow_atlas::{ShadowAtlas, bind_visibility};
use crate::view::{GiView, ViewTextures, view_binding};
use crate::vpl::VplBuffers;

/// Edge of a tile of texels of one sub-image, times the edge of the 4x4 blocks.
const TILE_TEXELS: u32 = 8 * 4;
/// Edge of a workgroup of the filter.
const GROUP: u32 = 8;

pub(super) fn shade(
    view: ViewQuery<(&GiView, &ViewTextures, &ViewUniformOffset)>,
    settings: Res<GiWorldSettings>,
    pipelines: Option<ResMut<InterleavedPipelines>>,
    shaders: Res<GiShaders>,
    view_uniforms: Res<ViewUniforms>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    atlas: Option<Res<ShadowAtlas>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset) = view.into_inner();
    let (Some(_), Some(mut p), Some(vpl), Some(grid), Some(scene)) = (settings.0, pipelines, vpl, grid, scene) else {
        return;
    };
    if gi.technique != Technique::InstantRadiosity {
        return;
    }
    let (Some(view_uniform), Some(grid_uniform)) = (view_binding(&view_uniforms, offset), grid.uniform.binding())
    else {
        return;
    };
    let sky = (scene.sky_count() > 0 && gi.settings.sky > 0).then_some(&*scene);
    let bind_sight =
        |sky| bind_visibility(gi.settings.visibility, atlas.as_deref(), &grid, sky, ctx.render_device(), &cache);
    let Some((visibility, see_groups)) = bind_sight(sky) else { return };
    let sky_seen = textures.sky_seen.as_ref().filter(|_| sky.is_some());
    let key =
        PassesKey { visibility, resolution: gi.settings.resolution, sky: sky.is_some(), sky_seen: sky_seen.is_some() };
    p.passes(key, &shaders);
    let Some(key) = p.compiled(key, &cache) else { return };
    let sky_seen = sky_seen.filter(|_| key.sky_seen);
    let see_groups =
        if key.sky == sky.is_some() { see_groups } else { bind_sight(None).map_or(see_groups, |bound| bound.1) };
    let passes = p.passes(key, &shaders);
    let device = ctx.render_device().clone();
    let bindings = |output| {
        [
            view_uniform.clone(),
            texture(&textures.surface),
            whole(&vpl.header),
            whole(&vpl.vpls),
            texture(output),
            grid_uniform.clone(),
            whole(&vpl.densities),
        ]
    };
    let from_to = |from, to| bindings(to).into_iter().chain([texture(from)]).collect::<Vec<_>>();
    let (last, between) = (&textures.indirect, &textures.interleaved);
    let shaded = bindings(last).into_iter().chain(sky_seen.map(texture)).collect::<Vec<_>>();
    let shade_group = passes.shade.bind(&device, &cache, &shaded);
    let rows_group = passes.rows.bind(&device, &cache, &from_to(last, between));
    let columns_group = passes.columns.bind(&device, &cache, &from_to(between, last));
    let sky_groups = passes.sky_columns.as_ref().zip(sky_seen).map(|(columns, seen)| {
        let rows_group = passes.rows.bind(&device, &cache, &from_to(seen, between));
        (rows_group, columns, columns.bind(&device, &cache, &from_to(between, seen)))
    });

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/interleaved");
    let pixels_a_texel = gi.settings.resolution.pixels_a_texel();
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE_TEXELS * pixels_a_texel)) * 4;
    let with = |group| std::iter::once(group).chain(&see_groups).collect::<Vec<_>>();
    passes.shade.dispatch(encoder, &cache, &with(&shade_group), tiles.extend(1));
    let groups = UVec3::from((textures.size.map(|pixels| pixels.div_ceil(GROUP)), 1));
    let rows = groups.with_y(textures.size.y.div_ceil(GROUP * pixels_a_texel));
    passes.rows.dispatch(encoder, &cache, &with(&rows_group), rows);
    passes.columns.dispatch(encoder, &cache, &with(&columns_group), groups);
    if let Some((rows_group, columns, columns_group)) = &sky_groups {
        passes.rows.dispatch(encoder, &cache, &with(rows_group), rows);
        columns.dispatch(encoder, &cache, &with(columns_group), groups);
    }
    span.end(encoder);
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}
