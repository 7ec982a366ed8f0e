//! Shaders, compute kernels and their dispatch: the boilerplate that every pass would repeat.

use std::borrow::Cow;
use std::num::NonZero;
use std::sync::OnceLock;

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{
    BindGroup, BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntryBuilder, BindingResource, Buffer,
    BufferBinding, CachedComputePipelineId, CachedPipelineState, CommandEncoder, ComputePass, ComputePassDescriptor,
    ComputePipelineDescriptor, PipelineCache, ShaderStages,
};
use bevy::render::renderer::RenderDevice;
use bevy::shader::{Shader, ShaderCacheError, ShaderDefVal};
use bevy_bounce_shaders::SHADERS;

pub(crate) use bevy_bounce_shaders::types::MAX_WORKGROUPS;

/// Handles of all our shaders, by path within the shader crate.
#[derive(Resource, Clone)]
pub(crate) struct GiShaders(HashMap<&'static str, Handle<Shader>>);

impl GiShaders {
    /// The handle of that path; the default handle where there is no such shader, so that its pipeline reports an error.
    pub fn get(&self, path: &str) -> Handle<Shader> {
        self.0.get(path).cloned().unwrap_or_default()
    }
}

/// Adds all our shaders to the app, once. Call it from `Plugin::finish`; without a renderer it does nothing.
pub(crate) fn load_shaders(app: &mut App) {
    if app.world().contains_resource::<GiShaders>() {
        return;
    }
    let Some(mut assets) = app.world_mut().get_resource_mut::<Assets<Shader>>() else { return };
    let handles = SHADERS
        .iter()
        .map(|shader| {
            let path = format!("bevy_bounce/{}", shader.path);
            (shader.path, assets.add(Shader::from_wgsl(shader.source, path)))
        })
        .collect();
    let shaders = GiShaders(handles);
    app.insert_resource(shaders.clone());
    if let Some(render_app) = app.get_sub_app_mut(RenderApp) {
        render_app.insert_resource(shaders);
    }
}

/// What a kernel is made from.
pub(crate) struct KernelDescriptor<'a> {
    /// Path within the shader crate.
    pub path: &'static str,
    /// Entry point.
    pub entry: &'static str,
    /// Bindings of group 0, in order.
    pub bindings: &'a [BindGroupLayoutEntryBuilder],
    /// Groups 1 and up.
    pub groups: &'a [BindGroupLayoutDescriptor],
    /// Shader definitions.
    pub defs: Vec<ShaderDefVal>,
}

/// A compute pipeline and the layout of its group 0. The pipeline is queued when the kernel is first asked for: a game
/// compiles what it uses.
pub(crate) struct Kernel {
    name: &'static str,
    descriptor: ComputePipelineDescriptor,
    pipeline: OnceLock<CachedComputePipelineId>,
    layout: BindGroupLayoutDescriptor,
}

impl Kernel {
    /// Describes the pipeline.
    pub fn new(shaders: &GiShaders, kernel: KernelDescriptor) -> Self {
        let layout = group_layout(kernel.entry, kernel.bindings);
        let descriptor = ComputePipelineDescriptor {
            label: Some(Cow::from(format!("bounce/{}:{}", kernel.path, kernel.entry))),
            layout: std::iter::once(layout.clone()).chain(kernel.groups.iter().cloned()).collect(),
            shader: shaders.get(kernel.path),
            shader_defs: kernel.defs,
            entry_point: Some(Cow::from(kernel.entry)),
            zero_initialize_workgroup_memory: true,
            ..default()
        };
        Self { name: kernel.entry, descriptor, pipeline: OnceLock::new(), layout }
    }

    fn pipeline(&self, cache: &PipelineCache) -> CachedComputePipelineId {
        *self.pipeline.get_or_init(|| cache.queue_compute_pipeline(self.descriptor.clone()))
    }

    /// Whether the pipeline is compiled.
    pub fn is_ready(&self, cache: &PipelineCache) -> bool {
        cache.get_compute_pipeline(self.pipeline(cache)).is_some()
    }

    /// Whether the pipeline cannot be compiled.
    pub fn has_failed(&self, cache: &PipelineCache) -> bool {
        has_failed(cache.get_compute_pipeline_state(self.pipeline(cache)))
    }

    /// Group 0, bindings in order.
    pub fn bind(&self, device: &RenderDevice, cache: &PipelineCache, resources: &[BindingResource]) -> BindGroup {
        bind_group(device, cache, &self.layout, resources)
    }

    /// Records one dispatch in a pass of its own, so that it sees what the one before wrote. Nothing happens while the
    /// pipeline is being compiled. One of no workgroups has it compiled, for when there are some.
    pub fn dispatch(&self, encoder: &mut CommandEncoder, cache: &PipelineCache, groups: &[&BindGroup], size: UVec3) {
        if self.is_ready(cache) && size.min_element() > 0 {
            self.pass(encoder, cache, groups, |pass| pass.dispatch_workgroups(size.x, size.y, size.z));
        }
    }

    /// The same with the number of workgroups in a buffer: three words.
    pub fn dispatch_indirect(
        &self,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
        groups: &[&BindGroup],
        size: &Buffer,
    ) {
        self.pass(encoder, cache, groups, |pass| pass.dispatch_workgroups_indirect(size, 0));
    }

    fn pass(
        &self,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
        groups: &[&BindGroup],
        dispatch: impl FnOnce(&mut ComputePass),
    ) {
        let Some(pipeline) = cache.get_compute_pipeline(self.pipeline(cache)) else { return };
        let mut pass =
            encoder.begin_compute_pass(&ComputePassDescriptor { label: Some(self.name), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        for (index, group) in groups.iter().enumerate() {
            pass.set_bind_group(index as u32, *group, &[]);
        }
        dispatch(&mut pass);
    }
}

/// Whether all are compiled; has those compiled that are not, all at once.
pub(crate) fn are_ready<'a>(kernels: impl IntoIterator<Item = &'a Kernel>, cache: &PipelineCache) -> bool {
    kernels.into_iter().filter(|kernel| !kernel.is_ready(cache)).count() == 0
}

/// Whether a pipeline cannot be compiled; one that waits for its shader to be loaded still may.
pub(crate) fn has_failed(state: &CachedPipelineState) -> bool {
    use ShaderCacheError::{ShaderImportNotYetAvailable, ShaderNotLoaded};
    matches!(state, CachedPipelineState::Err(error) if !matches!(error, ShaderNotLoaded(_) | ShaderImportNotYetAvailable))
}

/// A layout whose bindings are numbered in order, for compute.
pub(crate) fn group_layout(name: &'static str, bindings: &[BindGroupLayoutEntryBuilder]) -> BindGroupLayoutDescriptor {
    let entries: Vec<_> = (0u32..).zip(bindings).map(|(i, b)| b.build(i, ShaderStages::COMPUTE)).collect();
    BindGroupLayoutDescriptor::new(name, &entries)
}

/// A bind group whose resources are numbered in order.
pub(crate) fn bind_group(
    device: &RenderDevice,
    cache: &PipelineCache,
    layout: &BindGroupLayoutDescriptor,
    resources: &[BindingResource],
) -> BindGroup {
    let entries: Vec<_> = (0u32..)
        .zip(resources)
        .map(|(binding, resource)| BindGroupEntry { binding, resource: resource.clone() })
        .collect();
    device.create_bind_group(None, &cache.get_bind_group_layout(layout), &entries)
}

/// The whole buffer as a binding.
pub(crate) fn whole(buffer: &Buffer) -> BindingResource<'_> {
    buffer.as_entire_binding()
}

/// So many bytes of it from there, as (start, length).
pub(crate) fn part(buffer: &Buffer, (offset, size): (u64, u64)) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset, size: NonZero::new(size) })
}

/// Workgroups for `count` of them, folded into a second axis where one is too long: the shader's index is
/// `id.x + id.y * MAX_WORKGROUPS`.
pub(crate) fn folded(count: u32) -> UVec3 {
    if count == 0 {
        return UVec3::ZERO;
    }
    UVec3::new(count.min(MAX_WORKGROUPS), count.div_ceil(MAX_WORKGROUPS), 1)
}
