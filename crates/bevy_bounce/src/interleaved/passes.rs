//! Shade by near lights and by subsets of all, join these.

use bevy::prelude::*;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::{BindGroup, BindingResource, CommandEncoder, PipelineCache, TextureView};
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ViewUniformOffset, ViewUniforms};

use super::pipelines::{InterleavedPipelines, Passes, PassesKey};
use crate::Technique;
use crate::avg::VoxelGrid;
use crate::compute::{GiShaders, Kernel, whole};
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;
use crate::shadow_atlas::{ShadowAtlas, bind_visibility};
use crate::view::{GiView, ViewTextures, view_binding};
use crate::vpl::VplBuffers;

/// Edge of a tile of texels of one sub-image, times the edge of the 4x4 blocks.
const TILE_TEXELS: u32 = 8 * 4;
/// Edge of a workgroup of the other passes.
const GROUP: u32 = 8;

pub(super) fn shade(
    view: ViewQuery<(&GiView, &ViewTextures, &ViewUniformOffset)>,
    settings: Res<GiWorldSettings>,
    pipelines: Option<ResMut<InterleavedPipelines>>,
    shaders: Res<GiShaders>,
    view_uniforms: Res<ViewUniforms>,
    vpl: Option<Res<VplBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    atlas: Option<Res<ShadowAtlas>>,
    scene: Option<Res<SceneBuffers>>,
    cache: Res<PipelineCache>,
    mut ctx: RenderContext,
) {
    let (gi, textures, offset) = view.into_inner();
    let (Some(_), Some(mut p), Some(vpl), Some(grid), Some(scene)) = (settings.0, pipelines, vpl, grid, scene) else {
        return;
    };
    if gi.technique != Technique::InstantRadiosity {
        return;
    }
    let (Some(view_uniform), Some(grid_uniform)) = (view_binding(&view_uniforms, offset), grid.uniform.binding())
    else {
        return;
    };
    let sky = (scene.sky_count() > 0 && gi.settings.sky > 0).then_some(&*scene);
    let bind_sight =
        |sky| bind_visibility(gi.settings.visibility, atlas.as_deref(), &grid, sky, ctx.render_device(), &cache);
    let Some((visibility, see_groups)) = bind_sight(sky) else { return };
    let sky_seen = textures.sky_seen.as_ref().filter(|_| sky.is_some());
    let key = PassesKey {
        visibility,
        resolution: gi.settings.resolution,
        few_lights: vpl.fits_uniform(),
        sky: sky.is_some(),
        sky_seen: sky_seen.is_some(),
    };
    p.passes(key, &shaders);
    let Some(key) = p.compiled(key, &cache) else { return };
    let sky_seen = sky_seen.filter(|_| key.sky_seen);
    let see_groups =
        if key.sky == sky.is_some() { see_groups } else { bind_sight(None).map_or(see_groups, |bound| bound.1) };
    let passes = p.passes(key, &shaders);
    let inputs = Inputs { textures, view: view_uniform, grid: grid_uniform, vpl: &vpl };
    let groups = inputs.bind(passes, sky_seen, ctx.render_device(), &cache);

    let diagnostics = ctx.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let encoder = ctx.command_encoder();
    let span = diagnostics.time_span(encoder, "bounce/interleaved");
    let pixels_a_texel = gi.settings.resolution.pixels_a_texel();
    groups.dispatch(passes, &see_groups, textures.size, pixels_a_texel, encoder, &cache);
    span.end(encoder);
}

/// What all passes read, but what they filter.
struct Inputs<'a> {
    textures: &'a ViewTextures,
    view: BindingResource<'a>,
    grid: BindingResource<'a>,
    vpl: &'a VplBuffers,
}

impl<'a> Inputs<'a> {
    fn bindings(&self, output: &'a TextureView) -> [BindingResource<'a>; 7] {
        [
            self.view.clone(),
            texture(&self.textures.surface),
            whole(&self.vpl.header),
            whole(&self.vpl.compact_vpls),
            texture(output),
            self.grid.clone(),
            whole(&self.vpl.densities),
        ]
    }

    /// What near lights bring goes into `interleaved`. All light is shaded into `indirect`, and comes back there filtered; so does what
    /// of the sky is seen, in its own texture.
    fn bind(
        &self,
        passes: &Passes,
        sky_seen: Option<&'a TextureView>,
        device: &RenderDevice,
        cache: &PipelineCache,
    ) -> Groups {
        let (light, between) = (&self.textures.indirect, &self.textures.interleaved);
        let shaded: Vec<_> =
            self.bindings(light).into_iter().chain([texture(between)]).chain(sky_seen.map(texture)).collect();
        let filter = |kernel: &Kernel, from, to| {
            let bindings = self.bindings(to).into_iter().chain([texture(from)]).collect::<Vec<_>>();
            kernel.bind(device, cache, &bindings)
        };
        Groups {
            near: passes.near.bind(device, cache, &self.bindings(between)),
            shade: passes.shade.bind(device, cache, &shaded),
            rows: filter(&passes.rows, light, between),
            columns: filter(&passes.columns, between, light),
            sky: passes
                .sky_columns
                .as_ref()
                .zip(sky_seen)
                .map(|(columns, seen)| [filter(&passes.rows, seen, between), filter(columns, between, seen)]),
        }
    }
}

/// Group 0 of each pass.
struct Groups {
    near: BindGroup,
    shade: BindGroup,
    rows: BindGroup,
    columns: BindGroup,
    /// Rows and columns of what of the sky is seen.
    sky: Option<[BindGroup; 2]>,
}

impl Groups {
    fn dispatch(
        &self,
        passes: &Passes,
        see_groups: &[BindGroup],
        pixels: UVec2,
        pixels_a_texel: u32,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
    ) {
        let mut run = |kernel: &Kernel, group, workgroups: UVec2| {
            let groups: Vec<_> = std::iter::once(group).chain(see_groups).collect();
            kernel.dispatch(encoder, cache, &groups, workgroups.extend(1));
        };
        run(&passes.near, &self.near, pixels.map(|pixels| pixels.div_ceil(GROUP * pixels_a_texel)));
        run(&passes.shade, &self.shade, pixels.map(|pixels| pixels.div_ceil(TILE_TEXELS * pixels_a_texel)) * 4);
        let columns = pixels.map(|pixels| pixels.div_ceil(GROUP));
        let rows = columns.with_y(pixels.y.div_ceil(GROUP * pixels_a_texel));
        run(&passes.rows, &self.rows, rows);
        run(&passes.columns, &self.columns, columns);
        if let (Some(kernel), Some([sky_rows, sky_columns])) = (&passes.sky_columns, &self.sky) {
            run(&passes.rows, sky_rows, rows);
            run(kernel, sky_columns, columns);
        }
    }
}

fn texture(view: &TextureView) -> BindingResource<'_> {
    BindingResource::TextureView(view)
}
