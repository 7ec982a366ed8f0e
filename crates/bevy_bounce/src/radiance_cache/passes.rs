//! Cluster, place, create, evaluate.

use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, CommandEncoder, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use super::pipelines::{CachePipelines, bind_volume};
use super::prepare::{BLOCK_PIXELS, CacheBuffers};
use super::volume::VoxelLight;
use crate::Technique;
use crate::avg::VoxelGrid;
use crate::compute::{folded, whole};
use crate::scene::{SceneBuffers, SkyBuffers};
use crate::sort::SortPipelines;
use crate::view::{GiView, ViewTextures, view_binding};

/// Threads of a workgroup over pixels.
const GROUP: u32 = 64;
/// Threads of a workgroup that compares neighbours.
const WIDE_GROUP: u32 = 256;
/// Edge of a workgroup over pixels.
const TILE: u32 = 8;

/// What the kernels that find caches bind.
struct Groups {
    axes: BindGroup,
    keys: BindGroup,
    clusters: BindGroup,
    keep: BindGroup,
    place: BindGroup,
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}

impl Groups {
    fn new(
        p: &CachePipelines,
        held: &CacheBuffers,
        surface: &TextureView,
        view: &BindingResource,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let parameters = held.parameters.binding()?;
        let sorted = whole(held.order.sorted(held.key_bits()));
        let axes = [parameters.clone(), texture(surface), whole(&held.frames)];
        let keys = [
            parameters.clone(),
            texture(surface),
            whole(&held.frames),
            whole(held.order.pairs()),
            whole(&held.pair_count),
        ];
        let clusters = [
            parameters.clone(),
            sorted.clone(),
            whole(&held.counters),
            whole(&held.blocks),
            whole(&held.starts),
            whole(&held.ranges),
        ];
        let keep = [view.clone(), parameters.clone(), texture(surface), whole(&held.last), whole(&held.kept)];
        let place = [
            view.clone(),
            parameters,
            texture(surface),
            whole(&held.counters),
            sorted,
            whole(&held.starts),
            whole(&held.last),
            whole(&held.kept),
            whole(&held.caches),
        ];
        Some(Self {
            axes: p.choose_axes.bind(device, cache, &axes),
            keys: p.write_keys.bind(device, cache, &keys),
            clusters: p.count_blocks.bind(device, cache, &clusters),
            keep: p.keep.bind(device, cache, &keep),
            place: p.place.bind(device, cache, &place),
        })
    }
}

/// Whether diffuse light is of caches, too.
fn is_diffuse(view: &GiView) -> bool {
    view.technique == Technique::RadianceCache
}

/// Finds clusters of the pixels.
fn cluster(
    p: &CachePipelines,
    sort: &SortPipelines,
    held: &CacheBuffers,
    groups: &Groups,
    device: &RenderDevice,
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
) {
    let parameters = held.parameters.get();
    let pixels = parameters.size.element_product();
    encoder.clear_buffer(&held.counters, 0, None);
    encoder.clear_buffer(&held.ranges, 0, None);
    p.choose_axes.dispatch(encoder, cache, &[&groups.axes], folded(parameters.tiles.element_product()));
    p.write_keys.dispatch(encoder, cache, &[&groups.keys], folded(pixels.div_ceil(GROUP)));
    sort.sort(device, encoder, cache, &held.order, &held.pair_count, held.key_bits());
    let clusters = [&groups.clusters];
    let blocks = folded(pixels.div_ceil(BLOCK_PIXELS));
    p.count_differences.dispatch(encoder, cache, &clusters, folded(pixels.div_ceil(WIDE_GROUP)));
    p.choose_coarseness.dispatch(encoder, cache, &clusters, UVec3::ONE);
    p.count_blocks.dispatch(encoder, cache, &clusters, blocks);
    p.scan_blocks.dispatch(encoder, cache, &clusters, UVec3::ONE);
    p.number_clusters.dispatch(encoder, cache, &clusters, blocks);
}

/// A cache for each cluster.
fn place(
    p: &CachePipelines,
    held: &CacheBuffers,
    reset: bool,
    groups: &Groups,
    encoder: &mut CommandEncoder,
    cache: &PipelineCache,
) {
    if reset {
        encoder.clear_buffer(&held.last, 0, None);
    } else {
        encoder.copy_buffer_to_buffer(&held.caches, 0, &held.last, 0, held.caches.size());
    }
    encoder.clear_buffer(&held.kept, 0, None);
    let capacity = held.parameters.get().capacity;
    p.keep.dispatch(encoder, cache, &[&groups.keep], folded(capacity.div_ceil(GROUP)));
    p.place.dispatch(encoder, cache, &[&groups.place], folded(capacity));
}

/// Clusters of a view's pixels, and a cache for each.
pub(super) fn distribute(
    view: ViewQuery<(&GiView, &ViewTextures, &CacheBuffers, &ViewUniformOffset)>,
    pipelines: Option<Res<CachePipelines>>,
    sort: Option<Res<SortPipelines>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, held, offset) = view.into_inner();
    let (Some(p), Some(sort), Some(view)) = (pipelines, sort, view_binding(&view_uniforms, offset)) else { return };
    let device = ctx.render_device().clone();
    let (ours, sorts) = (p.are_ready(is_diffuse(gi), &cache), sort.are_ready(&cache));
    if !(ours && sorts) {
        return;
    }
    let Some(groups) = Groups::new(&p, held, &textures.surface, &view, &device, &cache) else { return };
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cache_distribution");
    cluster(&p, &sort, held, &groups, &device, encoder, &cache);
    place(&p, held, gi.reset, &groups, encoder, &cache);
    span.end(encoder);
}

/// The light of a view's caches.
pub(super) fn create(
    view: ViewQuery<(&GiView, &CacheBuffers)>,
    pipelines: Option<Res<CachePipelines>>,
    light: Option<Res<VoxelLight>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    sky: Option<Res<SkyBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, held) = view.into_inner();
    let (Some(p), Some(light), Some(grid)) = (pipelines, light, grid) else { return };
    let diffuse = is_diffuse(gi);
    if !(light.is_lit && p.are_ready(diffuse, &cache)) {
        return;
    }
    let device = ctx.render_device().clone();
    let Some(volume) = bind_volume(&p, &grid, &light, &device, &cache) else { return };
    // Beside virtual lights, pixels look at the sky by themselves, and what reflects it is Bevy's.
    let sky = sky.filter(|_| diffuse && gi.settings.sky > 0 && scene.is_some_and(|scene| scene.sky_count() > 0));
    let create = p.create(sky.is_some());
    let mut bindings = vec![whole(&held.counters), whole(&held.caches), texture(&held.atlas)];
    bindings.extend(sky.iter().flat_map(|sky| [whole(&sky.table), whole(&light.unit)]));
    let group = create.bind(&device, &cache, &bindings);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cache_creation");
    create.dispatch(encoder, &cache, &[&group, &volume], folded(held.parameters.get().capacity));
    span.end(encoder);
}

/// Glossy light of a view from its caches, and diffuse light where they are its technique.
pub(super) fn evaluate(
    view: ViewQuery<(&GiView, &ViewTextures, &CacheBuffers, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Option<Res<CachePipelines>>,
    light: Option<Res<VoxelLight>>,
    view_uniforms: Res<ViewUniforms>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, held, prepass, offset) = view.into_inner();
    let (Some(p), Some(light)) = (pipelines, light) else { return };
    let diffuse = is_diffuse(gi);
    if !(light.is_lit && p.are_ready(diffuse, &cache)) {
        return;
    }
    let (Some(view), Some(deferred), Some(parameters)) =
        (view_binding(&view_uniforms, offset), prepass.deferred_view(), held.parameters.binding())
    else {
        return;
    };
    let (Some(glossy), Some(coat)) = (&textures.glossy, &textures.coat) else { return };
    let evaluate = p.evaluate(diffuse);
    let bindings = [
        view,
        parameters,
        texture(&textures.surface),
        texture(deferred),
        texture(&held.atlas),
        BindingResource::Sampler(&p.sampler),
        whole(&light.unit),
        whole(&held.caches),
        whole(&held.ranges),
        whole(&held.counters),
        texture(glossy),
        texture(coat),
        texture(&textures.indirect),
    ];
    let bindings = if diffuse { &bindings[..] } else { &bindings[..12] };
    let group = evaluate.bind(ctx.render_device(), &cache, bindings);
    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/cache_evaluation");
    let tiles = textures.size.map(|pixels| pixels.div_ceil(TILE));
    evaluate.dispatch(encoder, &cache, &[&group], tiles.extend(1));
    span.end(encoder);
}
