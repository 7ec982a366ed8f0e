//! Kernels of the bias compensation and their bindings.

use bevy::core_pipeline::FullscreenShader;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupLayoutDescriptor, BlendComponent, BlendFactor, BlendOperation, BlendState, CachedRenderPipelineId,
    ColorTargetState, ColorWrites, FragmentState, PipelineCache, RenderPipelineDescriptor, ShaderStages,
    StorageTextureAccess, TextureFormat, TextureSampleType,
};

use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready};

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct SsbcPipelines {
    /// Without a residual, then with one.
    pub radiance: [Kernel; 2],
    /// From the pixels, then from the level in the middle.
    pub reduce: [Kernel; 2],
    pub gather: Kernel,
    pub spread: Kernel,
    pub blur_rows: Kernel,
    /// Over the texels of the pixel's surface; then over those that bounded light came from.
    pub blur_columns: [Kernel; 2],
    pub repair: Kernel,
    /// Adds the residual to its target.
    pub apply: CachedRenderPipelineId,
    /// Group 0 of `apply`.
    pub apply_layout: BindGroupLayoutDescriptor,
}

impl SsbcPipelines {
    /// Whether all are compiled that a view needs.
    pub fn are_ready(&self, same_texels: bool, cache: &PipelineCache) -> bool {
        let blur_columns = &self.blur_columns[usize::from(same_texels)];
        let others = [&self.gather, &self.spread, &self.blur_rows, blur_columns, &self.repair];
        let kernels = self.radiance.iter().chain(&self.reduce).chain(others);
        are_ready(kernels, cache) && cache.get_render_pipeline(self.apply).is_some()
    }
}

pub(super) fn init_pipelines(
    mut commands: Commands,
    cache: Res<PipelineCache>,
    shaders: Res<GiShaders>,
    fullscreen: Res<FullscreenShader>,
) {
    let uniform = uniform_buffer_sized(false, None);
    let (list, growing_list) = (storage_buffer_read_only_sized(false, None), storage_buffer_sized(false, None));
    let words = texture_2d(TextureSampleType::Uint);
    let light = texture_2d(TextureSampleType::Float { filterable: false });
    let write = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
    let (node, residual) = (write(TextureFormat::Rgba32Uint), write(TextureFormat::Rgba16Float));
    let kernel = |path, entry, bindings: &[_], defs: &[&str]| {
        let defs = defs.iter().map(|def| (*def).into()).collect();
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs })
    };
    // View, parameters, surface, residual; G-buffer, direct diffuse, bounced light; lowest level.
    let radiance = [uniform, uniform, words, light, words, light, light, node];
    // View, parameters, surface, level below; three levels.
    let reduce = [uniform, uniform, words, words, node, node, node];
    // View, parameters, surface, residual; header, grid, densities, levels.
    let gather = [uniform, uniform, words, residual, list, uniform, list, words];
    // The same; pixels to repair.
    let repair = [uniform, uniform, words, residual, list, uniform, list, words, list];
    // View, parameters, surface, residual; at every pixel, pixels to repair.
    let spread = [uniform, uniform, words, light, residual, growing_list];
    // View, parameters, surface, residual; means along rows.
    let blur_rows = [uniform, uniform, words, light, residual];
    // View, parameters, surface, means along rows; means, pixels to repair; bounced light.
    let blur_columns = [uniform, uniform, words, light, residual, growing_list, light];

    let apply_layout = BindGroupLayoutDescriptor::new("bounce_ssbc_apply", &[light.build(0, ShaderStages::FRAGMENT)]);
    let apply = cache.queue_render_pipeline(apply_pipeline(&apply_layout, &shaders, &fullscreen));
    commands.insert_resource(SsbcPipelines {
        radiance: [
            kernel("ssbc/radiance.wgsl", "radiance", &radiance, &[]),
            kernel("ssbc/radiance.wgsl", "radiance", &radiance, &["COMPENSATED"]),
        ],
        reduce: [
            kernel("ssbc/reduce.wgsl", "reduce", &reduce, &["FROM_PIXELS"]),
            kernel("ssbc/reduce.wgsl", "reduce", &reduce, &[]),
        ],
        gather: kernel("ssbc/gather.wgsl", "gather", &gather, &[]),
        spread: kernel("ssbc/spread.wgsl", "spread", &spread, &[]),
        blur_rows: kernel("ssbc/blur.wgsl", "blur_rows", &blur_rows, &[]),
        blur_columns: [
            kernel("ssbc/blur.wgsl", "blur_columns", &blur_columns[..6], &[]),
            kernel("ssbc/blur.wgsl", "blur_columns", &blur_columns, &["SAME_TEXELS"]),
        ],
        repair: kernel("ssbc/repair.wgsl", "repair", &repair, &[]),
        apply,
        apply_layout,
    });
}

/// Adds the residual to bounced light.
fn apply_pipeline(
    layout: &BindGroupLayoutDescriptor,
    shaders: &GiShaders,
    fullscreen: &FullscreenShader,
) -> RenderPipelineDescriptor {
    RenderPipelineDescriptor {
        label: Some("bounce_ssbc_apply".into()),
        layout: vec![layout.clone()],
        vertex: fullscreen.to_vertex_state(),
        fragment: Some(FragmentState {
            shader: shaders.get("ssbc/apply.wgsl"),
            entry_point: Some("apply".into()),
            targets: vec![Some(ColorTargetState {
                format: TextureFormat::Rgba16Float,
                blend: Some(added()),
                write_mask: ColorWrites::ALL,
            })],
            ..default()
        }),
        ..default()
    }
}

/// Light on top of what is there.
fn added() -> BlendState {
    let sum =
        BlendComponent { src_factor: BlendFactor::One, dst_factor: BlendFactor::One, operation: BlendOperation::Add };
    BlendState { color: sum, alpha: sum }
}
