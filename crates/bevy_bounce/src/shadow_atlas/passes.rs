//! What bakes know, occluders, shadow maps.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, PipelineCache};
use bevy::render::renderer::{RenderContext, RenderDevice};

use super::pipelines::AtlasPipelines;
use super::prepare::ShadowAtlas;
use crate::VplVisibility;
use crate::avg::VoxelGrid;
use crate::compute::{folded, whole};
use crate::cssm::{Baked, bind_maps};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::vpl::VplBuffers;

/// Threads of a workgroup that places points.
const GROUP: u32 = 64;

/// What lights on baked objects see of these.
struct Eyes {
    find: BindGroup,
    draw: BindGroup,
    maps: BindGroup,
}

impl Eyes {
    fn new(
        p: &AtlasPipelines,
        atlas: &ShadowAtlas,
        vpl: &VplBuffers,
        baked: &Baked,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Option<Self> {
        let bakes = baked.bakes.binding()?;
        let find = [
            whole(&baked.texels),
            bakes.clone(),
            whole(&baked.tree),
            whole(&vpl.header),
            whole(&vpl.vpls),
            whole(&atlas.eyes),
        ];
        let draw = [
            whole(&baked.texels),
            bakes,
            atlas.parameters.binding()?,
            whole(&atlas.eyes),
            whole(&vpl.vpls),
            whole(&atlas.atlas),
        ];
        Some(Self {
            find: p.find_eyes.bind(device, cache, &find),
            draw: p.draw_baked.bind(device, cache, &draw),
            maps: bind_maps(baked, device, cache),
        })
    }
}

pub(super) fn draw_atlas(
    settings: Res<GiWorldSettings>,
    pipelines: Option<Res<AtlasPipelines>>,
    atlas: Option<Res<ShadowAtlas>>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    scene: Option<Res<SceneBuffers>>,
    baked: Option<Res<Baked>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (Some(p), Some(atlas), Some(vpl), Some(grid), Some(scene)) = (pipelines, atlas, vpl, grid, scene) else {
        return;
    };
    let (Some(parameters), Some(grid_uniform)) = (atlas.parameters.binding(), grid.uniform.binding()) else { return };
    let Some(settings) = settings.0.filter(|settings| p.are_ready(settings.visibility, &cache)) else { return };
    let counts = scene.occluders();
    let groups = |count| UVec3::new(count, 1, 1);
    let baked = baked.filter(|baked| settings.visibility == VplVisibility::Baked && baked.is_placed());
    let (place, place_groups, source, draw) = match settings.visibility {
        VplVisibility::Ism => {
            (&p.place_points, groups(counts.points.div_ceil(GROUP)), &scene.surface_points, &p.splat_points)
        }
        _ if baked.is_some() => (&p.place_others, groups(counts.chunks), &scene.occluder_chunks, &p.rasterize_others),
        _ => (&p.place_occluders, groups(counts.chunks), &scene.occluder_chunks, &p.rasterize),
    };
    let device = ctx.render_device().clone();
    let mut place_bindings = vec![
        whole(&scene.geometry),
        whole(&scene.instances),
        whole(&scene.materials),
        whole(&scene.thumbnails),
        whole(source),
        whole(&atlas.occluders),
    ];
    place_bindings.extend((settings.visibility == VplVisibility::Ism).then(|| parameters.clone()));
    place_bindings.extend(baked.as_ref().map(|baked| whole(&baked.instance_objects)));
    let mut draw_bindings = vec![
        parameters,
        grid_uniform,
        whole(&vpl.header),
        whole(&atlas.occluders),
        whole(&vpl.vpls),
        whole(&atlas.atlas),
    ];
    draw_bindings.extend(baked.as_ref().map(|_| whole(&atlas.eyes)));
    let place_group = place.bind(&device, &cache, &place_bindings);
    let draw_group = draw.bind(&device, &cache, &draw_bindings);
    let eye_groups = baked.as_ref().and_then(|baked| Eyes::new(&p, &atlas, &vpl, baked, &device, &cache));

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/shadow_atlas");
    let lights = vpl.parameters().capacity;
    if let Some(eyes) = &eye_groups {
        p.find_eyes.dispatch(encoder, &cache, &[&eyes.find], groups(lights.div_ceil(GROUP)));
        p.draw_baked.dispatch(encoder, &cache, &[&eyes.draw, &eyes.maps], folded(lights));
    }
    place.dispatch(encoder, &cache, &[&place_group], place_groups);
    draw.dispatch(encoder, &cache, &[&draw_group], folded(lights).with_z(atlas.parts()));
    span.end(encoder);
}
