//! Emitters, paths, order, list.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::PipelineCache;
use bevy::render::renderer::RenderContext;
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
    let (Some(scene_uniform), Some(parameters)) = (scene.uniform(), vpl.parameters.binding()) else { return };
    let (Some(grid_uniform), Some(grid_group)) =
        (grid.uniform.binding(), bind_grid(&grid, ctx.render_device(), &cache))
    else {
        return;
    };
    let device = ctx.render_device().clone();
    let key_bits = vertex_key_bits(grid.level_count());
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
    let trace_bindings = [
        parameters.clone(),
        scene_uniform.clone(),
        whole(&scene.lights),
        whole(&vpl.emitters),
        whole(&vpl.bricks),
        whole(&vpl.candidates),
        whole(vpl.vertices(&grid)),
        whole(&vpl.paths),
    ];
    let ahead = p.look_ahead.bind(&device, &cache, &trace_bindings[..6]);
    let trace = p.trace_paths.bind(&device, &cache, &trace_bindings);
    let order = p.scan_paths.bind(
        &device,
        &cache,
        &[
            parameters.clone(),
            grid_uniform.clone(),
            whole(vpl.vertices(&grid)),
            whole(&vpl.paths),
            whole(&vpl.vertex_count),
            whole(vpl.order.pairs()),
        ],
    );
    let weights = p.scan_weights.bind(
        &device,
        &cache,
        &[whole(vpl.vertices(&grid)), whole(&vpl.vertex_count), whole(vpl.order.sorted(key_bits)), whole(&vpl.starts)],
    );
    let cuts = p.cut.bind(
        &device,
        &cache,
        &[
            parameters.clone(),
            grid_uniform.clone(),
            whole(&vpl.vertex_count),
            whole(vpl.order.sorted(key_bits)),
            whole(&vpl.starts),
            whole(&grid.work.counters),
            whole(&vpl.nodes),
            whole(&vpl.steps),
            whole(&vpl.firsts),
            whole(&vpl.header),
        ],
    );
    let list = p.build_list.bind(
        &device,
        &cache,
        &[
            parameters.clone(),
            grid_uniform.clone(),
            whole(vpl.vertices(&grid)),
            whole(vpl.order.sorted(key_bits)),
            whole(&vpl.firsts),
            whole(&vpl.header),
            whole(&vpl.vpls),
            whole(&vpl.bricks),
        ],
    );
    let (queue, brick_workgroups) = (&grid.work.queue, &grid.work.brick_workgroups);
    let surfaces = [&scene.geometry, &scene.instances, &scene.materials, &scene.thumbnails].map(whole);
    let triangles =
        [grid_uniform.clone(), scene_uniform, whole(&scene.chunks), whole(queue), whole(&vpl.triangle_lists)];
    let triangles = p.list_triangles.bind(&device, &cache, &[&surfaces[..], &triangles].concat());
    let bricks = p.size_bricks.bind(&device, &cache, &[whole(queue), whole(brick_workgroups)]);
    let alive = p.gather_alive.bind(
        &device,
        &cache,
        &[parameters.clone(), whole(&vpl.paths), whole(&vpl.alive_count), whole(&vpl.alive_workgroups)],
    );
    let settle = [
        parameters.clone(),
        grid_uniform,
        whole(&scene.chunks),
        whole(&vpl.triangle_lists),
        whole(vpl.vertices(&grid)),
        whole(&vpl.paths),
    ];
    let settle = p.meet_triangles.bind(&device, &cache, &[&surfaces[..], &settle].concat());
    let places =
        p.set_vertices.bind(&device, &cache, &[parameters.clone(), whole(&vpl.paths), whole(vpl.vertices(&grid))]);
    let areas = p.add_group_areas.bind(&device, &cache, &[whole(&vpl.bricks), whole(&grid.work.counters)]);
    let density = p.measure_density.bind(&device, &cache, &[parameters, whole(&vpl.bricks), whole(&vpl.densities)]);

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/vpl_trace");
    let chunks = folded(scene.emissive_chunk_count());
    p.collect_emitters.dispatch(encoder, &cache, &[&emitters], chunks);
    p.accumulate_emitters.dispatch(encoder, &cache, &[&emitters], chunks.min(UVec3::ONE));
    let VplParameters { path_count, capacity, max_bounces, .. } = vpl.parameters();
    let groups = |threads: u32| UVec3::new(threads.div_ceil(GROUP), 1, 1);
    encoder.clear_buffer(&vpl.bricks, 0, None);
    encoder.clear_buffer(&vpl.steps, 0, None);
    let group_voxels = grid.groups.count() * GROUP_EDGE.pow(3);
    p.add_group_areas.dispatch(encoder, &cache, &[&areas, &grid_group], folded(group_voxels.div_ceil(GROUP)));
    if scene.has_directional_lights() {
        let candidates = path_count * CANDIDATES;
        p.look_ahead.dispatch(encoder, &cache, &[&ahead, &grid_group], folded(candidates.div_ceil(GROUP)));
    }
    encoder.clear_buffer(queue, 0, Some(4));
    let heads = u64::from(1 + grid.voxel_count()) * 4;
    encoder.clear_buffer(&vpl.triangle_lists, 0, Some(heads.min(vpl.triangle_lists.size())));
    p.list_triangles.dispatch(encoder, &cache, &[&triangles], folded(scene.chunk_count()));
    p.size_bricks.dispatch(encoder, &cache, &[&bricks], UVec3::ONE);
    p.list_bricks.dispatch_indirect(encoder, &cache, &[&triangles], brick_workgroups);
    p.begin_paths.dispatch(encoder, &cache, &[&alive], groups(path_count));
    for _ in 0..max_bounces {
        p.gather_alive.dispatch(encoder, &cache, &[&alive], groups(path_count));
        p.size_alive.dispatch(encoder, &cache, &[&alive], UVec3::ONE);
        p.trace_paths.dispatch_indirect(encoder, &cache, &[&trace, &grid_group], &vpl.alive_workgroups);
        p.meet_triangles.dispatch_indirect(encoder, &cache, &[&settle], &vpl.alive_workgroups);
        p.set_vertices.dispatch_indirect(encoder, &cache, &[&places, &grid_group], &vpl.alive_workgroups);
    }
    p.scan_paths.dispatch(encoder, &cache, &[&order], UVec3::ONE);
    p.write_pairs.dispatch(encoder, &cache, &[&order], groups(path_count));
    sort.sort(&device, encoder, &cache, &vpl.order, &vpl.vertex_count, key_bits);
    p.scan_weights.dispatch(encoder, &cache, &[&weights], UVec3::ONE);
    let vertices = path_count * (max_bounces + 1);
    p.measure_nodes.dispatch(encoder, &cache, &[&cuts], folded(vertices.div_ceil(NODE_GROUP)));
    p.cut.dispatch(encoder, &cache, &[&cuts], UVec3::ONE);
    p.build_list.dispatch(encoder, &cache, &[&list], groups(capacity));
    p.measure_density.dispatch(encoder, &cache, &[&density, &grid_group], folded(grid.brick_count()));
    span.end(encoder);
}
