//! Lights the voxels and filters their light.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, Buffer, CommandEncoder, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy_bounce_shaders::types::GROUP_EDGE;

use super::pipelines::LightPipelines;
use super::volume::{EMISSION_BYTES, LightTextures, VoxelLight};
use crate::avg::{GROUP_CELLS, VoxelGrid, Workspace, bind_grid};
use crate::compute::{Kernel, folded, part, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::vpl::VplBuffers;

/// Threads of a workgroup.
const GROUP: u32 = 64;
/// Edge of a workgroup over texels.
const CUBE: u32 = 4;

/// What the kernels bind.
struct Bound {
    places: BindGroup,
    light: BindGroup,
    grid: BindGroup,
    world: Filtered,
    groups: Option<Filtered>,
}

/// The finest level of some textures, and those made from it.
struct Filtered {
    fill: BindGroup,
    reduce: Vec<BindGroup>,
}

impl Bound {
    fn new(
        p: &LightPipelines,
        light: &VoxelLight,
        grid: &VoxelGrid,
        vpl: &VplBuffers,
        scene: &SceneBuffers,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let (grid_uniform, volume, scene_uniform, voxel_groups) =
            (grid.uniform.binding()?, light.parameters.binding()?, scene.uniform()?, grid.groups.uniform.binding()?);
        let places = [
            grid_uniform.clone(),
            scene_uniform.clone(),
            whole(&grid.voxels),
            whole(&vpl.emitters),
            whole(&light.places),
            whole(&light.unit),
            whole(&scene.lights),
            volume.clone(),
            voxel_groups.clone(),
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
        let cells = [
            volume.clone(),
            grid_uniform,
            scene_uniform,
            whole(&grid.voxels),
            whole(&grid.cells),
            whole(&light.irradiance),
            whole(&light.emission_sums),
            whole(&light.unit),
        ];
        let reduce = |levels: &[[TextureView; 3]]| {
            let bindings: Vec<_> = std::iter::once(volume.clone()).chain(levels.iter().flat_map(views)).collect();
            p.reduce.bind(device, cache, &bindings)
        };
        let filtered = |fill: &Kernel, textures: &LightTextures| {
            let finest = textures.levels.first().into_iter().flat_map(views);
            let bindings: Vec<_> = cells.iter().cloned().chain(finest).chain([voxel_groups.clone()]).collect();
            Filtered {
                fill: fill.bind(device, cache, &bindings),
                reduce: textures.levels.windows(2).map(reduce).collect(),
            }
        };
        Some(Self {
            places: p.list_places.bind(device, cache, &places),
            light: p.light_cells.bind(device, cache, &lit),
            grid: bind_grid(grid, device, cache)?,
            world: filtered(&p.fill, &light.world),
            groups: light.groups.as_ref().map(|groups| filtered(&p.fill_groups, groups)),
        })
    }
}

fn views(level: &[TextureView; 3]) -> impl Iterator<Item = BindingResource<'_>> {
    level.iter().map(|view| BindingResource::TextureView(view))
}

/// What shines of a grid, into its cells: a run of the voxeliser over the chunks that emit.
struct Emission<'a> {
    grid: BindingResource<'a>,
    scene: BindingResource<'a>,
    instances: &'a Buffer,
    chunks: (&'a Buffer, u32),
    voxels: BindingResource<'a>,
    /// Where the cells' emission is, bytes.
    cells: (u64, u64),
    work: &'a Workspace,
}

impl Emission<'_> {
    fn record(
        &self,
        p: &LightPipelines,
        light: &VoxelLight,
        scene: &SceneBuffers,
        device: &RenderDevice,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        let bindings = [
            whole(&scene.geometry),
            whole(self.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            self.grid.clone(),
            self.scene.clone(),
            whole(self.chunks.0),
            whole(&self.work.queue),
            self.voxels.clone(),
            part(&light.emission_sums, self.cells),
        ];
        let bound = p.emit.bind(device, cache, self.work, &bindings);
        encoder.clear_buffer(&light.emission_sums, self.cells.0, Some(self.cells.1));
        p.emit.dispatch(encoder, cache, self.work, &bound, folded(self.chunks.1));
    }
}

/// The emission of the world, and of grids of groups that are new or have changed.
fn add_emission(
    p: &LightPipelines,
    light: &mut VoxelLight,
    grid: &VoxelGrid,
    scene: &SceneBuffers,
    device: &RenderDevice,
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
) {
    let count = scene.world_emissive_chunk_count();
    if let (Some(uniform), Some(scene_uniform)) = (grid.uniform.binding(), scene.uniform())
        && count > 0
    {
        let world = Emission {
            grid: uniform,
            scene: scene_uniform,
            instances: &scene.instances,
            chunks: (&scene.emissive_chunks, count),
            voxels: whole(&grid.voxels),
            cells: light.world_emission(),
            work: &grid.work,
        };
        world.record(p, light, scene, device, encoder, cache);
    }
    let Some(work) = &grid.groups.work else { return };
    light.emitted.resize(grid.groups.sources.len(), 0);
    for (index, source) in grid.groups.sources.iter().enumerate() {
        let (Some(uniform), Some(scene_uniform)) = (source.grid.binding(), source.scene.binding()) else { continue };
        if !(source.is_built && source.is_placed) || light.emitted[index] == source.revision {
            continue;
        }
        let group = Emission {
            grid: uniform,
            scene: scene_uniform,
            instances: &source.instances,
            chunks: (&source.emissive_chunks.0, source.emissive_chunks.1),
            voxels: part(&grid.voxels, grid.groups.voxel_range(index)),
            cells: grid.groups.cell_range(index, EMISSION_BYTES),
            work,
        };
        group.record(p, light, scene, device, encoder, cache);
        light.emitted[index] = source.revision;
    }
}

/// Direct light, emission and further bounces of every cell, then the levels.
pub(super) fn light_voxels(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<LightPipelines>>,
    light: Option<ResMut<VoxelLight>>,
    grid: Option<Res<VoxelGrid>>,
    vpl: Option<Res<VplBuffers>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(mut light), Some(grid), Some(vpl), Some(scene)) =
        (settings.0, pipelines, light, grid, vpl, scene)
    else {
        return;
    };
    if !p.are_ready(&cache) {
        return;
    }
    let device = ctx.render_device().clone();
    let Some(bound) = Bound::new(&p, &light, &grid, &vpl, &scene, &device, &cache) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/voxel_light");
    add_emission(&p, &mut light, &grid, &scene, &device, encoder, &cache);
    encoder.clear_buffer(&light.places, 0, None);
    let voxels = folded(grid.grid.dims.element_product().div_ceil(GROUP));
    p.list_places.dispatch(encoder, &cache, &[&bound.places], voxels);
    let groups = grid.groups.count();
    let group_voxels = folded((groups * GROUP_EDGE.pow(3)).div_ceil(GROUP));
    p.list_group_places.dispatch(encoder, &cache, &[&bound.places], group_voxels);
    p.measure_unit.dispatch(encoder, &cache, &[&bound.places], UVec3::ONE);
    let cells = light.parameters.get().first_group_cell + groups * GROUP_CELLS as u32;
    p.light_cells.dispatch(encoder, &cache, &[&bound.light, &bound.grid], folded(cells.div_ceil(GROUP)));
    let mut filter = |fill: &Kernel, bound: &Filtered, textures: &LightTextures, texels: UVec3| {
        let cubes = |texels: UVec3| texels.map(|texels| texels.div_ceil(CUBE));
        fill.dispatch(encoder, &cache, &[&bound.fill], cubes(texels));
        for (level, group) in (1..).zip(&bound.reduce) {
            p.reduce.dispatch(encoder, &cache, &[group], cubes(textures.level_size(level)));
        }
    };
    filter(&p.fill, &bound.world, &light.world, light.parameters.get().dims);
    if let (Some(bound), Some(textures)) = (&bound.groups, &light.groups) {
        filter(&p.fill_groups, bound, textures, UVec3::splat(GROUP_EDGE) * UVec3::new(1, 1, groups));
    }
    span.end(encoder);
    light.is_lit = true;
}
