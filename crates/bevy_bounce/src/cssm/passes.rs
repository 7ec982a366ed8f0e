//! Light the texels, when something has changed; then the pixels.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{
    BindGroup, BindingResource, BufferBinding, CommandEncoder, PipelineCache, ShaderType,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};

use super::pipelines::{CssmPipelines, bind_maps};
use super::pixels::PixelLight;
use super::prepare::Baked;
use crate::Technique;
use crate::compute::{Kernel, folded, whole};
use crate::scene::SceneBuffers;
use crate::view::{GiView, ViewTextures};

/// Threads of a workgroup.
const GROUP: u32 = 64;
/// Edge of a workgroup over pixels.
const TILE: u32 = 8;

/// What the kernels bind.
struct Groups {
    emit: BindGroup,
    direct: BindGroup,
    /// By level; the one of the leaves is any.
    hierarchy: Vec<BindGroup>,
    bounce: BindGroup,
    maps: BindGroup,
}

impl Groups {
    fn new(
        p: &CssmPipelines,
        baked: &Baked,
        scene: &SceneBuffers,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let (bakes, gather) = (baked.bakes.binding()?, baked.gather.binding()?);
        let emit = [
            whole(&scene.geometry),
            whole(&scene.instances),
            whole(&scene.materials),
            whole(&scene.thumbnails),
            whole(&baked.surfaces),
            whole(&baked.part_instances),
            whole(&baked.sources),
        ];
        let direct = [
            whole(&baked.texels),
            bakes.clone(),
            scene.uniform()?,
            whole(&scene.lights),
            gather.clone(),
            whole(&baked.sources),
        ];
        let hierarchy = |level| {
            let bindings = [
                whole(&baked.texels),
                bakes.clone(),
                whole(&baked.tree),
                whole(&baked.powers),
                whole(&baked.sources),
                whole(&baked.gathered),
                whole(level),
            ];
            p.leaves.bind(device, cache, &bindings)
        };
        let bounce = [
            whole(&baked.texels),
            bakes.clone(),
            whole(&baked.tree),
            whole(&baked.powers),
            gather,
            whole(&baked.gathered),
        ];
        Some(Self {
            emit: p.emit.bind(device, cache, &emit),
            direct: p.direct.bind(device, cache, &direct),
            hierarchy: baked.levels.iter().map(hierarchy).collect(),
            bounce: p.gather(baked.count()).bounce.bind(device, cache, &bounce),
            maps: bind_maps(baked, device, cache),
        })
    }
}

/// Light of every node from that of the texels.
fn pull(p: &CssmPipelines, groups: &Groups, baked: &Baked, encoder: &mut CommandEncoder, cache: &PipelineCache) {
    if let Some(group) = groups.hierarchy.first() {
        p.leaves.dispatch(encoder, cache, &[group], folded(baked.lights().div_ceil(GROUP)));
    }
    for (level, group) in groups.hierarchy.iter().enumerate().rev() {
        p.pull.dispatch(encoder, cache, &[group], folded(baked.row(level as u32).div_ceil(GROUP)));
    }
}

/// Emission and direct light of the texels, then bounce after bounce. What is there stays while nothing changes.
pub(super) fn light_texels(
    baked: Option<ResMut<Baked>>,
    pipelines: Option<Res<CssmPipelines>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(mut baked), Some(p), Some(scene)) = (baked, pipelines, scene) else { return };
    let baked = &mut *baked;
    if baked.wanted == baked.solved {
        return;
    }
    let Some(wanted) = baked.wanted.clone().filter(|wanted| wanted.bounces > 0) else { return };
    let Some(groups) =
        Groups::new(&p, baked, &scene, ctx.render_device(), &cache).filter(|_| p.are_ready(baked.count(), &cache))
    else {
        return;
    };
    let size = folded(baked.lights().div_ceil(GROUP));
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cssm");
    p.emit.dispatch(encoder, &cache, &[&groups.emit], size);
    p.direct.dispatch(encoder, &cache, &[&groups.direct, &groups.maps], size);
    encoder.clear_buffer(&baked.gathered, 0, None);
    pull(&p, &groups, baked, encoder, &cache);
    // The pixels' own gather is the last bounce.
    for _ in 1..wanted.bounces {
        p.gather(baked.count()).bounce.dispatch(encoder, &cache, &[&groups.bounce, &groups.maps], size);
        pull(&p, &groups, baked, encoder, &cache);
    }
    span.end(encoder);
    baked.solved = Some(wanted);
    baked.times_lit += 1;
}

/// What kernels over the pixels of a view read and write.
pub(crate) struct Pixels<'a> {
    pub baked: &'a Baked,
    pub light: &'a PixelLight,
    /// The view's uniform.
    pub view: BindingResource<'a>,
    pub textures: &'a ViewTextures,
    pub prepass: &'a ViewPrepassTextures,
}

impl Pixels<'_> {
    /// Whether glossy light is gathered, too.
    pub fn are_glossy(&self) -> bool {
        self.textures.glossy.is_some() && self.prepass.deferred_view().is_some()
    }

    /// Groups of a kernel, with what glossy light needs or without; nothing while texels are not lit.
    pub fn groups(
        &self,
        kernel: &Kernel,
        glossy: bool,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<[BindGroup; 2]> {
        let baked = self.baked;
        if !baked.is_lit() {
            return None;
        }
        let mut bindings = vec![
            whole(&baked.texels),
            baked.bakes.binding()?,
            whole(&baked.tree),
            whole(&baked.powers),
            self.light.settings.binding()?,
            self.view.clone(),
            BindingResource::TextureView(&self.textures.surface),
            BindingResource::TextureView(&self.textures.indirect),
            whole(&self.light.kept),
        ];
        if glossy {
            bindings.push(BindingResource::TextureView(self.prepass.deferred_view()?));
            bindings.push(BindingResource::TextureView(self.textures.glossy.as_ref()?));
        }
        Some([kernel.bind(device, cache, &bindings), bind_maps(baked, device, cache)])
    }
}

/// The final gather of a view into `indirect`, and into `glossy` where there is such light.
pub(super) fn light_pixels(
    view: ViewQuery<(&GiView, &PixelLight, &ViewTextures, &ViewPrepassTextures, &ViewUniformOffset)>,
    baked: Option<Res<Baked>>,
    pipelines: Option<Res<CssmPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, light, textures, prepass, offset) = view.into_inner();
    let (Some(baked), Some(p), Some(buffer)) = (baked, pipelines, view_uniforms.uniforms.buffer()) else { return };
    if gi.technique != Technique::SurfaceRadiosity {
        return;
    }
    let view = BufferBinding { buffer, offset: offset.offset.into(), size: Some(ViewUniform::min_size()) };
    let pixels = Pixels { baked: &baked, light, view: BindingResource::Buffer(view), textures, prepass };
    let (kernels, glossy) = (p.gather(baked.count()), pixels.are_glossy());
    let kernel = if glossy { &kernels.glossy_pixels } else { &kernels.pixels };
    let Some([group, maps]) = pixels.groups(kernel, glossy, ctx.render_device(), &cache) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cssm_pixels");
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE));
    kernel.dispatch(encoder, &cache, &[&group, &maps], tiles.extend(1));
    span.end(encoder);
}
