//! Builds the grid: mark, place cells, add up, take means, measure distances.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::RenderContext;

use super::grid::VoxelGrid;
use super::pipelines::AvgPipelines;
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;

/// Threads of a workgroup of the kernels that take a block or a cell each.
const GROUP: u32 = 64;

pub(super) fn voxelize(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<AvgPipelines>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(grid), Some(scene)) = (settings.0, pipelines, grid, scene) else { return };
    let Some(uniform) = grid.uniform.binding() else { return };
    let Some(scene_uniform) = scene.uniform() else { return };
    let device = ctx.render_device().clone();
    let triangles = [
        whole(&scene.geometry),
        whole(&scene.instances),
        whole(&scene.materials),
        whole(&scene.thumbnails),
        uniform.clone(),
        scene_uniform,
        whole(&scene.chunks),
        whole(&grid.queue),
        whole(&grid.voxels),
        whole(&grid.sums),
    ];
    let mark = p.mark.bind(&device, &cache, &grid, &triangles[..9]);
    let add = p.add.bind(&device, &cache, &grid, &triangles);
    let cells = p.resolve.bind(
        &device,
        &cache,
        &[
            uniform.clone(),
            whole(&grid.voxels),
            whole(&grid.blocks),
            whole(&grid.counters),
            whole(&grid.sums),
            whole(&grid.cells),
        ],
    );
    let distance = p.distance_x.bind(
        &device,
        &cache,
        &[uniform, whole(&grid.voxels), whole(&grid.occupied), whole(&grid.along_x), whole(&grid.along_y)],
    );

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/voxelize");

    let chunks = folded(scene.chunk_count() * grid.level_count());
    let blocks = folded(grid.block_count());
    let leaps = folded(grid.leap_count().div_ceil(GROUP));
    let per_cell = folded(grid.grid.cell_capacity.div_ceil(GROUP));

    encoder.clear_buffer(&grid.voxels, 0, None);
    encoder.clear_buffer(&grid.sums, 0, None);
    p.mark.dispatch(encoder, &cache, &grid, &mark, chunks);
    p.count_blocks.dispatch(encoder, &cache, &[&cells], blocks);
    p.scan_blocks.dispatch(encoder, &cache, &[&cells], UVec3::ONE);
    p.assign_cells.dispatch(encoder, &cache, &[&cells], blocks);
    p.add.dispatch(encoder, &cache, &grid, &add, chunks);
    p.resolve.dispatch(encoder, &cache, &[&cells], per_cell);
    for kernel in [&p.find_occupied, &p.distance_x, &p.distance_y, &p.distance_z] {
        kernel.dispatch(encoder, &cache, &[&distance], leaps);
    }
    span.end(encoder);
}
