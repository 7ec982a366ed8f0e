//! Kernels of the probes and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_storage_3d, uniform_buffer_sized,
};
use bevy::render::render_resource::{PipelineCache, StorageTextureAccess, TextureFormat};
use bevy::shader::ShaderDefVal;

use crate::VplVisibility;
use crate::avg::{grid_layout, sky_layout};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready};
use crate::shadow_atlas::visibility_layouts;

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct ProbePipelines {
    pub place: Kernel,
    light: [Kernel; 3],
    pub sky: Kernel,
    pub fill: Kernel,
}

impl ProbePipelines {
    /// Whether all that light probes by lights of that visibility are compiled, under a sky or not.
    pub fn are_ready(&self, visibility: VplVisibility, cache: &PipelineCache) -> bool {
        are_ready([&self.place, self.light(visibility), &self.sky, &self.fill], cache)
    }

    /// The sum over lights of that visibility.
    pub fn light(&self, visibility: VplVisibility) -> &Kernel {
        let [none, voxel, atlas] = &self.light;
        match visibility {
            VplVisibility::None => none,
            VplVisibility::Voxel => voxel,
            VplVisibility::Ism | VplVisibility::Atlas | VplVisibility::Baked => atlas,
        }
    }
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let output = texture_storage_3d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let kernel = |path, entry, bindings: &[_], groups: &[_], defs: &[ShaderDefVal]| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs: defs.to_vec() })
    };
    // Parameters, places; header, list; light; grid, densities.
    let bindings = [uniform, read, read, read, write, uniform, read];
    let light = |visibility, defs: &[ShaderDefVal]| {
        let groups = visibility_layouts(visibility, false);
        kernel("probes/light.wgsl", "gather_probes", &bindings, &groups, defs)
    };
    commands.insert_resource(ProbePipelines {
        place: kernel("probes/place.wgsl", "place", &[uniform, write], &[grid_layout()], &[]),
        light: [
            light(VplVisibility::None, &[]),
            light(VplVisibility::Voxel, &["VISIBILITY_VOXEL".into()]),
            light(VplVisibility::Atlas, &["VISIBILITY_ATLAS".into()]),
        ],
        // Parameters, places; light.
        sky: kernel("probes/sky.wgsl", "add_sky", &[uniform, read, write], &[sky_layout()], &[]),
        fill: kernel("probes/fill.wgsl", "fill", &[uniform, read, read, output], &[], &[]),
    });
}
