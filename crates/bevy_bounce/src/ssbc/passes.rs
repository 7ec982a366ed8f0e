//! Iterate, then add what was found to the bounced light.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::pbr::deferred::SkipDeferredLighting;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{
    BindGroup, BindingResource, Buffer, CommandEncoder, LoadOp, Operations, PipelineCache, RenderPassColorAttachment,
    RenderPassDescriptor, StoreOp, TextureView,
};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};
use bevy_bounce_shaders::types::SSBC_REPAIR_HEADER;

use super::SsbcTextures;
use super::pipelines::SsbcPipelines;
use super::prepare::AtPixels;
use crate::avg::VoxelGrid;
use crate::compute::{bind_group, whole};
use crate::view::{GiView, ViewTextures, view_binding};
use crate::vpl::VplBuffers;
use crate::{GiIsolate, Technique};

/// Edge of a workgroup.
const GROUP: u32 = 8;
/// Levels that one dispatch of `reduce` makes.
const LEVELS_AT_ONCE: usize = 3;

/// What the passes of a view bind.
struct Inputs<'a> {
    view: BindingResource<'a>,
    parameters: BindingResource<'a>,
    deferred: &'a TextureView,
    vpl: &'a VplBuffers,
    grid: BindingResource<'a>,
    textures: &'a ViewTextures,
    ours: &'a SsbcTextures,
    same_texels: bool,
}

/// Bind groups of the passes of a view.
struct Groups {
    radiance: [BindGroup; 2],
    reduce: [BindGroup; 2],
    gather: BindGroup,
    at_pixels: Option<AtPixelsGroups>,
    apply: BindGroup,
}

/// Bind groups of those between the residual at its own texels and at every pixel, and their list.
struct AtPixelsGroups {
    to_pixels: ToPixels,
    repairs: Buffer,
    repair: Option<BindGroup>,
}

/// The way from the residual's texels to pixels.
enum ToPixels {
    /// Blurred along rows, then along columns.
    Blur { rows: BindGroup, columns: BindGroup, same_texels: bool },
    /// As it is.
    Spread(BindGroup),
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}

impl<'a> Inputs<'a> {
    /// Bindings 0 to 2, which every pass has, and more.
    fn with(&self, more: impl IntoIterator<Item = BindingResource<'a>>) -> Vec<BindingResource<'a>> {
        let common = [self.view.clone(), self.parameters.clone(), texture(&self.textures.surface)];
        common.into_iter().chain(more).collect()
    }

    /// Bindings of what integrates, with number 3.
    fn integrand(&self, residual: &'a TextureView) -> Vec<BindingResource<'a>> {
        let (header, densities) = (whole(&self.vpl.header), whole(&self.vpl.densities));
        self.with([texture(residual), header, self.grid.clone(), densities, texture(&self.ours.hierarchy)])
    }

    fn groups(&self, p: &SsbcPipelines, device: &RenderDevice, cache: &PipelineCache) -> Groups {
        let (textures, ours) = (self.textures, self.ours);
        let levels = |first: usize, count: usize| ours.levels[first..first + count].iter().map(texture);
        let radiance = self.with([
            texture(ours.result(textures)),
            texture(self.deferred),
            texture(&textures.direct_diffuse),
            texture(&textures.indirect),
            texture(&ours.levels[0]),
        ]);
        let [from_pixels, from_level] = [0, LEVELS_AT_ONCE].map(|below| self.with(levels(below, 1 + LEVELS_AT_ONCE)));
        let at_pixels = |to: &'a AtPixels| {
            let residual = to.residual(textures);
            let listing = |from| self.with([texture(from), texture(residual), whole(&to.repairs)]);
            let to_pixels = if ours.is_blurred {
                let (between, same_texels) = (&textures.interleaved, self.same_texels);
                let bounded = same_texels.then(|| texture(&textures.indirect));
                let columns: Vec<_> = listing(between).into_iter().chain(bounded).collect();
                ToPixels::Blur {
                    rows: p.blur_rows.bind(device, cache, &self.with([texture(&ours.residual), texture(between)])),
                    columns: p.blur_columns[usize::from(same_texels)].bind(device, cache, &columns),
                    same_texels,
                }
            } else {
                ToPixels::Spread(p.spread.bind(device, cache, &listing(&ours.residual)))
            };
            let integrand = self.integrand(residual).into_iter().chain([whole(&to.repairs)]);
            let integrand = to.is_repaired.then(|| integrand.collect::<Vec<_>>());
            let repair = integrand.map(|integrand| p.repair.bind(device, cache, &integrand));
            AtPixelsGroups { to_pixels, repairs: to.repairs.clone(), repair }
        };
        Groups {
            radiance: [0, 1].map(|i| p.radiance[i].bind(device, cache, &radiance)),
            reduce: [p.reduce[0].bind(device, cache, &from_pixels), p.reduce[1].bind(device, cache, &from_level)],
            gather: p.gather.bind(device, cache, &self.integrand(&ours.residual)),
            at_pixels: ours.at_pixels.as_ref().map(at_pixels),
            apply: bind_group(device, cache, &p.apply_layout, &[texture(ours.result(textures))]),
        }
    }
}

/// One application of the residual operator to the last one's result.
fn iterate(
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
    p: &SsbcPipelines,
    groups: &Groups,
    view: &Sizes,
    first: bool,
) {
    let radiance = usize::from(!first);
    p.radiance[radiance].dispatch(encoder, cache, &[&groups.radiance[radiance]], view.pixels);
    p.reduce[0].dispatch(encoder, cache, &[&groups.reduce[0]], view.low_levels);
    p.reduce[1].dispatch(encoder, cache, &[&groups.reduce[1]], view.high_levels);
    p.gather.dispatch(encoder, cache, &[&groups.gather], view.residual);
    if let Some(AtPixelsGroups { to_pixels, repairs, repair }) = &groups.at_pixels {
        encoder.clear_buffer(repairs, 0, Some(u64::from(4 * SSBC_REPAIR_HEADER)));
        match to_pixels {
            ToPixels::Blur { rows, columns, same_texels } => {
                p.blur_rows.dispatch(encoder, cache, &[rows], view.rows);
                p.blur_columns[usize::from(*same_texels)].dispatch(encoder, cache, &[columns], view.pixels);
            }
            ToPixels::Spread(spread) => p.spread.dispatch(encoder, cache, &[spread], view.residual),
        }
        if let Some(repair) = repair {
            p.repair.dispatch_indirect(encoder, cache, &[repair], repairs);
        }
    }
}

/// Workgroups of the passes of a view.
struct Sizes {
    pixels: UVec3,
    low_levels: UVec3,
    high_levels: UVec3,
    residual: UVec3,
    rows: UVec3,
}

impl Sizes {
    fn new(textures: &ViewTextures, ours: &SsbcTextures) -> Self {
        let groups = |texels: UVec2| texels.map(|texels| texels.div_ceil(GROUP)).extend(1);
        Self {
            pixels: groups(textures.size),
            low_levels: groups(ours.level_size(1)),
            high_levels: groups(ours.level_size(1 + LEVELS_AT_ONCE as u32)),
            residual: groups(ours.residual_size),
            rows: groups(ours.residual_size.with_x(textures.size.x)),
        }
    }
}

/// Whether the residual is blurred over the texels that bounded light is the mean of.
fn takes_same_texels(gi: &GiView) -> bool {
    gi.technique == Technique::InstantRadiosity && gi.settings.resolution == gi.settings.ssbc.resolution
}

pub(super) fn compensate(
    view: ViewQuery<
        (&GiView, &ViewTextures, &SsbcTextures, &ViewPrepassTextures, &ViewUniformOffset),
        // Others have no direct light of this frame.
        With<SkipDeferredLighting>,
    >,
    pipelines: Option<Res<SsbcPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, ours, prepass, offset) = view.into_inner();
    let (Some(p), Some(vpl), Some(grid)) = (pipelines, vpl, grid) else { return };
    let same_texels = takes_same_texels(gi);
    if gi.isolate == GiIsolate::Bounded || !p.are_ready(same_texels, &cache) {
        return;
    }
    let (Some(view), Some(parameters), Some(grid_uniform)) =
        (view_binding(&view_uniforms, offset), ours.parameters.binding(), grid.uniform.binding())
    else {
        return;
    };
    let (Some(deferred), Some(apply)) = (prepass.deferred_view(), cache.get_render_pipeline(p.apply)) else { return };
    let inputs = Inputs { view, parameters, deferred, vpl: &vpl, grid: grid_uniform, textures, ours, same_texels };
    let groups = inputs.groups(&p, ctx.render_device(), &cache);
    let sizes = Sizes::new(textures, ours);

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(ctx.command_encoder(), "bounce/ssbc");
    for iteration in 0..gi.settings.ssbc.iterations {
        iterate(ctx.command_encoder(), &cache, &p, &groups, &sizes, iteration == 0);
    }
    let load = if gi.isolate == GiIsolate::Residual { LoadOp::Clear(LinearRgba::NONE.into()) } else { LoadOp::Load };
    {
        let mut pass = ctx.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("bounce_ssbc_apply"),
            color_attachments: &[Some(RenderPassColorAttachment {
                view: &textures.indirect,
                depth_slice: None,
                resolve_target: None,
                ops: Operations { load, store: StoreOp::Store },
            })],
            ..default()
        });
        pass.set_render_pipeline(apply);
        pass.set_bind_group(0, &groups.apply, &[]);
        if gi.isolate == GiIsolate::Split {
            let UVec2 { x, y } = textures.size;
            pass.set_scissor_rect(x / 2, 0, x - x / 2, y);
        }
        pass.draw(0..3, 0..1);
    }
    span.end(ctx.command_encoder());
}
