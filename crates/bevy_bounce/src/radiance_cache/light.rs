//! Lights the voxels and filters their light.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, CommandEncoder, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, RenderDevice};

use super::pipelines::LightPipelines;
use super::volume::VoxelLight;
use crate::avg::{TriangleGroups, VoxelGrid, bind_grid};
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::vpl::VplBuffers;

/// Threads of a workgroup.
const GROUP: u32 = 64;
/// Edge of a workgroup over texels.
const CUBE: u32 = 4;

/// What the kernels bind.
struct Groups {
    emission: TriangleGroups,
    places: BindGroup,
    light: BindGroup,
    grid: BindGroup,
    fill: BindGroup,
    reduce: Vec<BindGroup>,
}

impl Groups {
    fn new(
        p: &LightPipelines,
        light: &VoxelLight,
        grid: &VoxelGrid,
        vpl: &VplBuffers,
        scene: &SceneBuffers,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let (grid_uniform, volume, scene_uniform) =
            (grid.uniform.binding()?, light.parameters.binding()?, scene.uniform()?);
        let emission = [
            whole(&scene.geometry),
            whole(&scene.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            grid_uniform.clone(),
            scene_uniform.clone(),
            whole(&scene.emissive_chunks),
            whole(&grid.work.queue),
            whole(&grid.voxels),
            whole(&light.emission_sums),
        ];
        let places = [
            grid_uniform.clone(),
            scene_uniform.clone(),
            whole(&grid.voxels),
            whole(&vpl.emitters),
            whole(&light.places),
            whole(&light.unit),
            whole(&scene.lights),
        ];
        let lit = [
            scene_uniform.clone(),
            whole(&scene.lights),
            whole(&vpl.header),
            whole(&vpl.vpls),
            whole(&light.places),
            grid_uniform.clone(),
            whole(&vpl.densities),
            whole(&light.irradiance),
            volume.clone(),
        ];
        let fill = [
            volume.clone(),
            grid_uniform,
            scene_uniform,
            whole(&grid.voxels),
            whole(&grid.cells),
            whole(&light.irradiance),
            whole(&light.emission_sums),
            whole(&light.unit),
        ];
        let fill: Vec<_> = fill.into_iter().chain(views(light.levels.first()?)).collect();
        let reduce = |levels: &[[TextureView; 3]]| {
            let bindings: Vec<_> = std::iter::once(volume.clone()).chain(levels.iter().flat_map(views)).collect();
            p.reduce.bind(device, cache, &bindings)
        };
        Some(Self {
            emission: p.emit.bind(device, cache, &grid.work, &emission),
            places: p.list_places.bind(device, cache, &places),
            light: p.light_cells.bind(device, cache, &lit),
            grid: bind_grid(grid, device, cache)?,
            fill: p.fill.bind(device, cache, &fill),
            reduce: light.levels.windows(2).map(reduce).collect(),
        })
    }
}

fn views(level: &[TextureView; 3]) -> impl Iterator<Item = BindingResource<'_>> {
    level.iter().map(|view| BindingResource::TextureView(view))
}

/// What shines, into the cells.
fn add_emission(
    p: &LightPipelines,
    groups: &Groups,
    light: &VoxelLight,
    grid: &VoxelGrid,
    chunks: u32,
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
) {
    if chunks == 0 {
        return;
    }
    encoder.clear_buffer(&light.emission_sums, 0, None);
    p.emit.dispatch(encoder, cache, &grid.work, &groups.emission, folded(chunks));
}

/// Direct light, emission and further bounces of every cell, then the levels.
pub(super) fn light_voxels(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<LightPipelines>>,
    light: Option<Res<VoxelLight>>,
    grid: Option<Res<VoxelGrid>>,
    vpl: Option<Res<VplBuffers>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(light), Some(grid), Some(vpl), Some(scene)) =
        (settings.0, pipelines, light, grid, vpl, scene)
    else {
        return;
    };
    let Some(groups) = Groups::new(&p, &light, &grid, &vpl, &scene, ctx.render_device(), &cache) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/voxel_light");
    add_emission(&p, &groups, &light, &grid, scene.world_emissive_chunk_count(), encoder, &cache);
    encoder.clear_buffer(&light.places, 0, None);
    let voxels = folded(grid.grid.dims.element_product().div_ceil(GROUP));
    p.list_places.dispatch(encoder, &cache, &[&groups.places], voxels);
    p.measure_unit.dispatch(encoder, &cache, &[&groups.places], UVec3::ONE);
    let cells = folded(grid.grid.cell_capacity.div_ceil(GROUP));
    p.light_cells.dispatch(encoder, &cache, &[&groups.light, &groups.grid], cells);
    let cubes = |texels: UVec3| texels.map(|texels| texels.div_ceil(CUBE));
    p.fill.dispatch(encoder, &cache, &[&groups.fill], cubes(light.parameters.get().dims));
    for (level, group) in (1..).zip(&groups.reduce) {
        p.reduce.dispatch(encoder, &cache, &[group], cubes(light.level_size(level)));
    }
    span.end(encoder);
}
