//! Surfaces with a lightmap keep its light, and get no bounced light on top of it.
//!
//! Bevy's G-buffer carries the light of a [`Lightmap`] as emission, and does not say so. So the meshes that have one are drawn once
//! more, over the alpha of direct light (`compose/lightmapped.wgsl`): what composes the picture leaves diffuse bounced light out
//! there, and what bias compensation sends from there has none. What is mirrored stays, for a lightmap has only what is diffuse.
//!
//! Instances: 48 bytes each, the rows of `world_from_local`, a vertex buffer that steps by instance. One draw a mesh
//! and view, of what Bevy found visible there. On the processor each mesh with a lightmap is read in each frame, and
//! those in view are sorted; nothing is done where no mesh has one.
//!
//! A mesh is drawn as it is in its asset and at its own depth. Not marked are skinned and morphed ones that left their
//! rest pose, those that a vertex shader moves, those whose material has a `depth_bias`, and for the frames until its
//! pipeline is compiled the first mesh of a vertex layout: these have bounced light on top.

use std::ops::Range;

use bevy::asset::AssetId;
use bevy::ecs::system::SystemParam;
use bevy::mesh::{MeshVertexBufferLayoutRef, VertexBufferLayout, VertexFormat};
use bevy::pbr::deferred::SkipDeferredLighting;
use bevy::pbr::{Lightmap, MeshPipelineKey};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::mesh::allocator::MeshAllocator;
use bevy::render::mesh::{RenderMesh, RenderMeshBufferInfo};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_phase::TrackedRenderPass;
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutDescriptor, BindGroupLayoutEntries, BufferUsages, CachedRenderPipelineId,
    ColorTargetState, ColorWrites, FragmentState, LoadOp, Operations, PipelineCache, PrimitiveState, RawBufferVec,
    RenderPassColorAttachment, RenderPassDescriptor, RenderPipelineDescriptor, ShaderStages, SpecializedMeshPipeline,
    SpecializedMeshPipelineError, SpecializedMeshPipelines, StoreOp, TextureFormat, TextureSampleType, VertexState,
    VertexStepMode,
};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::{MainEntity, MainEntityHashMap};
use bevy::render::view::{
    RenderVisibleEntities, RenderVisibleEntitiesClass, ViewUniform, ViewUniformOffset, ViewUniforms,
};
use bevy::shader::Shader;

use super::pipelines::ViewPipelines;
use crate::compute::GiShaders;
use crate::view::{GiView, ViewTextures, view_binding};

/// Rows of an affine `world_from_local`.
type Instance = [Vec4; 3];

/// The meshes with a lightmap.
#[derive(Resource, Default)]
pub(super) struct Lightmapped(MainEntityHashMap<(AssetId<Mesh>, Instance)>);

/// Those that a view sees.
#[derive(Component)]
pub(crate) struct LightmappedInView {
    instances: RawBufferVec<Instance>,
    draws: Vec<MeshDraw>,
    seen: Vec<(AssetId<Mesh>, Instance)>,
}

/// Instances of one mesh.
struct MeshDraw {
    mesh: AssetId<Mesh>,
    pipeline: CachedRenderPipelineId,
    instances: Range<u32>,
}

impl Default for LightmappedInView {
    fn default() -> Self {
        let mut instances = RawBufferVec::new(BufferUsages::VERTEX);
        instances.set_label(Some("bounce_lightmapped"));
        Self { instances, draws: Vec::new(), seen: Vec::new() }
    }
}

impl LightmappedInView {
    /// Name and size of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 1] {
        [("view: lightmapped meshes", (self.instances.capacity() * size_of::<Instance>()) as u64)]
    }
}

/// Finds the meshes with a lightmap.
pub(super) fn extract_lightmapped(
    mut lightmapped: ResMut<Lightmapped>,
    meshes: Extract<Query<(Entity, &Mesh3d, &GlobalTransform), With<Lightmap>>>,
) {
    lightmapped.0.clear();
    lightmapped.0.extend(meshes.iter().map(|(entity, mesh, transform)| {
        let rows = transform.to_matrix().transpose();
        (MainEntity::from(entity), (mesh.id(), [rows.x_axis, rows.y_axis, rows.z_axis]))
    }));
}

/// Layout and shader of the pass.
#[derive(Resource)]
pub(super) struct LightmappedPipeline {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
}

pub(super) fn init_lightmapped_pipeline(mut commands: Commands, shaders: Res<GiShaders>) {
    let entries = BindGroupLayoutEntries::sequential(
        ShaderStages::VERTEX_FRAGMENT,
        (
            uniform_buffer::<ViewUniform>(false).visibility(ShaderStages::VERTEX),
            texture_2d(TextureSampleType::Uint).visibility(ShaderStages::FRAGMENT),
        ),
    );
    commands.insert_resource(LightmappedPipeline {
        layout: BindGroupLayoutDescriptor::new("bounce_lightmapped_layout", &entries),
        shader: shaders.get("compose/lightmapped.wgsl"),
    });
}

impl SpecializedMeshPipeline for LightmappedPipeline {
    /// Of which only the topology and the format of a strip's indices count.
    type Key = MeshPipelineKey;

    fn specialize(
        &self,
        key: Self::Key,
        layout: &MeshVertexBufferLayoutRef,
    ) -> Result<RenderPipelineDescriptor, SpecializedMeshPipelineError> {
        let vertices = layout.0.get_layout(&[Mesh::ATTRIBUTE_POSITION.at_shader_location(0)])?;
        let rows = [VertexFormat::Float32x4; 3];
        let instances = VertexBufferLayout::from_vertex_formats(VertexStepMode::Instance, rows).offset_locations_by(1);
        let target =
            ColorTargetState { format: TextureFormat::Rgba16Float, blend: None, write_mask: ColorWrites::ALPHA };
        Ok(RenderPipelineDescriptor {
            label: Some("bounce_lightmapped".into()),
            layout: vec![self.layout.clone()],
            vertex: VertexState {
                shader: self.shader.clone(),
                shader_defs: vec![],
                entry_point: Some("vertex".into()),
                buffers: vec![vertices, instances],
            },
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: vec![],
                entry_point: Some("mark".into()),
                targets: vec![Some(target.clone()), Some(target)],
            }),
            primitive: PrimitiveState {
                topology: key.primitive_topology(),
                strip_index_format: key.strip_index_format(),
                ..default()
            },
            ..default()
        })
    }
}

/// What a mesh is drawn with.
#[derive(SystemParam)]
pub(super) struct MeshPipelines<'w> {
    pipeline: Res<'w, LightmappedPipeline>,
    specialized: ResMut<'w, SpecializedMeshPipelines<LightmappedPipeline>>,
    cache: Res<'w, PipelineCache>,
    meshes: Res<'w, RenderAssets<RenderMesh>>,
}

impl MeshPipelines<'_> {
    /// `None` while the mesh is not on the GPU, and where it has no positions.
    fn of(&mut self, mesh: AssetId<Mesh>) -> Option<CachedRenderPipelineId> {
        let mesh = self.meshes.get(mesh)?;
        let key = MeshPipelineKey::from_bits_retain(mesh.key_bits.bits());
        self.specialized.specialize(&self.cache, &self.pipeline, key, &mesh.layout).ok()
    }
}

impl LightmappedInView {
    /// Lists what of the meshes with a lightmap is visible, mesh by mesh.
    fn list(&mut self, visible: &RenderVisibleEntitiesClass, lightmapped: &Lightmapped, pipelines: &mut MeshPipelines) {
        let by_gpu = visible.entities_gpu_culling.keys();
        let visible = visible.entities_cpu_culling.iter().map(|(_, entity)| entity).chain(by_gpu);
        self.seen.clear();
        self.seen.extend(visible.filter_map(|entity| lightmapped.0.get(entity)));
        self.seen.sort_unstable_by_key(|(mesh, _)| *mesh);
        self.instances.clear();
        self.draws.clear();
        for of_mesh in self.seen.chunk_by(|(a, _), (b, _)| a == b) {
            let Some((mesh, pipeline)) = of_mesh.first().and_then(|(mesh, _)| Some((*mesh, pipelines.of(*mesh)?)))
            else {
                continue;
            };
            let first = self.instances.len() as u32;
            for (_, instance) in of_mesh {
                self.instances.push(*instance);
            }
            self.draws.push(MeshDraw { mesh, pipeline, instances: first..self.instances.len() as u32 });
        }
    }
}

/// Lists for each view what it sees.
pub(super) fn prepare_lightmapped(
    mut commands: Commands,
    lightmapped: Res<Lightmapped>,
    mut pipelines: MeshPipelines,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<
        (Entity, Option<&RenderVisibleEntities>, Has<GiView>, Option<&mut LightmappedInView>),
        Or<(With<GiView>, With<LightmappedInView>)>,
    >,
) {
    for (entity, visible, has_light, listed) in &mut views {
        let visible = visible.filter(|_| has_light && !lightmapped.0.is_empty()).and_then(|all| all.get::<Mesh3d>());
        match (visible, listed) {
            (None, None) => {}
            (None, Some(_)) => _ = commands.entity(entity).remove::<LightmappedInView>(),
            (Some(visible), Some(mut listed)) => {
                listed.list(visible, &lightmapped, &mut pipelines);
                listed.instances.write_buffer(&device, &queue);
            }
            (Some(visible), None) => {
                let mut listed = LightmappedInView::default();
                listed.list(visible, &lightmapped, &mut pipelines);
                listed.instances.write_buffer(&device, &queue);
                commands.entity(entity).insert(listed);
            }
        }
    }
}

/// Marks what a view sees of them.
pub(super) fn lightmapped_pass(
    view: ViewQuery<
        (&ViewTextures, &LightmappedInView, &ViewUniformOffset),
        (With<ViewPipelines>, With<SkipDeferredLighting>),
    >,
    pipeline: Res<LightmappedPipeline>,
    cache: Res<PipelineCache>,
    meshes: Res<RenderAssets<RenderMesh>>,
    allocator: Res<MeshAllocator>,
    view_uniforms: Res<ViewUniforms>,
    mut ctx: RenderContext,
) {
    let (textures, listed, view_offset) = view.into_inner();
    let Some(view) = view_binding(&view_uniforms, view_offset) else { return };
    let Some(instances) = listed.instances.buffer().filter(|_| !listed.draws.is_empty()) else { return };
    let group = ctx.render_device().create_bind_group(
        "bounce_lightmapped",
        &cache.get_bind_group_layout(&pipeline.layout),
        &BindGroupEntries::sequential((view, &textures.surface)),
    );
    let kept = Operations { load: LoadOp::Load, store: StoreOp::Store };
    let attachments = [&textures.direct, &textures.direct_diffuse]
        .map(|view| Some(RenderPassColorAttachment { view, depth_slice: None, resolve_target: None, ops: kept }));
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/lightmapped");
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_lightmapped"),
            color_attachments: &attachments,
            ..default()
        });
        pass.set_bind_group(0, &group, &[]);
        pass.set_vertex_buffer(1, instances.slice(..));
        for draw in &listed.draws {
            let Some(pipeline) = cache.get_render_pipeline(draw.pipeline) else { continue };
            pass.set_render_pipeline(pipeline);
            draw_mesh(&mut pass, draw, &meshes, &allocator);
        }
    }
    span.end(ctx.command_encoder());
}

fn draw_mesh<'a>(
    pass: &mut TrackedRenderPass<'a>,
    draw: &MeshDraw,
    meshes: &RenderAssets<RenderMesh>,
    allocator: &'a MeshAllocator,
) {
    let Some((mesh, vertices)) = meshes.get(draw.mesh).zip(allocator.mesh_vertex_slice(&draw.mesh)) else { return };
    pass.set_vertex_buffer(0, vertices.buffer.slice(..));
    let first = vertices.range.start;
    match mesh.buffer_info {
        RenderMeshBufferInfo::Indexed { count, index_format } => {
            let Some(indices) = allocator.mesh_index_slice(&draw.mesh) else { return };
            pass.set_index_buffer(indices.buffer.slice(..), index_format);
            let indices = indices.range.start..indices.range.start + count;
            pass.draw_indexed(indices, first as i32, draw.instances.clone());
        }
        RenderMeshBufferInfo::NonIndexed => pass.draw(first..first + mesh.vertex_count, draw.instances.clone()),
    }
}
