//! Emitters, paths, order, list.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, CommandEncoder, PipelineCache};
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy_bounce_shaders::types::{CANDIDATES, GROUP_EDGE, HILBERT_BITS, VplParameters};

use super::pipelines::VplPipelines;
use super::prepare::VplBuffers;
use crate::avg::{VoxelGrid, bind_grid};
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::sort::SortPipelines;

/// Bits of the key that vertices are sorted by: grid and facing, of six, and place on a Hilbert curve.
fn vertex_key_bits(grids: u32) -> u32 {
    (6 * grids).next_power_of_two().ilog2() + 3 * HILBERT_BITS
}

/// Threads of a workgroup, a path or a light each.
const GROUP: u32 = 64;
/// Threads of a workgroup, a vertex each.
const NODE_GROUP: u32 = 256;

/// What the passes bind.
struct Inputs<'a> {
    p: &'a VplPipelines,
    device: &'a RenderDevice,
    cache: &'a PipelineCache,
    scene: &'a SceneBuffers,
    grid: &'a VoxelGrid,
    vpl: &'a VplBuffers,
    /// Uniforms.
    scene_uniform: BindingResource<'a>,
    grid_uniform: BindingResource<'a>,
    parameters: BindingResource<'a>,
    /// Bits of the vertices' keys.
    key_bits: u32,
}

/// Bind groups of what comes before the paths: emitters, areas of groups, lists of triangles.
struct BeforeGroups {
    emitters: BindGroup,
    areas: BindGroup,
    triangles: BindGroup,
    bricks: BindGroup,
}

/// Bind groups of the paths.
struct PathGroups {
    ahead: BindGroup,
    alive: BindGroup,
    trace: BindGroup,
    settle: BindGroup,
    places: BindGroup,
}

/// Bind groups of what makes lights of their vertices.
struct LightGroups {
    order: BindGroup,
    weights: BindGroup,
    cuts: BindGroup,
    list: BindGroup,
    density: BindGroup,
}

impl<'a> Inputs<'a> {
    /// Bindings 0 to 3 of what reads triangles, and more.
    fn surfaces(&self, more: impl IntoIterator<Item = BindingResource<'a>>) -> Vec<BindingResource<'a>> {
        let scene = self.scene;
        let surfaces = [&scene.geometry, &scene.instances, &scene.materials, &scene.thumbnails].map(whole);
        surfaces.into_iter().chain(more).collect()
    }

    fn vertices(&self) -> BindingResource<'a> {
        whole(self.vpl.vertices(self.grid))
    }

    fn before(&self) -> BeforeGroups {
        let Self { p, device, cache, scene, grid, vpl, .. } = self;
        let emitters = self.surfaces([whole(&scene.emissive_chunks), whole(&vpl.emitters), self.scene_uniform.clone()]);
        let triangles = self.surfaces([
            self.grid_uniform.clone(),
            self.scene_uniform.clone(),
            whole(&scene.chunks),
            whole(&grid.work.queue),
            whole(&vpl.triangle_lists),
        ]);
        let bricks = [whole(&grid.work.queue), whole(&grid.work.brick_workgroups)];
        BeforeGroups {
            emitters: p.collect_emitters.bind(device, cache, &emitters),
            areas: p.add_group_areas.bind(device, cache, &[whole(&vpl.bricks), whole(&grid.work.counters)]),
            triangles: p.list_triangles.bind(device, cache, &triangles),
            bricks: p.size_bricks.bind(device, cache, &bricks),
        }
    }

    fn paths(&self) -> PathGroups {
        let Self { p, device, cache, scene, vpl, .. } = self;
        let paths = whole(&vpl.paths);
        let trace = [
            self.parameters.clone(),
            self.scene_uniform.clone(),
            whole(&scene.lights),
            whole(&vpl.emitters),
            whole(&vpl.bricks),
            whole(&vpl.candidates),
            self.vertices(),
            paths.clone(),
        ];
        let alive = [self.parameters.clone(), paths.clone(), whole(&vpl.alive_count), whole(&vpl.alive_workgroups)];
        let settle = self.surfaces([
            self.parameters.clone(),
            self.grid_uniform.clone(),
            whole(&scene.chunks),
            whole(&vpl.triangle_lists),
            self.vertices(),
            paths.clone(),
        ]);
        PathGroups {
            ahead: p.look_ahead.bind(device, cache, &trace[..6]),
            alive: p.gather_alive.bind(device, cache, &alive),
            trace: p.trace_paths.bind(device, cache, &trace),
            settle: p.meet_triangles.bind(device, cache, &settle),
            places: p.set_vertices.bind(device, cache, &[self.parameters.clone(), paths, self.vertices()]),
        }
    }

    fn lights(&self) -> LightGroups {
        let Self { p, device, cache, grid, vpl, .. } = self;
        let uniforms = [self.parameters.clone(), self.grid_uniform.clone()];
        let with_uniforms = |more: &[BindingResource<'a>]| [&uniforms[..], more].concat();
        let (count, sorted) = (whole(&vpl.vertex_count), whole(vpl.order.sorted(self.key_bits)));
        let (starts, firsts, header) = (whole(&vpl.starts), whole(&vpl.firsts), whole(&vpl.header));
        let order = with_uniforms(&[self.vertices(), whole(&vpl.paths), count.clone(), whole(vpl.order.pairs())]);
        let cuts = with_uniforms(&[
            count.clone(),
            sorted.clone(),
            starts.clone(),
            whole(&grid.work.counters),
            whole(&vpl.nodes),
            whole(&vpl.steps),
            firsts.clone(),
            header.clone(),
        ]);
        let list = with_uniforms(&[
            self.vertices(),
            sorted.clone(),
            firsts,
            header,
            whole(&vpl.vpls),
            whole(&vpl.bricks),
            whole(&vpl.nodes),
            whole(&vpl.compact_vpls),
        ]);
        let density = [self.parameters.clone(), whole(&vpl.bricks), whole(&vpl.densities)];
        LightGroups {
            order: p.scan_paths.bind(device, cache, &order),
            weights: p.scan_weights.bind(device, cache, &[self.vertices(), count, sorted, starts]),
            cuts: p.cut.bind(device, cache, &cuts),
            list: p.build_list.bind(device, cache, &list),
            density: p.measure_density.bind(device, cache, &density),
        }
    }

    /// Emitters, areas of groups, lists of triangles.
    fn record_before(&self, encoder: &mut CommandEncoder, grid_group: &BindGroup) {
        let Self { p, cache, scene, grid, vpl, .. } = self;
        let groups = self.before();
        let chunks = folded(scene.emissive_chunk_count());
        p.collect_emitters.dispatch(encoder, cache, &[&groups.emitters], chunks);
        p.accumulate_emitters.dispatch(encoder, cache, &[&groups.emitters], chunks.min(UVec3::ONE));
        encoder.clear_buffer(&vpl.bricks, 0, None);
        let group_voxels = grid.groups.count() * GROUP_EDGE.pow(3);
        p.add_group_areas.dispatch(encoder, cache, &[&groups.areas, grid_group], folded(group_voxels.div_ceil(GROUP)));
        encoder.clear_buffer(&grid.work.queue, 0, Some(4));
        let heads = u64::from(1 + grid.voxel_count()) * 4;
        encoder.clear_buffer(&vpl.triangle_lists, 0, Some(heads.min(vpl.triangle_lists.size())));
        p.list_triangles.dispatch(encoder, cache, &[&groups.triangles], folded(scene.chunk_count()));
        p.size_bricks.dispatch(encoder, cache, &[&groups.bricks], UVec3::ONE);
        p.list_bricks.dispatch_indirect(encoder, cache, &[&groups.triangles], &grid.work.brick_workgroups);
    }

    /// Paths, bounce by bounce.
    fn record_paths(&self, encoder: &mut CommandEncoder, grid_group: &BindGroup) {
        let Self { p, cache, scene, vpl, .. } = self;
        let groups = self.paths();
        let VplParameters { path_count, max_bounces, .. } = vpl.parameters();
        if scene.has_directional_lights() {
            let candidates = path_count * CANDIDATES;
            p.look_ahead.dispatch(encoder, cache, &[&groups.ahead, grid_group], folded(candidates.div_ceil(GROUP)));
        }
        let all = workgroups(path_count);
        p.begin_paths.dispatch(encoder, cache, &[&groups.alive], all);
        let going_on = &vpl.alive_workgroups;
        for _ in 0..max_bounces {
            p.gather_alive.dispatch(encoder, cache, &[&groups.alive], all);
            p.size_alive.dispatch(encoder, cache, &[&groups.alive], UVec3::ONE);
            p.trace_paths.dispatch_indirect(encoder, cache, &[&groups.trace, grid_group], going_on);
            p.meet_triangles.dispatch_indirect(encoder, cache, &[&groups.settle], going_on);
            p.set_vertices.dispatch_indirect(encoder, cache, &[&groups.places, grid_group], going_on);
        }
    }

    /// Their vertices in order, cut into lights, and how dense these are.
    fn record_lights(&self, encoder: &mut CommandEncoder, grid_group: &BindGroup, sort: &SortPipelines) {
        let Self { p, device, cache, grid, vpl, .. } = self;
        let groups = self.lights();
        let VplParameters { path_count, capacity, max_bounces, .. } = vpl.parameters();
        p.scan_paths.dispatch(encoder, cache, &[&groups.order], UVec3::ONE);
        p.write_pairs.dispatch(encoder, cache, &[&groups.order], workgroups(path_count));
        sort.sort(device, encoder, cache, &vpl.order, &vpl.vertex_count, self.key_bits);
        p.scan_weights.dispatch(encoder, cache, &[&groups.weights], UVec3::ONE);
        encoder.clear_buffer(&vpl.steps, 0, None);
        let vertices = path_count * (max_bounces + 1);
        p.measure_nodes.dispatch(encoder, cache, &[&groups.cuts], folded(vertices.div_ceil(NODE_GROUP)));
        p.cut.dispatch(encoder, cache, &[&groups.cuts], UVec3::ONE);
        p.build_list.dispatch(encoder, cache, &[&groups.list], workgroups(capacity));
        p.measure_density.dispatch(encoder, cache, &[&groups.density, grid_group], folded(grid.brick_count()));
    }
}

/// Workgroups for so many paths or lights.
fn workgroups(threads: u32) -> UVec3 {
    UVec3::new(threads.div_ceil(GROUP), 1, 1)
}

pub(super) fn trace_vpls(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<VplPipelines>>,
    sort: Option<Res<SortPipelines>>,
    buffers: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(p), Some(sort), Some(vpl), Some(grid), Some(scene)) =
        (settings.0, pipelines, sort, buffers, grid, scene)
    else {
        return;
    };
    // One after the other, and none without the rest.
    let (ours, sorts) = (p.are_ready(&cache), sort.are_ready(&cache));
    if !(ours && sorts) {
        return;
    }
    let device = ctx.render_device().clone();
    let (Some(scene_uniform), Some(parameters), Some(grid_uniform), Some(grid_group)) =
        (scene.uniform(), vpl.parameters.binding(), grid.uniform.binding(), bind_grid(&grid, &device, &cache))
    else {
        return;
    };
    let inputs = Inputs {
        p: &p,
        device: &device,
        cache: &cache,
        scene: &scene,
        grid: &grid,
        vpl: &vpl,
        scene_uniform,
        grid_uniform,
        parameters,
        key_bits: vertex_key_bits(grid.level_count()),
    };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/vpl_trace");
    inputs.record_before(encoder, &grid_group);
    inputs.record_paths(encoder, &grid_group);
    inputs.record_lights(encoder, &grid_group, &sort);
    span.end(encoder);
}
