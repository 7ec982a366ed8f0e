//! Kernels of the interleaved shading and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{PipelineCache, StorageTextureAccess, TextureFormat, TextureSampleType};
use bevy::shader::ShaderDefVal;

use crate::avg::grid_layout;
use crate::compute::{GiShaders, Kernel, KernelDescriptor};
use crate::shadow_atlas::atlas_layout;
use crate::{Resolution, VplVisibility};

/// Kernels of the interleaved shading.
#[derive(Resource)]
pub(super) struct InterleavedPipelines {
    full: [Passes; 3],
    half: [Passes; 3],
}

/// What runs in a view.
pub(super) struct Passes {
    pub shade: Kernel,
    pub rows: Kernel,
    pub columns: Kernel,
}

impl InterleavedPipelines {
    /// The kernels of that visibility at that resolution.
    pub fn passes(&self, visibility: VplVisibility, resolution: Resolution) -> &Passes {
        let [none, voxel, atlas] = match resolution {
            Resolution::Full => &self.full,
            Resolution::Half => &self.half,
        };
        match visibility {
            VplVisibility::None => none,
            VplVisibility::Voxel => voxel,
            VplVisibility::Ism | VplVisibility::Atlas => atlas,
        }
    }
}

pub(super) fn init_pipelines(mut commands: Commands, cache: Res<PipelineCache>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let surface = texture_2d(TextureSampleType::Uint);
    let light = texture_2d(TextureSampleType::Float { filterable: false });
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    // View; surface; header, list; result; grid, densities; light so far.
    let shade = [uniform, surface, read, read, output, uniform, read];
    let filter = [uniform, surface, read, read, output, uniform, read, light];
    let passes = |resolution: &[ShaderDefVal], visibility: &[ShaderDefVal], groups: &[_]| {
        let kernel = |path, entry, bindings: &[_]| {
            let defs = [resolution, visibility].concat();
            Kernel::new(&cache, &shaders, KernelDescriptor { path, entry, bindings, groups, defs })
        };
        Passes {
            shade: kernel("interleaved/shade.wgsl", "shade", &shade),
            rows: kernel("interleaved/filter.wgsl", "filter_rows", &filter),
            columns: kernel("interleaved/filter.wgsl", "filter_columns", &filter),
        }
    };
    let at = |resolution: &[ShaderDefVal]| {
        [
            passes(resolution, &[], &[]),
            passes(resolution, &["VISIBILITY_VOXEL".into()], &[grid_layout()]),
            passes(resolution, &["VISIBILITY_ATLAS".into()], &[atlas_layout()]),
        ]
    };
    commands.insert_resource(InterleavedPipelines { full: at(&[]), half: at(&["HALF_RESOLUTION".into()]) });
}
