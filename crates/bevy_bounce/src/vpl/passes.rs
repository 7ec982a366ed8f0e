//! Emitters, paths, list.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::RenderContext;

use super::pipelines::VplPipelines;
use super::prepare::VplBuffers;
use crate::avg::{VoxelGrid, bind_grid};
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;

/// Threads of a workgroup of the path tracer.
const GROUP: u32 = 64;

pub(super) fn trace_vpls(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<VplPipelines>>,
    buffers: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(vpl), Some(grid), Some(scene)) = (settings.0, pipelines, buffers, grid, scene) else {
        return;
    };
    let (Some(scene_uniform), Some(parameters)) = (scene.uniform(), vpl.parameters.binding()) else { return };
    let (Some(grid_uniform), Some(grid_group)) =
        (grid.uniform.binding(), bind_grid(&grid, ctx.render_device(), &cache))
    else {
        return;
    };
    let device = ctx.render_device().clone();
    let emitters = p.collect_emitters.bind(
        &device,
        &cache,
        &[
            whole(&scene.geometry),
            whole(&scene.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            whole(&scene.emissive_chunks),
            whole(&vpl.emitters),
            scene_uniform.clone(),
        ],
    );
    let trace = p.trace_paths.bind(
        &device,
        &cache,
        &[
            parameters.clone(),
            scene_uniform,
            whole(&scene.lights),
            whole(&vpl.emitters),
            whole(&vpl.vertices),
            whole(&vpl.paths),
            whole(&vpl.brick_counts),
        ],
    );
    let list = p.build_list.bind(
        &device,
        &cache,
        &[
            parameters,
            grid_uniform,
            whole(&vpl.vertices),
            whole(&vpl.paths),
            whole(&vpl.brick_counts),
            whole(&grid.counters),
            whole(&vpl.header),
            whole(&vpl.vpls),
        ],
    );

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/vpl_trace");
    let chunks = folded(scene.emissive_chunk_count());
    p.collect_emitters.dispatch(encoder, &cache, &[&emitters], chunks);
    p.accumulate_emitters.dispatch(encoder, &cache, &[&emitters], chunks.min(UVec3::ONE));
    let paths = UVec3::new(vpl.parameters().path_count.div_ceil(GROUP), 1, 1);
    encoder.clear_buffer(&vpl.brick_counts, 0, None);
    p.trace_paths.dispatch(encoder, &cache, &[&trace, &grid_group], paths);
    p.build_list.dispatch(encoder, &cache, &[&list], UVec3::ONE);
    span.end(encoder);
}
