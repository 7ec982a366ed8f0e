//! Pictures of what lies between the scene and its light, into the view's `indirect`, which has been composed by then.

use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_3d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutEntryBuilder, BindingResource, BufferBinding, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, RenderPassDescriptor, ShaderType, StorageTextureAccess, StoreOp, TextureFormat,
    TextureSampleType, TextureView,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};

use crate::GiIsolate;
use crate::avg::{VoxelGrid, bind_grid, grid_layout};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, folded, whole};
use crate::radiance_cache::{CacheBuffers, VoxelLight};
use crate::shadow_atlas::ShadowAtlas;
use crate::view::{GiView, ViewTextures};
use crate::vpl::VplBuffers;

/// Edge of a workgroup over pixels.
const TILE: u32 = 8;

/// Kernels of the pictures that were asked for.
#[derive(Resource, Default)]
pub(super) struct PictureKernels(HashMap<GiIsolate, Kernel>);

impl PictureKernels {
    fn get(&mut self, isolate: GiIsolate, cache: &PipelineCache, shaders: &GiShaders) -> &Kernel {
        self.0.entry(isolate).or_insert_with(|| kernel(isolate, cache, shaders))
    }
}

fn kernel(isolate: GiIsolate, cache: &PipelineCache, shaders: &GiShaders) -> Kernel {
    let (uniform, read) = (uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None));
    let picture = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let light = texture_3d(TextureSampleType::Float { filterable: false });
    let voxels = |bindings: &[BindGroupLayoutEntryBuilder], defs: &[&'static str]| {
        let defs = defs.iter().map(|def| (*def).into()).collect();
        let groups = &[grid_layout()];
        let (path, entry) = ("debug/voxels.wgsl", "show_voxels");
        Kernel::new(cache, shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    let alone = |path, entry, bindings: &[BindGroupLayoutEntryBuilder]| {
        Kernel::new(cache, shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
    };
    match isolate {
        GiIsolate::VoxelNormal => voxels(&[uniform, picture], &["VOXEL_NORMAL"]),
        GiIsolate::VoxelLight => voxels(&[uniform, picture, uniform, read, light, light, light], &["VOXEL_LIGHT"]),
        GiIsolate::ShadowAtlas => alone("debug/atlas.wgsl", "show_atlas", &[uniform, read, read, picture]),
        GiIsolate::Clusters => {
            alone("debug/clusters.wgsl", "show_clusters", &[uniform, read, read, read, read, picture])
        }
        _ => voxels(&[uniform, picture], &[]),
    }
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}

/// What there is to show in a view; what there is not leaves the picture black.
struct Shown<'a> {
    view: BindingResource<'a>,
    textures: &'a ViewTextures,
    grid: Option<&'a VoxelGrid>,
    light: Option<&'a VoxelLight>,
    atlas: Option<&'a ShadowAtlas>,
    vpl: Option<&'a VplBuffers>,
    caches: Option<&'a CacheBuffers>,
}

impl Shown<'_> {
    /// Bindings of a picture's kernel, group by group, and how many workgroups draw it.
    fn groups(
        &self,
        isolate: GiIsolate,
        kernel: &Kernel,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<(Vec<BindGroup>, UVec3)> {
        let picture = texture(&self.textures.indirect);
        let tiles = self.textures.size.map(|pixels| pixels.div_ceil(TILE)).extend(1);
        let mut bindings = vec![self.view.clone(), picture.clone()];
        match isolate {
            GiIsolate::ShadowAtlas => {
                let (atlas, vpl) = (self.atlas?, self.vpl?);
                bindings = vec![atlas.parameters.binding()?, whole(&vpl.header), whole(&atlas.atlas), picture];
                return Some((vec![kernel.bind(device, cache, &bindings)], tiles));
            }
            GiIsolate::Clusters => {
                let held = self.caches?;
                bindings = vec![
                    held.parameters.binding()?,
                    whole(&held.counters),
                    whole(held.order.sorted(held.key_bits())),
                    whole(&held.starts),
                    whole(&held.caches),
                    picture,
                ];
                let clusters = folded(held.parameters.get().capacity);
                return Some((vec![kernel.bind(device, cache, &bindings)], clusters));
            }
            GiIsolate::VoxelLight => {
                let light = self.light?;
                bindings.extend([light.parameters.binding()?, whole(&light.unit)]);
                bindings.extend(light.light.iter().map(texture));
            }
            _ => {}
        }
        Some((vec![kernel.bind(device, cache, &bindings), bind_grid(self.grid?, device, cache)?], tiles))
    }
}

/// Draws the picture that the view asks for over its bounced light.
pub(super) fn draw_picture(
    view: ViewQuery<(&GiView, &ViewTextures, &ViewUniformOffset, Option<&CacheBuffers>)>,
    mut kernels: ResMut<PictureKernels>,
    shaders: Res<GiShaders>,
    view_uniforms: Res<ViewUniforms>,
    grid: Option<Res<VoxelGrid>>,
    light: Option<Res<VoxelLight>>,
    atlas: Option<Res<ShadowAtlas>>,
    vpl: Option<Res<VplBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset, caches) = view.into_inner();
    let Some(buffer) = view_uniforms.uniforms.buffer().filter(|_| gi.isolate.is_picture()) else { return };
    let kernel = kernels.get(gi.isolate, &cache, &shaders);
    let ops = Operations { load: LoadOp::Clear(LinearRgba::BLACK.into()), store: StoreOp::Store };
    ctx.begin_tracked_render_pass(RenderPassDescriptor {
        label: Some("bounce_clear_picture"),
        color_attachments: &[Some(RenderPassColorAttachment {
            view: &textures.indirect,
            depth_slice: None,
            resolve_target: None,
            ops,
        })],
        ..default()
    });
    let view = BufferBinding { buffer, offset: offset.offset.into(), size: Some(ViewUniform::min_size()) };
    let shown = Shown {
        view: BindingResource::Buffer(view),
        textures,
        grid: grid.as_deref(),
        light: light.as_deref(),
        atlas: atlas.as_deref(),
        vpl: vpl.as_deref(),
        caches,
    };
    let Some((groups, size)) = shown.groups(gi.isolate, kernel, ctx.render_device(), &cache) else { return };
    kernel.dispatch(ctx.command_encoder(), &cache, &groups.iter().collect::<Vec<_>>(), size);
}
