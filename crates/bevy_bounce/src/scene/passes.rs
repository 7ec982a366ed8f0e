//! The compute passes of the scene: thumbnails of new textures, and deformed vertices.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindingResource, BufferInitDescriptor, BufferUsages, PipelineCache, TextureSampleType,
};
use bevy::render::renderer::RenderContext;
use bevy::render::texture::{FallbackImage, GpuImage};
use bevy_bounce_shaders::types::{THUMBNAIL_SIZE, ThumbnailJob};

use super::deform::DeformJobs;
use super::prepare::SceneBuffers;
use super::thumbnails::{QueuedThumbnail, Thumbnails};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, folded, whole};

/// Kernels of the scene.
#[derive(Resource)]
pub(super) struct ScenePipelines {
    /// One workgroup 64 vertices.
    pub deform: Kernel,
    /// One workgroup a texel of the thumbnail.
    pub thumbnail: Kernel,
}

/// Describes the kernels.
pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let texture = texture_2d(TextureSampleType::Float { filterable: false });
    let kernel = |path, entry, bindings: &[_]| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
    };
    commands.insert_resource(ScenePipelines {
        // Geometry, jobs, chunks, pose.
        deform: kernel("scene/deform.wgsl", "deform", &[write, read, read, read]),
        // Job, colour, thumbnails.
        thumbnail: kernel("scene/thumbnail.wgsl", "average", &[uniform_buffer_sized(false, None), texture, write]),
    });
}

/// Runs what was queued, if anything was.
pub(super) fn scene_pass(
    pipelines: Res<ScenePipelines>,
    deform: Res<DeformJobs>,
    thumbnails: Res<Thumbnails>,
    buffers: Res<SceneBuffers>,
    images: Res<RenderAssets<GpuImage>>,
    fallback: Res<FallbackImage>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let chunks = deform.chunks.values().len() as u32;
    if chunks == 0 && thumbnails.queue.is_empty() {
        return;
    }
    let device = ctx.render_device().clone();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/scene");

    for QueuedThumbnail { key, job, .. } in &thumbnails.queue {
        let job = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bounce_thumbnail_job"),
            contents: bytemuck::cast_slice(&job_words(job)),
            usage: BufferUsages::UNIFORM,
        });
        let image = images.get(key.image).unwrap_or(&fallback.d2);
        let color = BindingResource::TextureView(&image.texture_view);
        let group = pipelines.thumbnail.bind(&device, &cache, &[whole(&job), color, whole(&buffers.thumbnails)]);
        pipelines.thumbnail.dispatch(encoder, &cache, &[&group], UVec3::new(THUMBNAIL_SIZE, THUMBNAIL_SIZE, 1));
    }

    if let (Some(jobs), Some(chunk_list), Some(pose)) =
        (deform.jobs.buffer(), deform.chunks.buffer(), deform.pose.buffer())
    {
        let group = pipelines.deform.bind(
            &device,
            &cache,
            &[whole(&buffers.geometry), whole(jobs), whole(chunk_list), whole(pose)],
        );
        pipelines.deform.dispatch(encoder, &cache, &[&group], folded(chunks));
    }
    span.end(encoder);
}

fn job_words(job: &ThumbnailJob) -> [u32; 4] {
    [job.offset, job.cutoff, job.mip_levels, job.padding]
}
