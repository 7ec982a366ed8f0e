//! Kernels of the baked visibility and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, PipelineCache, StorageTextureAccess, TextureFormat, TextureSampleType,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderDefVal;

use super::prepare::Baked;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, bind_group, group_layout, whole};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct CssmPipelines {
    pub emit: Kernel,
    pub direct: Kernel,
    pub leaves: Kernel,
    pub pull: Kernel,
    one: GatherKernels,
    several: GatherKernels,
}

/// Kernels that gather, for one object or for several.
pub(super) struct GatherKernels {
    pub bounce: Kernel,
    pub pixels: Kernel,
    /// With glossy light.
    pub glossy_pixels: Kernel,
}

impl CssmPipelines {
    /// Those that gather from that many objects.
    pub fn gather(&self, objects: u32) -> &GatherKernels {
        if objects > 1 { &self.several } else { &self.one }
    }

    /// Whether all that light the texels of that many objects are compiled.
    pub fn are_ready(&self, objects: u32, cache: &PipelineCache) -> bool {
        let bounce = &self.gather(objects).bounce;
        [&self.emit, &self.direct, &self.leaves, &self.pull, bounce].iter().all(|kernel| kernel.is_ready(cache))
    }
}

/// Group 1 of what queries visibility: directory and pages of blocks.
fn maps_layout() -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    group_layout("bounce_cssm_maps", &[read, read, read, read])
}

/// The bakes' maps as group 1.
pub(super) fn bind_maps(baked: &Baked, device: &RenderDevice, cache: &PipelineCache) -> BindGroup {
    let [a, b, c] = &baked.pages;
    bind_group(device, cache, &maps_layout(), &[whole(&baked.directory), whole(a), whole(b), whole(c)])
}

pub(super) fn init_pipelines(mut commands: Commands, cache: Res<PipelineCache>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let surface = texture_2d(TextureSampleType::Uint);
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let kernel_with = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&cache, &shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    let kernel = |path, entry, bindings: &[_], groups: &[_]| kernel_with(path, entry, bindings, groups, vec![]);
    let maps = [maps_layout()];
    // Geometry, instances, materials, thumbnails; surfaces, parts; light.
    let emit = [read, read, read, read, read, read, write];
    // Texels, bakes; scene, lights, settings; light.
    let direct = [read, uniform, uniform, read, uniform, write];
    // Texels, bakes; tree, nodes' light; light, irradiance, level.
    let hierarchy = [read, uniform, read, write, read, read, uniform];
    // Texels, bakes; tree, nodes' light, settings; irradiance.
    let bounce = [read, uniform, read, read, uniform, write];
    // The same; view, surface; light; G-buffer, glossy light.
    let pixels = [read, uniform, read, read, uniform, uniform, surface, output, surface, output];
    let gather = |defs: &[&str]| {
        let with = |more: &[&str]| defs.iter().chain(more).map(|def| ShaderDefVal::from(*def)).collect();
        GatherKernels {
            bounce: kernel_with("cssm/bounce.wgsl", "bounce", &bounce, &maps, with(&[])),
            pixels: kernel_with("cssm/pixels.wgsl", "pixels", &pixels[..8], &maps, with(&[])),
            glossy_pixels: kernel_with("cssm/pixels.wgsl", "pixels", &pixels, &maps, with(&["GLOSSY"])),
        }
    };
    commands.insert_resource(CssmPipelines {
        emit: kernel("cssm/emit.wgsl", "emit", &emit, &[]),
        direct: kernel("cssm/direct.wgsl", "direct", &direct, &maps),
        leaves: kernel("cssm/hierarchy.wgsl", "leaves", &hierarchy, &[]),
        pull: kernel("cssm/hierarchy.wgsl", "pull", &hierarchy, &[]),
        one: gather(&[]),
        several: gather(&["SEVERAL"]),
    });
}
