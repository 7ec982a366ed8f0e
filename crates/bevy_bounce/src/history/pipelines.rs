//! Kernels of the history and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{texture_2d, texture_storage_2d, uniform_buffer_sized};
use bevy::render::render_resource::{PipelineCache, StorageTextureAccess, TextureFormat, TextureSampleType};

use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct HistoryPipelines {
    pub average: Kernel,
    pub keep: Kernel,
    /// For the last light of a view: keeps what the pixels show, too.
    pub keep_last: Kernel,
}

impl HistoryPipelines {
    /// Whether all are compiled.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        are_ready([&self.average, &self.keep, &self.keep_last], cache)
    }
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let words = texture_2d(TextureSampleType::Uint);
    let floats = texture_2d(TextureSampleType::Float { filterable: false });
    let write = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
    let (light, seen) = (write(TextureFormat::Rgba16Float), write(TextureFormat::R32Uint));
    let kernel = |path, entry, bindings: &[_], defs: &[&str]| {
        let defs = defs.iter().map(|def| (*def).into()).collect();
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs })
    };
    // View, parameters, surface, motion; light and surfaces of the last frame; light, average.
    let average = [uniform, uniform, words, floats, floats, words, floats, light];
    // Average; light, and as it is kept; surface, and as it is kept.
    let keep = [floats, light, light, words, seen];
    commands.insert_resource(HistoryPipelines {
        average: kernel("history/average.wgsl", "average", &average, &[]),
        keep: kernel("history/keep.wgsl", "keep", &keep[..3], &[]),
        keep_last: kernel("history/keep.wgsl", "keep", &keep, &["LAST"]),
    });
}
