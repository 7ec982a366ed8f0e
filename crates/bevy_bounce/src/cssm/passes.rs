//! Light the texels, when something has changed; then the pixels.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, CommandEncoder, PipelineCache};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use super::pipelines::{CssmPipelines, bind_maps};
use super::pixels::PixelLight;
use super::prepare::{Baked, Light, Next};
use crate::compute::{Kernel, folded, whole};
use crate::scene::SceneBuffers;
use crate::view::{GiView, ViewTextures, view_binding};
use crate::{CssmReceivers, Technique};

/// Threads of a workgroup.
const GROUP: u32 = 64;
/// Edge of a workgroup over pixels.
const TILE: u32 = 8;

/// What makes the light of the texels before it bounces.
struct Sources {
    emit: BindGroup,
    direct: BindGroup,
    maps: BindGroup,
}

impl Sources {
    fn new(
        p: &CssmPipelines,
        baked: &Baked,
        scene: &SceneBuffers,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
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
            baked.bakes.binding()?,
            scene.uniform()?,
            whole(&scene.lights),
            baked.gather.binding()?,
            whole(&baked.sources),
        ];
        Some(Self {
            emit: p.emit.bind(device, cache, &emit),
            direct: p.direct.bind(device, cache, &direct),
            maps: bind_maps(baked, device, cache),
        })
    }

    /// Emission and direct light.
    fn light(&self, p: &CssmPipelines, baked: &Baked, encoder: &mut CommandEncoder, cache: &PipelineCache) {
        let size = folded(baked.lights().div_ceil(GROUP));
        p.emit.dispatch(encoder, cache, &[&self.emit], size);
        p.direct.dispatch(encoder, cache, &[&self.direct, &self.maps], size);
    }
}

/// What lets it bounce.
struct Bounces {
    /// By level; the one of the leaves is any.
    hierarchy: Vec<BindGroup>,
    bounce: BindGroup,
    /// The last one, where texels receive it.
    receive: Option<BindGroup>,
    maps: BindGroup,
}

impl Bounces {
    fn new(
        p: &CssmPipelines,
        baked: &Baked,
        light: &Light,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let (bakes, gather) = (baked.bakes.binding()?, baked.gather.binding()?);
        let hierarchy = |level| {
            let bindings = [
                whole(&baked.texels),
                bakes.clone(),
                whole(&baked.tree),
                whole(&light.powers),
                whole(&baked.sources),
                whole(&light.gathered),
                whole(level),
            ];
            p.leaves.bind(device, cache, &bindings)
        };
        let bounce = |output| {
            let bindings = [
                whole(&baked.texels),
                bakes.clone(),
                whole(&baked.tree),
                whole(&light.powers),
                gather.clone(),
                whole(output),
            ];
            p.gather(baked.count()).bounce.bind(device, cache, &bindings)
        };
        Some(Self {
            hierarchy: baked.levels.iter().map(hierarchy).collect(),
            bounce: bounce(&light.gathered),
            receive: light.received.as_ref().map(bounce),
            maps: bind_maps(baked, device, cache),
        })
    }

    /// Light of every node from that of the texels.
    fn pull(&self, p: &CssmPipelines, baked: &Baked, encoder: &mut CommandEncoder, cache: &PipelineCache) {
        if let Some(group) = self.hierarchy.first() {
            p.leaves.dispatch(encoder, cache, &[group], folded(baked.lights().div_ceil(GROUP)));
        }
        for (level, group) in self.hierarchy.iter().enumerate().rev() {
            p.pull.dispatch(encoder, cache, &[group], folded(baked.row(level as u32).div_ceil(GROUP)));
        }
        if let Some(group) = self.hierarchy.first() {
            p.pull_top.dispatch(encoder, cache, &[group], folded((2 * baked.count() - 1).div_ceil(GROUP)));
        }
    }

    /// The light of texels that have nothing of each other yet.
    fn start(
        &self,
        p: &CssmPipelines,
        baked: &Baked,
        light: &Light,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        encoder.clear_buffer(&light.gathered, 0, None);
        self.pull(p, baked, encoder, cache);
    }

    /// What the texels receive, into `gathered` or `received`.
    fn gather(
        &self,
        output: &BindGroup,
        p: &CssmPipelines,
        baked: &Baked,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        let size = folded(baked.lights().div_ceil(GROUP));
        p.gather(baked.count()).bounce.dispatch(encoder, cache, &[output, &self.maps], size);
    }

    /// One more.
    fn bounce(&self, p: &CssmPipelines, baked: &Baked, encoder: &mut CommandEncoder, cache: &PipelineCache) {
        self.gather(&self.bounce, p, baked, encoder, cache);
        self.pull(p, baked, encoder, cache);
    }

    /// The last one, where texels receive it.
    fn receive(&self, p: &CssmPipelines, baked: &Baked, encoder: &mut CommandEncoder, cache: &PipelineCache) {
        if let Some(receive) = &self.receive {
            self.gather(receive, p, baked, encoder, cache);
        }
    }
}

impl Next {
    /// A bounce of the light that comes next; after the last one, of `between`, it is what is shown.
    fn advance(
        &mut self,
        coming: &Bounces,
        between: u32,
        p: &CssmPipelines,
        baked: &mut Baked,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        let bounces = self.bounces.unwrap_or(0);
        if bounces == 0 {
            coming.start(p, baked, &self.light, encoder, cache);
            self.is_late = false;
        }
        coming.bounce(p, baked, encoder, cache);
        self.bounces = Some(bounces + 1);
        if bounces + 1 == between {
            coming.receive(p, baked, encoder, cache);
            std::mem::swap(&mut baked.light, &mut self.light);
            self.bounces = self.is_late.then_some(0);
        }
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
    let Some(wanted) = baked.wanted.clone().filter(|wanted| wanted.bounces > 0) else { return };
    if baked.rests() || !p.are_ready(&cache) {
        return;
    }
    let device = ctx.render_device().clone();
    baked.light.receive(wanted.at_texels, &device);
    let afresh = if baked.is_lit() {
        None
    } else {
        let Some(sources) = Sources::new(&p, baked, &scene, &device, &cache) else { return };
        let Some(shown) = Bounces::new(&p, baked, &baked.light, &device, &cache) else { return };
        Some((sources, shown))
    };
    // The last bounce is the pixels' own gather, or one that no texel sends on.
    let between = wanted.bounces - 1;
    let mut next =
        (wanted.spread && between > 0).then(|| baked.next.take().unwrap_or_else(|| Next::new(&device, baked.lights())));
    if let Some(next) = &mut next {
        next.light.receive(wanted.at_texels, &device);
    }
    let coming = next.as_ref().and_then(|next| Bounces::new(&p, baked, &next.light, &device, &cache));

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cssm");
    if let Some((sources, _)) = &afresh {
        sources.light(&p, baked, encoder, &cache);
    }
    match (&mut next, coming, afresh) {
        (Some(next), Some(coming), afresh) => {
            if let Some((_, shown)) = afresh {
                // At once: what the pixels gather is new, with further bounces as they were.
                shown.pull(&p, baked, encoder, &cache);
                shown.receive(&p, baked, encoder, &cache);
                next.is_late = true;
            }
            next.advance(&coming, between, &p, baked, encoder, &cache);
        }
        (.., Some((_, shown))) => {
            shown.start(&p, baked, &baked.light, encoder, &cache);
            for _ in 0..between {
                shown.bounce(&p, baked, encoder, &cache);
            }
            shown.receive(&p, baked, encoder, &cache);
        }
        _ => {}
    }
    span.end(encoder);
    baked.next = next;
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

    /// Groups of the kernel that shows what texels gathered; nothing while they are not lit.
    fn smooth_groups(&self, kernel: &Kernel, device: &RenderDevice, cache: &PipelineCache) -> Option<[BindGroup; 2]> {
        let baked = self.baked;
        let bindings = [
            whole(&baked.texels),
            baked.bakes.binding()?,
            whole(&baked.tree),
            whole(&baked.light.powers),
            self.light.settings.binding()?,
            self.view.clone(),
            BindingResource::TextureView(&self.textures.surface),
            BindingResource::TextureView(&self.textures.indirect),
            whole(baked.light.received.as_ref()?),
        ];
        baked.is_lit().then(|| [kernel.bind(device, cache, &bindings), bind_maps(baked, device, cache)])
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
            whole(&baked.light.powers),
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
    let (Some(baked), Some(p), Some(view)) = (baked, pipelines, view_binding(&view_uniforms, offset)) else { return };
    if gi.technique != Technique::SurfaceRadiosity {
        return;
    }
    let pixels = Pixels { baked: &baked, light, view, textures, prepass };
    let (kernels, glossy) = (p.gather(baked.count()), pixels.are_glossy());
    let device = ctx.render_device();
    let (kernel, groups) = match gi.settings.cssm.receivers {
        CssmReceivers::Texels => (&kernels.smooth_pixels, pixels.smooth_groups(&kernels.smooth_pixels, device, &cache)),
        CssmReceivers::Pixels => {
            let kernel = if glossy { &kernels.glossy_pixels } else { &kernels.pixels };
            (kernel, pixels.groups(kernel, glossy, device, &cache))
        }
    };
    let Some([group, maps]) = groups else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cssm_pixels");
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE));
    kernel.dispatch(encoder, &cache, &[&group, &maps], tiles.extend(1));
    span.end(encoder);
}
