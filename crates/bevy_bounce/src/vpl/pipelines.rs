//! Kernels of the path tracer and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer_sized,
};

use crate::avg::grid_layout;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct VplPipelines {
    pub collect_emitters: Kernel,
    pub accumulate_emitters: Kernel,
    pub look_ahead: Kernel,
    pub list_triangles: Kernel,
    pub size_bricks: Kernel,
    pub list_bricks: Kernel,
    pub begin_paths: Kernel,
    pub gather_alive: Kernel,
    pub size_alive: Kernel,
    pub trace_paths: Kernel,
    pub meet_triangles: Kernel,
    pub set_vertices: Kernel,
    pub scan_paths: Kernel,
    pub write_pairs: Kernel,
    pub scan_weights: Kernel,
    pub measure_nodes: Kernel,
    pub cut: Kernel,
    pub build_list: Kernel,
    pub add_group_areas: Kernel,
    pub measure_density: Kernel,
}

impl VplPipelines {
    /// Whether all are compiled.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let emitters = [&self.collect_emitters, &self.accumulate_emitters];
        let paths = [&self.look_ahead, &self.begin_paths, &self.trace_paths];
        let places = [&self.gather_alive, &self.size_alive, &self.meet_triangles, &self.set_vertices];
        let triangles = [&self.list_triangles, &self.size_bricks, &self.list_bricks];
        let list =
            [&self.scan_paths, &self.write_pairs, &self.scan_weights, &self.measure_nodes, &self.cut, &self.build_list];
        let densities = [&self.add_group_areas, &self.measure_density];
        are_ready(emitters.into_iter().chain(paths).chain(triangles).chain(places).chain(list).chain(densities), cache)
    }
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let kernel = |path, entry, bindings: &[_], groups: &[_]| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs: vec![] })
    };
    // Geometry, instances, materials, thumbnails; emissive chunks, emitters, scene.
    let emitters = [read, read, read, read, read, write, uniform];
    // Parameters, scene; lights, emitters; bricks, candidates; vertices, paths.
    let trace = [uniform, uniform, read, read, write, write, write, write];
    // Parameters, grid; vertices; paths, vertex count, pairs.
    let order = [uniform, uniform, read, write, write, write];
    // Vertices, vertex count, pairs; starts.
    let weights = [read, read, read, write];
    // Parameters, grid; vertex count, pairs, starts; counters; nodes, steps, first vertices, header.
    let cuts = [uniform, uniform, read, read, read, read, write, write, write, write];
    // Parameters, grid; vertices, pairs, first vertices, header; list, bricks; places in the list; compact list.
    let list = [uniform, uniform, read, read, read, read, write, write, read, write];
    // Geometry, instances, materials, thumbnails; grid, scene; chunks, queue, lists.
    let triangles = [read, read, read, read, uniform, uniform, read, write, write];
    // Queue; workgroups that take it.
    let queue = [read, write];
    // Parameters; paths, how many go on, workgroups that take them.
    let alive = [uniform, write, write, write];
    // Geometry, instances, materials, thumbnails; parameters, grid; chunks, lists; vertices, paths.
    let settle = [read, read, read, read, uniform, uniform, read, read, write, write];
    // Parameters; paths, vertices.
    let places = [uniform, write, write];
    // Bricks, counters.
    let areas = [write, write];
    // Parameters; bricks; densities.
    let density = [uniform, read, write];
    commands.insert_resource(VplPipelines {
        collect_emitters: kernel("vpl/emitters.wgsl", "collect", &emitters, &[]),
        accumulate_emitters: kernel("vpl/emitters.wgsl", "accumulate", &emitters, &[]),
        look_ahead: kernel("vpl/look_ahead.wgsl", "look_ahead", &trace[..6], &[grid_layout()]),
        list_triangles: kernel("vpl/fill_lists.wgsl", "list_triangles", &triangles, &[]),
        size_bricks: kernel("avg/bricks.wgsl", "size_bricks", &queue, &[]),
        list_bricks: kernel("vpl/fill_lists.wgsl", "list_bricks", &triangles, &[]),
        begin_paths: kernel("vpl/alive.wgsl", "begin_paths", &alive, &[]),
        gather_alive: kernel("vpl/alive.wgsl", "gather_alive", &alive, &[]),
        size_alive: kernel("vpl/alive.wgsl", "size_alive", &alive, &[]),
        trace_paths: kernel("vpl/trace.wgsl", "trace_paths", &trace, &[grid_layout()]),
        meet_triangles: kernel("vpl/settle.wgsl", "meet_triangles", &settle, &[]),
        set_vertices: kernel("vpl/places.wgsl", "set_vertices", &places, &[grid_layout()]),
        scan_paths: kernel("vpl/order.wgsl", "scan_paths", &order, &[]),
        write_pairs: kernel("vpl/order.wgsl", "write_pairs", &order, &[]),
        scan_weights: kernel("vpl/weights.wgsl", "scan_weights", &weights, &[]),
        measure_nodes: kernel("vpl/cuts.wgsl", "measure_nodes", &cuts, &[]),
        cut: kernel("vpl/cuts.wgsl", "cut", &cuts, &[]),
        build_list: kernel("vpl/list.wgsl", "build_list", &list, &[]),
        add_group_areas: kernel("vpl/group_areas.wgsl", "add_group_areas", &areas, &[grid_layout()]),
        measure_density: kernel("vpl/density.wgsl", "measure_density", &density, &[grid_layout()]),
    });
}
