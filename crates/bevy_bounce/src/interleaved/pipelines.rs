//! Kernels of the interleaved shading and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{PipelineCache, StorageTextureAccess, TextureFormat, TextureSampleType};

use crate::VplVisibility;
use crate::avg::grid_layout;
use crate::compute::{GiShaders, Kernel, KernelDescriptor};
use crate::shadow_atlas::atlas_layout;

/// Kernels of the interleaved shading.
#[derive(Resource)]
pub(super) struct InterleavedPipelines {
    shade_none: Kernel,
    shade_voxel: Kernel,
    shade_atlas: Kernel,
    pub filter: Kernel,
}

impl InterleavedPipelines {
    /// The shading kernel of that visibility.
    pub fn shade(&self, visibility: VplVisibility) -> &Kernel {
        match visibility {
            VplVisibility::None => &self.shade_none,
            VplVisibility::Voxel => &self.shade_voxel,
            VplVisibility::Ism | VplVisibility::Atlas => &self.shade_atlas,
        }
    }
}

pub(super) fn init_pipelines(mut commands: Commands, cache: Res<PipelineCache>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let surface = texture_2d(TextureSampleType::Uint);
    let light = texture_2d(TextureSampleType::Float { filterable: false });
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let kernel = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&cache, &shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    // View; surface; header, list; light; grid, densities.
    let shade = [uniform, surface, read, read, output, uniform, read];
    // View; surface, light of the subsets; light.
    let filter = [uniform, surface, light, output];
    let voxel = vec!["VISIBILITY_VOXEL".into()];
    let atlas = vec!["VISIBILITY_ATLAS".into()];
    commands.insert_resource(InterleavedPipelines {
        shade_none: kernel("interleaved/shade.wgsl", "shade", &shade, &[], vec![]),
        shade_voxel: kernel("interleaved/shade.wgsl", "shade", &shade, &[grid_layout()], voxel),
        shade_atlas: kernel("interleaved/shade.wgsl", "shade", &shade, &[atlas_layout()], atlas),
        filter: kernel("interleaved/filter.wgsl", "filter_joined", &filter, &[], vec![]),
    });
}
