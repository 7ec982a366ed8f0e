//! Kernels of the shadow atlas and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer_sized,
};
use bevy::render::render_resource::{BindGroup, BindGroupLayoutDescriptor, PipelineCache};
use bevy::render::renderer::RenderDevice;

use super::prepare::ShadowAtlas;
use crate::VplVisibility;
use crate::avg::{VoxelGrid, bind_grid};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, bind_group, group_layout, whole};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct AtlasPipelines {
    pub place_occluders: Kernel,
    pub rasterize: Kernel,
    pub place_points: Kernel,
    pub splat_points: Kernel,
}

/// Group 1 of what looks depths up: parameters, atlas. See `shadow_atlas/lookup.wgsl`.
pub(crate) fn atlas_layout() -> BindGroupLayoutDescriptor {
    group_layout("bounce_atlas", &[uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None)])
}

/// See [`atlas_layout`].
fn bind_atlas(atlas: &ShadowAtlas, device: &RenderDevice, cache: &PipelineCache) -> Option<BindGroup> {
    let resources = [atlas.parameters.binding()?, whole(&atlas.atlas)];
    Some(bind_group(device, cache, &atlas_layout(), &resources))
}

/// What virtual lights see by, of what is asked for and what is there; and group 1 of the kernels that look it up. Without maps
/// they see by rays through the grid.
pub(crate) fn bind_visibility(
    asked: VplVisibility,
    atlas: Option<&ShadowAtlas>,
    grid: &VoxelGrid,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> Option<(VplVisibility, Option<BindGroup>)> {
    match (asked, atlas.and_then(|atlas| bind_atlas(atlas, device, cache))) {
        (VplVisibility::None, _) => Some((VplVisibility::None, None)),
        (VplVisibility::Ism | VplVisibility::Atlas, Some(group)) => Some((VplVisibility::Atlas, Some(group))),
        _ => Some((VplVisibility::Voxel, Some(bind_grid(grid, device, cache)?))),
    }
}

pub(super) fn init_pipelines(mut commands: Commands, cache: Res<PipelineCache>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let kernel = |path, entry, bindings: &[_]| {
        Kernel::new(&cache, &shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
    };
    // Geometry, instances, materials, thumbnails, chunks or points; occluders.
    let place = [read, read, read, read, read, write];
    // Parameters, grid; header, occluders; lights, atlas.
    let draw = [uniform, uniform, read, read, read, write];
    commands.insert_resource(AtlasPipelines {
        place_occluders: kernel("shadow_atlas/occluders.wgsl", "place_occluders", &place),
        rasterize: kernel("shadow_atlas/rasterize.wgsl", "rasterize", &draw),
        place_points: kernel("shadow_atlas/points.wgsl", "place_points", &place),
        splat_points: kernel("shadow_atlas/splat.wgsl", "splat_points", &draw),
    });
}
