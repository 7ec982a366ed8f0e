//! Beside Bevy's screen-space reflections: what they show is counted once.
//!
//! Where a ray of theirs meets something on the screen, they show the light that radiance caches and the sky would;
//! `compose/reflections.wgsl` takes that share from both, by the same ray, before they run. Where it meets nothing,
//! caches and sky stay. Bevy's pass also adds the environment map, unshadowed; under a sky that bounces, it runs
//! without that.

use bevy::pbr::deferred::SkipDeferredLighting;
use bevy::pbr::{Bluenoise, MeshViewBindGroup, ScreenSpaceReflectionsPipelineId};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{sampler, texture_2d, texture_2d_array};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BlendComponent, BlendFactor, BlendOperation,
    BlendState, CachedPipelineState, CachedRenderPipelineId, FilterMode, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, RenderPassDescriptor, Sampler, SamplerBindingType, SamplerDescriptor, ShaderStages,
    StoreOp, TextureSampleType, TextureViewDescriptor, TextureViewDimension,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::shader::ShaderDefVal;

use super::passes::draw;
use super::pipelines::{EnvironmentMaps, ViewPipelines};
use crate::view::ViewTextures;

/// A target times 1 - alpha.
pub(super) const TAKE: BlendState = BlendState {
    color: BlendComponent {
        src_factor: BlendFactor::Zero,
        dst_factor: BlendFactor::OneMinusSrcAlpha,
        operation: BlendOperation::Add,
    },
    alpha: BlendComponent {
        src_factor: BlendFactor::Zero,
        dst_factor: BlendFactor::One,
        operation: BlendOperation::Add,
    },
};

/// Group 2 of the pass, as `bevy_pbr/src/ssr/mod.rs` has it.
#[derive(Resource)]
pub(super) struct ReflectionBindings {
    /// Colour, which is not used, and its sampler; samplers of the depth; blue noise.
    pub layout: BindGroupLayoutDescriptor,
    linear: Sampler,
    nearest: Sampler,
}

impl ReflectionBindings {
    pub fn new(device: &RenderDevice) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bounce_reflections_layout",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::FRAGMENT,
                (
                    texture_2d(TextureSampleType::Float { filterable: true }),
                    sampler(SamplerBindingType::Filtering),
                    sampler(SamplerBindingType::Filtering),
                    sampler(SamplerBindingType::NonFiltering),
                    texture_2d_array(TextureSampleType::Float { filterable: false }),
                ),
            ),
        );
        let sampler =
            |filter| device.create_sampler(&SamplerDescriptor { mag_filter: filter, min_filter: filter, ..default() });
        Self { layout, linear: sampler(FilterMode::Linear), nearest: sampler(FilterMode::Nearest) }
    }
}

/// Takes from glossy light and from the mirrored sky what screen-space reflections are about to show.
pub(super) fn reflections_pass(
    view: ViewQuery<
        (&ViewTextures, &ViewPipelines, &MeshViewBindGroup, &ScreenSpaceReflectionsPipelineId),
        With<SkipDeferredLighting>,
    >,
    bindings: Res<ReflectionBindings>,
    cache: Res<PipelineCache>,
    noise: Res<Bluenoise>,
    images: Res<RenderAssets<GpuImage>>,
    mut ctx: RenderContext,
) {
    let (textures, pipelines, view_bindings, theirs) = view.into_inner();
    let ours = pipelines.reflections.and_then(|id| cache.get_render_pipeline(id));
    let Some((pipeline, _)) = ours.zip(cache.get_render_pipeline(**theirs)) else { return };
    let Some(noise) = images.get(&noise.texture) else { return };
    let noise = noise
        .texture
        .create_view(&TextureViewDescriptor { dimension: Some(TextureViewDimension::D2Array), ..default() });
    let group = ctx.render_device().create_bind_group(
        "bounce_reflections",
        &cache.get_bind_group_layout(&bindings.layout),
        &BindGroupEntries::sequential((
            &textures.direct,
            &bindings.linear,
            &bindings.linear,
            &bindings.nearest,
            &noise,
        )),
    );
    let kept = Operations { load: LoadOp::Load, store: StoreOp::Store };
    let attachments: Vec<_> = textures
        .reflected()
        .map(|view| Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops: kept }))
        .collect();
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/reflections");
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_reflections"),
            color_attachments: &attachments,
            ..default()
        });
        draw(&mut pass, pipeline, view_bindings, &group);
    }
    span.end(ctx.command_encoder());
}

/// Bevy's pipelines of screen-space reflections, and what they are without environment maps.
#[derive(Resource, Default)]
pub(super) struct WithoutEnvironmentMaps(HashMap<CachedRenderPipelineId, CachedRenderPipelineId>);

impl WithoutEnvironmentMaps {
    /// What one of Bevy's that is compiled is without: itself, if it has none.
    fn get(&mut self, theirs: CachedRenderPipelineId, cache: &PipelineCache) -> CachedRenderPipelineId {
        *self.0.entry(theirs).or_insert_with(|| {
            let mut descriptor = cache.get_render_pipeline_descriptor(theirs).clone();
            let Some(fragment) = &mut descriptor.fragment else { return theirs };
            let all = fragment.shader_defs.len();
            fragment.shader_defs.retain(|def| *def != ShaderDefVal::from("ENVIRONMENT_MAP"));
            if fragment.shader_defs.len() == all { theirs } else { cache.queue_render_pipeline(descriptor) }
        })
    }
}

/// Under a sky that bounces, screen-space reflections leave environment maps to us. While that pipeline is compiled there are none; it is
/// queued before a sky bounces, so that one may come and go from one frame to the next.
pub(super) fn take_environment_maps_from_reflections(
    mut commands: Commands,
    mut known: ResMut<WithoutEnvironmentMaps>,
    cache: Res<PipelineCache>,
    mut views: Query<(Entity, &EnvironmentMaps, &mut ScreenSpaceReflectionsPipelineId)>,
) {
    let is_ready = |id| matches!(cache.get_render_pipeline_state(id), CachedPipelineState::Ok(_));
    for (entity, environment_maps, mut pipeline) in &mut views {
        let without = is_ready(**pipeline).then(|| known.get(**pipeline, &cache));
        if *environment_maps == EnvironmentMaps::Kept {
            continue;
        }
        match without.filter(|id| is_ready(*id)) {
            Some(without) => **pipeline = without,
            // Bevy inserts it anew in each frame.
            None => _ = commands.entity(entity).remove::<ScreenSpaceReflectionsPipelineId>(),
        }
    }
}
