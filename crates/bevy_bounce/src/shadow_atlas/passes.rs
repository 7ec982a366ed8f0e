//! Occluders, shadow maps.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::RenderContext;

use super::pipelines::AtlasPipelines;
use super::prepare::ShadowAtlas;
use crate::VplVisibility;
use crate::avg::VoxelGrid;
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::vpl::VplBuffers;

/// Threads of a workgroup that places points.
const GROUP: u32 = 64;

pub(super) fn draw_atlas(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<AtlasPipelines>>,
    atlas: Option<Res<ShadowAtlas>>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(p), Some(atlas), Some(vpl), Some(grid), Some(scene)) = (pipelines, atlas, vpl, grid, scene) else {
        return;
    };
    let (Some(parameters), Some(grid_uniform)) = (atlas.parameters.binding(), grid.uniform.binding()) else { return };
    let Some(settings) = settings.0 else { return };
    let counts = scene.occluders();
    let groups = |count| UVec3::new(count, 1, 1);
    let (place, place_groups, source, draw) = match settings.visibility {
        VplVisibility::Ism => {
            (&p.place_points, groups(counts.points.div_ceil(GROUP)), &scene.surface_points, &p.splat_points)
        }
        _ => (&p.place_occluders, groups(counts.chunks), &scene.occluder_chunks, &p.rasterize),
    };
    let device = ctx.render_device().clone();
    let place_group = place.bind(
        &device,
        &cache,
        &[
            whole(&scene.geometry),
            whole(&scene.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            whole(source),
            whole(&atlas.occluders),
        ],
    );
    let draw_group = draw.bind(
        &device,
        &cache,
        &[parameters, grid_uniform, whole(&vpl.header), whole(&atlas.occluders), whole(&vpl.vpls), whole(&atlas.atlas)],
    );

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/shadow_atlas");
    place.dispatch(encoder, &cache, &[&place_group], place_groups);
    draw.dispatch(encoder, &cache, &[&draw_group], folded(vpl.parameters().capacity));
    span.end(encoder);
}
