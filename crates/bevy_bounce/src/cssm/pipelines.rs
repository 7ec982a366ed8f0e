//! Kernels of the baked visibility and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutDescriptor, BindGroupLayoutEntryBuilder, PipelineCache, StorageTextureAccess,
    TextureFormat, TextureSampleType,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderDefVal;

use super::prepare::Baked;
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, bind_group, group_layout, whole};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct CssmPipelines {
    pub emit: Kernel,
    pub direct: Kernel,
    pub leaves: Kernel,
    pub pull: Kernel,
    pub pull_top: Kernel,
    one: GatherKernels,
    several: GatherKernels,
}

/// Kernels that gather, for one object or for several.
pub(super) struct GatherKernels {
    pub bounce: Kernel,
    pub pixels: Kernel,
    /// With glossy light.
    pub glossy_pixels: Kernel,
    /// What texels gathered instead.
    pub smooth_pixels: Kernel,
}

impl GatherKernels {
    fn all(&self) -> [&Kernel; 4] {
        [&self.bounce, &self.pixels, &self.glossy_pixels, &self.smooth_pixels]
    }
}

impl CssmPipelines {
    /// Those that gather from that many objects.
    pub fn gather(&self, objects: u32) -> &GatherKernels {
        if objects > 1 { &self.several } else { &self.one }
    }

    /// Whether all are compiled, those that light pixels among them: these may not miss the frame in which texels change.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let texels = [&self.emit, &self.direct, &self.leaves, &self.pull, &self.pull_top];
        let gather = [&self.one, &self.several].into_iter().flat_map(GatherKernels::all);
        are_ready(texels.into_iter().chain(gather), cache)
    }
}

/// Group 1 of what queries visibility: directory and pages of blocks.
pub(crate) fn maps_layout() -> BindGroupLayoutDescriptor {
    let read = storage_buffer_read_only_sized(false, None);
    group_layout("bounce_cssm_maps", &[read, read, read, read])
}

/// Group 0 of kernels over the pixels of a view: texels, bakes; tree, nodes' light, settings; view, surface; light,
/// what is kept of it. With glossy light also the G-buffer, and that light.
fn pixel_bindings(glossy: bool) -> Vec<BindGroupLayoutEntryBuilder> {
    let (uniform, read) = (uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None));
    let surface = texture_2d(TextureSampleType::Uint);
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let kept = storage_buffer_sized(false, None);
    let mut bindings = vec![read, uniform, read, read, uniform, uniform, surface, output, kept];
    bindings.extend(glossy.then_some([surface, output]).into_iter().flatten());
    bindings
}

/// A kernel that binds [`Pixels`](super::Pixels).
pub(crate) fn pixel_kernel(
    path: &'static str,
    entry: &'static str,
    defs: &[&str],
    glossy: bool,
    shaders: &GiShaders,
) -> Kernel {
    let defs = defs.iter().copied().chain(glossy.then_some("GLOSSY")).map(ShaderDefVal::from).collect();
    let (bindings, groups) = (&pixel_bindings(glossy), &[maps_layout()]);
    Kernel::new(shaders, KernelDescriptor { path, entry, bindings, groups, defs })
}

/// The bakes' maps as group 1.
pub(crate) fn bind_maps(baked: &Baked, device: &RenderDevice, cache: &PipelineCache) -> BindGroup {
    let [a, b, c] = &baked.pages;
    bind_group(device, cache, &maps_layout(), &[whole(&baked.directory), whole(a), whole(b), whole(c)])
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let kernel_with = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs })
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
    // Texels, bakes; tree, nodes' light, settings; view, surface; light; irradiance.
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let surface = texture_2d(TextureSampleType::Uint);
    let smooth = [read, uniform, read, read, uniform, uniform, surface, output, read];
    let gather = |defs: &[&str]| {
        let pixels = |glossy| pixel_kernel("cssm/pixels.wgsl", "pixels", defs, glossy, &shaders);
        let defs = || defs.iter().map(|def| ShaderDefVal::from(*def)).collect();
        GatherKernels {
            bounce: kernel_with("cssm/bounce.wgsl", "bounce", &bounce, &maps, defs()),
            smooth_pixels: kernel_with("cssm/smooth.wgsl", "smooth_pixels", &smooth, &maps, defs()),
            pixels: pixels(false),
            glossy_pixels: pixels(true),
        }
    };
    commands.insert_resource(CssmPipelines {
        emit: kernel("cssm/emit.wgsl", "emit", &emit, &[]),
        direct: kernel("cssm/direct.wgsl", "direct", &direct, &maps),
        leaves: kernel("cssm/hierarchy.wgsl", "leaves", &hierarchy, &[]),
        pull: kernel("cssm/hierarchy.wgsl", "pull", &hierarchy, &[]),
        pull_top: kernel("cssm/hierarchy.wgsl", "pull_top", &hierarchy, &[]),
        one: gather(&[]),
        several: gather(&["SEVERAL"]),
    });
}
