//! A run of the voxeliser over triangles: small ones by a thread each, bricks of large ones by a workgroup each.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{storage_buffer_read_only_sized, storage_buffer_sized};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutEntryBuilder, BindingResource, CommandEncoder, PipelineCache,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderDefVal;

use super::grid::Workspace;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, whole};

/// The kernels of a run.
pub(crate) struct TriangleRun {
    triangles: Kernel,
    size_bricks: Kernel,
    bricks: Kernel,
}

/// What they are bound to.
pub(crate) struct TriangleGroups {
    triangles: BindGroup,
    queue: BindGroup,
}

impl TriangleRun {
    /// Describes the pipelines; what the run does follows from the definitions. See `avg/voxelize.wgsl`.
    pub fn new(shaders: &GiShaders, bindings: &[BindGroupLayoutEntryBuilder], defs: &[ShaderDefVal]) -> Self {
        let voxelize = |entry| {
            let defs = defs.to_vec();
            Kernel::new(shaders, KernelDescriptor { path: "avg/voxelize.wgsl", entry, bindings, groups: &[], defs })
        };
        let queue = [storage_buffer_read_only_sized(false, None), storage_buffer_sized(false, None)];
        let size_bricks = KernelDescriptor {
            path: "avg/bricks.wgsl",
            entry: "size_bricks",
            bindings: &queue,
            groups: &[],
            defs: vec![],
        };
        Self {
            triangles: voxelize("triangles"),
            size_bricks: Kernel::new(shaders, size_bricks),
            bricks: voxelize("bricks"),
        }
    }

    /// In the order they run.
    pub fn kernels(&self) -> [&Kernel; 3] {
        [&self.triangles, &self.size_bricks, &self.bricks]
    }

    /// Binds what the voxeliser is given, and the queue.
    pub fn bind(
        &self,
        device: &RenderDevice,
        cache: &PipelineCache,
        work: &Workspace,
        resources: &[BindingResource],
    ) -> TriangleGroups {
        let queue = [whole(&work.queue), whole(&work.brick_workgroups)];
        TriangleGroups {
            triangles: self.triangles.bind(device, cache, resources),
            queue: self.size_bricks.bind(device, cache, &queue),
        }
    }

    /// Records the run over so many workgroups of triangles.
    pub fn dispatch(
        &self,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
        work: &Workspace,
        groups: &TriangleGroups,
        chunks: UVec3,
    ) {
        encoder.clear_buffer(&work.queue, 0, Some(4));
        self.triangles.dispatch(encoder, cache, &[&groups.triangles], chunks);
        self.size_bricks.dispatch(encoder, cache, &[&groups.queue], UVec3::ONE);
        self.bricks.dispatch_indirect(encoder, cache, &[&groups.triangles], &work.brick_workgroups);
    }
}
