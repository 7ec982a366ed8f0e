//! Place the faces, light them, fill the volume.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{BindingResource, PipelineCache};
use bevy::render::renderer::RenderContext;
use bevy::render::texture::GpuImage;

use super::extract::ExtractedProbes;
use super::pipelines::ProbePipelines;
use super::prepare::ProbeBuffers;
use super::receivers::Receivers;
use crate::avg::{VoxelGrid, bind_grid, bind_sky};
use crate::compute::{folded, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::shadow_atlas::ShadowAtlas;
use crate::shadow_atlas::bind_visibility;
use crate::vpl::VplBuffers;

/// Threads of a workgroup, a face each.
const GROUP: u32 = 64;

pub(super) fn light_probes(
    settings: Res<GiWorldSettings>,
    extracted: Res<ExtractedProbes>,
    pipelines: Option<Res<ProbePipelines>>,
    probes: Option<Res<ProbeBuffers>>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    atlas: Option<Res<ShadowAtlas>>,
    scene: Option<Res<SceneBuffers>>,
    images: Res<RenderAssets<GpuImage>>,
    receivers: Receivers,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(_), Some(asked), Some(p), Some(probes), Some(vpl), Some(grid), Some(scene)) =
        (settings.0, extracted.0, pipelines, probes, vpl, grid, scene)
    else {
        return;
    };
    // Compiled before anything receives their light.
    if !p.are_ready(asked.volume.visibility, &cache) || !receivers.any() {
        return;
    }
    let Some(image) = images.get(asked.image).filter(|image| {
        let size = image.texture_descriptor.size;
        UVec3::new(size.width, size.height, size.depth_or_array_layers) == asked.volume.texels()
    }) else {
        return;
    };
    let (Some(parameters), Some(grid_uniform)) = (probes.parameters.binding(), grid.uniform.binding()) else { return };
    let device = ctx.render_device().clone();
    let Some(grid_group) = bind_grid(&grid, &device, &cache) else { return };
    let Some((visibility, see_groups)) =
        bind_visibility(asked.volume.visibility, atlas.as_deref(), &grid, None, &device, &cache)
    else {
        return;
    };
    let light = p.light(visibility);
    let place_group = p.place.bind(&device, &cache, &[parameters.clone(), whole(&probes.places)]);
    let light_group = light.bind(
        &device,
        &cache,
        &[
            parameters.clone(),
            whole(&probes.places),
            whole(&vpl.header),
            whole(&vpl.vpls),
            whole(&probes.light),
            grid_uniform,
            whole(&vpl.densities),
        ],
    );
    let sky_group = p.sky.bind(&device, &cache, &[parameters.clone(), whole(&probes.places), whole(&probes.light)]);
    let grid_and_sky = (scene.sky_count() > 0).then(|| bind_sky(&grid, &scene, &device, &cache)).flatten();
    let output = BindingResource::TextureView(&image.texture_view);
    let fill_group = p.fill.bind(&device, &cache, &[parameters, whole(&probes.places), whole(&probes.light), output]);

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/probes");
    let groups = folded(probes.faces().div_ceil(GROUP));
    p.place.dispatch(encoder, &cache, &[&place_group, &grid_group], groups);
    let with_visibility: Vec<_> = std::iter::once(&light_group).chain(&see_groups).collect();
    light.dispatch(encoder, &cache, &with_visibility, groups);
    if let Some(grid_and_sky) = &grid_and_sky {
        p.sky.dispatch(encoder, &cache, &[&sky_group, grid_and_sky], groups);
    }
    p.fill.dispatch(encoder, &cache, &[&fill_group], groups);
    span.end(encoder);
}
