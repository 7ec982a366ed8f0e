//! Place the faces, light them, fill the volume.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{BindGroup, BindingResource, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, RenderDevice};
use bevy::render::texture::GpuImage;

use super::extract::ExtractedProbes;
use super::pipelines::ProbePipelines;
use super::prepare::ProbeBuffers;
use super::receivers::Receivers;
use crate::avg::{VoxelGrid, bind_grid, bind_sky};
use crate::compute::{Kernel, folded, whole};
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
    let inputs = Inputs { parameters, grid: grid_uniform, probes: &probes, vpl: &vpl, image: &image.texture_view };
    let own = inputs.bind(&p, light, &device, &cache);
    let grid_and_sky = (scene.sky_count() > 0).then(|| bind_sky(&grid, &scene, &device, &cache)).flatten();

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/probes");
    let groups = folded(probes.faces().div_ceil(GROUP));
    p.place.dispatch(encoder, &cache, &[&own.place, &grid_group], groups);
    let with_visibility: Vec<_> = std::iter::once(&own.light).chain(&see_groups).collect();
    light.dispatch(encoder, &cache, &with_visibility, groups);
    if let Some(grid_and_sky) = &grid_and_sky {
        p.sky.dispatch(encoder, &cache, &[&own.sky, grid_and_sky], groups);
    }
    p.fill.dispatch(encoder, &cache, &[&own.fill], groups);
    span.end(encoder);
}

/// What the passes read and write.
struct Inputs<'a> {
    parameters: BindingResource<'a>,
    grid: BindingResource<'a>,
    probes: &'a ProbeBuffers,
    vpl: &'a VplBuffers,
    /// The volume, as Bevy's shaders read it.
    image: &'a TextureView,
}

/// Group 0 of each pass.
struct Groups {
    place: BindGroup,
    light: BindGroup,
    sky: BindGroup,
    fill: BindGroup,
}

impl Inputs<'_> {
    fn bind(&self, p: &ProbePipelines, light: &Kernel, device: &RenderDevice, cache: &PipelineCache) -> Groups {
        let parameters = || self.parameters.clone();
        let (places, faces) = (|| whole(&self.probes.places), || whole(&self.probes.light));
        let vpl = self.vpl;
        let lights = [whole(&vpl.header), whole(&vpl.vpls), faces(), self.grid.clone(), whole(&vpl.densities)];
        let lit: Vec<_> = [parameters(), places()].into_iter().chain(lights).collect();
        let image = BindingResource::TextureView(self.image);
        Groups {
            place: p.place.bind(device, cache, &[parameters(), places()]),
            light: light.bind(device, cache, &lit),
            sky: p.sky.bind(device, cache, &[parameters(), places(), faces()]),
            fill: p.fill.bind(device, cache, &[parameters(), places(), faces(), image]),
        }
    }
}
