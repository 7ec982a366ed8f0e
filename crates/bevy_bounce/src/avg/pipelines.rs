//! Kernels of the voxel grid and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, BindGroupLayoutEntryBuilder, BindingResource, PipelineCache,
};
use bevy::render::renderer::RenderDevice;

use super::grid::VoxelGrid;
use super::triangles::TriangleRun;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, bind_group, group_layout, whole};
use crate::scene::SceneBuffers;

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct AvgPipelines {
    pub mark: TriangleRun,
    pub count_blocks: Kernel,
    pub scan_blocks: Kernel,
    pub assign_cells: Kernel,
    pub add: TriangleRun,
    pub resolve: Kernel,
    pub find_occupied: Kernel,
    pub distance_x: Kernel,
    pub distance_y: Kernel,
    pub distance_z: Kernel,
}

/// Group 1 of every kernel that sends rays: grid, voxels, cells, groups. See `shared/rays.wgsl`.
pub(crate) fn grid_layout() -> BindGroupLayoutDescriptor {
    group_layout(
        "bounce_grid",
        &[
            uniform_buffer_sized(false, None),
            storage_buffer_read_only_sized(false, None),
            storage_buffer_read_only_sized(false, None),
            uniform_buffer_sized(false, None),
        ],
    )
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    // Geometry, instances, materials, thumbnails; grid, scene; chunks, queue; voxels, and sums in the second run.
    let mark = [read, read, read, read, uniform, uniform, read, write, write];
    let add = [read, read, read, read, uniform, uniform, read, write, read, write];
    // Grid; voxels, blocks, counters, sums, cells.
    let cells = |entry| kernel(&shaders, "avg/cells.wgsl", entry, &[uniform, write, write, write, read, write]);
    // Grid; voxels, occupied blocks, distances along x and along x and y.
    let distance = |entry| kernel(&shaders, "avg/distance.wgsl", entry, &[uniform, write, write, write, write]);
    commands.insert_resource(AvgPipelines {
        mark: TriangleRun::new(&shaders, &mark, &[]),
        count_blocks: cells("count_blocks"),
        scan_blocks: cells("scan_blocks"),
        assign_cells: cells("assign_cells"),
        add: TriangleRun::new(&shaders, &add, &["ACCUMULATE".into()]),
        resolve: cells("resolve"),
        find_occupied: distance("find_occupied"),
        distance_x: distance("pass_x"),
        distance_y: distance("pass_y"),
        distance_z: distance("pass_z"),
    });
}

impl AvgPipelines {
    /// Whether all are compiled.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let kernels = [&self.count_blocks, &self.scan_blocks, &self.assign_cells, &self.resolve];
        let distances = [&self.find_occupied, &self.distance_x, &self.distance_y, &self.distance_z];
        are_ready(kernels.into_iter().chain(distances).chain(self.mark.kernels()).chain(self.add.kernels()), cache)
    }
}

fn kernel(
    shaders: &GiShaders,
    path: &'static str,
    entry: &'static str,
    bindings: &[BindGroupLayoutEntryBuilder],
) -> Kernel {
    Kernel::new(shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
}

/// The same with the scene and its lights, of kernels that look at the sky. See `interleaved/sky.wgsl`.
pub(crate) fn sky_layout() -> BindGroupLayoutDescriptor {
    let (uniform, read) = (uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None));
    group_layout("bounce_grid_and_sky", &[uniform, read, read, uniform, uniform, read])
}

/// The grid and the sky as group 1.
pub(crate) fn bind_sky(
    grid: &VoxelGrid,
    scene: &SceneBuffers,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> Option<BindGroup> {
    let [grid, voxels, cells, groups] = rays(grid)?;
    let resources = [grid, voxels, cells, groups, scene.uniform()?, whole(&scene.lights)];
    Some(bind_group(device, cache, &sky_layout(), &resources))
}

/// The grid as group 1 of a kernel that sends rays.
pub(crate) fn bind_grid(grid: &VoxelGrid, device: &RenderDevice, cache: &PipelineCache) -> Option<BindGroup> {
    Some(bind_group(device, cache, &grid_layout(), &rays(grid)?))
}

fn rays(grid: &VoxelGrid) -> Option<[BindingResource<'_>; 4]> {
    Some([grid.uniform.binding()?, whole(&grid.voxels), whole(&grid.cells), grid.groups.uniform.binding()?])
}
