//! Builds the grids: mark, place cells, add up, take means, measure distances.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindingResource, Buffer, CommandEncoder, PipelineCache, ShaderType};
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy_bounce_shaders::types::{Cell, GROUP_EDGE};

use super::grid::{BLOCK_VOXELS, VoxelGrid, Workspace};
use super::groups::GROUP_CELLS;
use super::pipelines::AvgPipelines;
use crate::compute::{folded, part, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;

/// Threads of a workgroup of the kernels that take a block or a cell each.
const GROUP: u32 = 64;

/// What a grid is voxelised from, and where to.
struct Voxelized<'a> {
    grid: BindingResource<'a>,
    scene: BindingResource<'a>,
    instances: &'a Buffer,
    chunks: &'a Buffer,
    voxels: (u64, u64),
    cells: (u64, u64),
    work: &'a Workspace,
    /// Chunks, times the grids within each other that each goes into.
    chunk_count: u32,
    /// Blocks of 2^3 voxels.
    leap_count: u32,
    /// Cells that there is room for.
    cell_capacity: u32,
}

impl Voxelized<'_> {
    fn record(
        &self,
        p: &AvgPipelines,
        held: &VoxelGrid,
        scene: &SceneBuffers,
        device: &RenderDevice,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        let (work, voxels) = (self.work, part(&held.voxels, self.voxels));
        let triangles = [
            whole(&scene.geometry),
            whole(self.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            self.grid.clone(),
            self.scene.clone(),
            whole(self.chunks),
            whole(&work.queue),
            voxels.clone(),
            whole(&work.sums),
        ];
        let mark = p.mark.bind(device, cache, work, &triangles[..9]);
        let add = p.add.bind(device, cache, work, &triangles);
        let cells = p.resolve.bind(
            device,
            cache,
            &[
                self.grid.clone(),
                voxels.clone(),
                whole(&work.blocks),
                whole(&work.counters),
                whole(&work.sums),
                part(&held.cells, self.cells),
            ],
        );
        let distance = p.distance_x.bind(
            device,
            cache,
            &[self.grid.clone(), voxels, whole(&work.occupied), whole(&work.along_x), whole(&work.along_y)],
        );
        let chunks = folded(self.chunk_count);
        let blocks = folded((self.voxels.1 / 4).div_ceil(u64::from(BLOCK_VOXELS)) as u32);
        let leaps = folded(self.leap_count.div_ceil(GROUP));
        let per_cell = folded(self.cell_capacity.div_ceil(GROUP));
        encoder.clear_buffer(&held.voxels, self.voxels.0, Some(self.voxels.1));
        encoder.clear_buffer(&work.sums, 0, None);
        p.mark.dispatch(encoder, cache, work, &mark, chunks);
        p.count_blocks.dispatch(encoder, cache, &[&cells], blocks);
        p.scan_blocks.dispatch(encoder, cache, &[&cells], UVec3::ONE);
        p.assign_cells.dispatch(encoder, cache, &[&cells], blocks);
        p.add.dispatch(encoder, cache, work, &add, chunks);
        p.resolve.dispatch(encoder, cache, &[&cells], per_cell);
        for kernel in [&p.find_occupied, &p.distance_x, &p.distance_y, &p.distance_z] {
            kernel.dispatch(encoder, cache, &[&distance], leaps);
        }
    }
}

/// The grids of groups that are new or have changed; how many that were.
fn voxelize_groups(
    p: &AvgPipelines,
    held: &VoxelGrid,
    scene: &SceneBuffers,
    device: &RenderDevice,
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
) -> u64 {
    let Some(work) = &held.groups.work else { return 0 };
    let mut count = 0;
    for (index, source) in held.groups.missing() {
        let (Some(grid), Some(uniform)) = (source.grid.binding(), source.scene.binding()) else { continue };
        let voxelized = Voxelized {
            grid,
            scene: uniform,
            instances: &source.instances,
            chunks: &source.chunks.0,
            voxels: held.groups.voxel_range(index),
            cells: held.groups.cell_range(index, u64::from(Cell::min_size())),
            work,
            chunk_count: source.chunks.1,
            leap_count: (GROUP_EDGE / 2).pow(3),
            cell_capacity: GROUP_CELLS as u32,
        };
        voxelized.record(p, held, scene, device, encoder, cache);
        count += 1;
    }
    count
}

pub(super) fn voxelize(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<AvgPipelines>>,
    grid: Option<ResMut<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(mut grid), Some(scene)) = (settings.0, pipelines, grid, scene) else { return };
    let (Some(uniform), Some(scene_uniform)) = (grid.uniform.binding(), scene.uniform()) else { return };
    if !p.are_ready(&cache) {
        return;
    }
    let device = ctx.render_device().clone();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/voxelize");
    let world = Voxelized {
        grid: uniform,
        scene: scene_uniform,
        instances: &scene.instances,
        chunks: &scene.chunks,
        voxels: grid.world_voxels(),
        cells: grid.world_cells(),
        work: &grid.work,
        chunk_count: scene.world_chunk_count() * grid.level_count(),
        leap_count: grid.leap_count(),
        cell_capacity: grid.grid.cell_capacity,
    };
    world.record(&p, &grid, &scene, &device, encoder, &cache);
    let built = voxelize_groups(&p, &grid, &scene, &device, encoder, &cache);
    span.end(encoder);
    if built > 0 {
        grid.groups.built += built;
        grid.groups.sources.iter_mut().filter(|source| source.is_placed).for_each(|source| source.is_built = true);
    }
}
