//! Pictures of what lies between the scene and its light, into the view's `indirect`, which has been composed by then.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::system::SystemParam;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_3d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroup, BindGroupLayoutEntryBuilder, BindingResource, LoadOp, Operations, PipelineCache,
    RenderPassColorAttachment, RenderPassDescriptor, StorageTextureAccess, StoreOp, TextureFormat, TextureSampleType,
    TextureView,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use crate::avg::{VoxelGrid, bind_grid, grid_layout};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, folded, whole};
use crate::cssm::{Baked, PixelLight, Pixels, pixel_kernel};
use crate::radiance_cache::{CacheBuffers, VoxelLight};
use crate::shadow_atlas::ShadowAtlas;
use crate::view::{GiView, ViewTextures, view_binding};
use crate::vpl::VplBuffers;
use crate::{GiIsolate, Technique};

/// Edge of a workgroup over pixels.
const TILE: u32 = 8;

/// Threads of a workgroup over texels.
const GROUP: u32 = 64;

/// Kernels of the pictures that were asked for, and of those with glossy light.
#[derive(Resource, Default)]
pub(super) struct PictureKernels(HashMap<(GiIsolate, bool), Kernel>);

/// A new device knows none of them.
pub(super) fn forget_kernels(mut commands: Commands) {
    commands.insert_resource(PictureKernels::default());
}

impl PictureKernels {
    fn get(&mut self, isolate: GiIsolate, glossy: bool, shaders: &GiShaders) -> &Kernel {
        self.0.entry((isolate, glossy)).or_insert_with(|| kernel(isolate, glossy, shaders))
    }
}

fn kernel(isolate: GiIsolate, glossy: bool, shaders: &GiShaders) -> Kernel {
    let (uniform, read) = (uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None));
    let picture = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let light = texture_3d(TextureSampleType::Float { filterable: false });
    let voxels = |bindings: &[BindGroupLayoutEntryBuilder], defs: &[&'static str]| {
        let defs = defs.iter().map(|def| (*def).into()).collect();
        let groups = &[grid_layout()];
        let (path, entry) = ("debug/voxels.wgsl", "show_voxels");
        Kernel::new(shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    let alone = |path, entry, bindings: &[BindGroupLayoutEntryBuilder]| {
        Kernel::new(shaders, KernelDescriptor { path, entry, bindings, groups: &[], defs: vec![] })
    };
    let baked = |path, entry, defs| pixel_kernel(path, entry, defs, glossy, shaders);
    match isolate {
        GiIsolate::CutSize => baked("cssm/pixels.wgsl", "pixels", &["SEVERAL", "CUT"]),
        GiIsolate::TreeLevels => baked("debug/tree.wgsl", "show_tree", &[]),
        GiIsolate::BakedAtlas => baked("debug/baked_atlas.wgsl", "show_baked_atlas", &[]),
        GiIsolate::VoxelNormal => voxels(&[uniform, picture], &["VOXEL_NORMAL"]),
        GiIsolate::VoxelLight => {
            voxels(&[uniform, picture, uniform, read, light, light, light, light, light, light], &["VOXEL_LIGHT"])
        }
        GiIsolate::VoxelLevels => {
            let bindings = [uniform, picture, uniform, read, light, light, light, uniform];
            alone("debug/levels.wgsl", "show_levels", &bindings)
        }
        GiIsolate::ShadowAtlas => alone("debug/atlas.wgsl", "show_atlas", &[uniform, read, read, picture]),
        GiIsolate::Clusters => {
            alone("debug/clusters.wgsl", "show_clusters", &[uniform, read, read, read, read, picture])
        }
        GiIsolate::Caches => {
            let atlas = texture_2d(TextureSampleType::Float { filterable: false });
            alone("debug/caches.wgsl", "show_caches", &[uniform, picture, uniform, read, read, atlas])
        }
        _ => voxels(&[uniform, picture], &[]),
    }
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}

/// What is held for the whole world.
#[derive(SystemParam)]
pub(super) struct Held<'w> {
    grid: Option<Res<'w, VoxelGrid>>,
    light: Option<Res<'w, VoxelLight>>,
    atlas: Option<Res<'w, ShadowAtlas>>,
    vpl: Option<Res<'w, VplBuffers>>,
    baked: Option<Res<'w, Baked>>,
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
    baked: Option<Pixels<'a>>,
}

impl Shown<'_> {
    /// Whether a picture is another one with glossy light.
    fn is_glossy(&self, isolate: GiIsolate) -> bool {
        isolate == GiIsolate::CutSize && self.baked.as_ref().is_some_and(Pixels::are_glossy)
    }

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
            GiIsolate::CutSize | GiIsolate::TreeLevels | GiIsolate::BakedAtlas => {
                let pixels = self.baked.as_ref()?;
                let size = if isolate == GiIsolate::BakedAtlas {
                    folded(pixels.baked.lights().div_ceil(GROUP))
                } else {
                    tiles
                };
                return Some((pixels.groups(kernel, self.is_glossy(isolate), device, cache)?.into(), size));
            }
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
            GiIsolate::Caches => {
                let (held, light) = (self.caches?, self.light?);
                bindings.extend([held.parameters.binding()?, whole(&held.counters), whole(&light.unit)]);
                bindings.push(texture(&held.atlas));
                return Some((vec![kernel.bind(device, cache, &bindings)], tiles));
            }
            GiIsolate::VoxelLight | GiIsolate::VoxelLevels => {
                let light = self.light?;
                bindings.extend([light.parameters.binding()?, whole(&light.unit)]);
                bindings.extend(light.world.light.iter().map(texture));
                if isolate == GiIsolate::VoxelLevels {
                    bindings.push(self.grid?.uniform.binding()?);
                    return Some((vec![kernel.bind(device, cache, &bindings)], tiles));
                }
                bindings.extend(light.group_light().iter().map(texture));
            }
            _ => {}
        }
        Some((vec![kernel.bind(device, cache, &bindings), bind_grid(self.grid?, device, cache)?], tiles))
    }
}

/// Bakes that a view is lit by.
type BakedView = (&'static PixelLight, &'static ViewPrepassTextures);

/// Draws the picture that the view asks for over its bounced light.
pub(super) fn draw_picture(
    view: ViewQuery<(&GiView, &ViewTextures, &ViewUniformOffset, Option<&CacheBuffers>, Option<BakedView>)>,
    mut kernels: ResMut<PictureKernels>,
    shaders: Res<GiShaders>,
    view_uniforms: Res<ViewUniforms>,
    held: Held,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset, caches, baked_view) = view.into_inner();
    let Some(view) = view_binding(&view_uniforms, offset).filter(|_| gi.isolate.is_picture()) else { return };
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
    let baked_view = baked_view.filter(|_| gi.technique == Technique::SurfaceRadiosity);
    let pixels = baked_view.zip(held.baked.as_deref()).map(|((light, prepass), baked)| Pixels {
        baked,
        light,
        view: view.clone(),
        textures,
        prepass,
    });
    let shown = Shown {
        view,
        textures,
        grid: held.grid.as_deref(),
        light: held.light.as_deref(),
        atlas: held.atlas.as_deref(),
        vpl: held.vpl.as_deref(),
        caches,
        baked: pixels,
    };
    let kernel = kernels.get(gi.isolate, shown.is_glossy(gi.isolate), &shaders);
    let Some((groups, size)) = shown.groups(gi.isolate, kernel, ctx.render_device(), &cache) else { return };
    kernel.dispatch(ctx.command_encoder(), &cache, &groups.iter().collect::<Vec<_>>(), size);
}
