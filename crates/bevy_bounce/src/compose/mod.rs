//! Into the picture: direct light, bounced light, emission and fog.
//!
//! On cameras with [`GlobalIllumination`] this replaces Bevy's deferred lighting:
//!
//! 1. `surface` packs depth and normal of Bevy's G-buffer for the passes of a view.
//! 2. `direct` lights with Bevy's own functions, and keeps the diffuse part aside. Its pipelines know the kinds of lights that there are.
//! 3. Bounced light is shaded, compensated and averaged over frames.
//! 4. Where Bevy's screen-space reflections are on, what they will show is taken from glossy light and from the mirrored sky.
//! 5. `compose` adds up: direct + indirect * diffuse colour * occlusion + emission, then fog, before screen-space
//!    reflections and everything drawn forward. Where the sky bounces by virtual lights, what surfaces mirror of an environment map,
//!    or of ambient light that is the sky, is added in proportion to what of the sky they see.
//!
//! Bevy's ambient light and irradiance volumes are left out, for they stand for the bounced light that is computed
//! here; lightmaps, which Bevy's G-buffer carries as emission, stay, and where they are, diffuse bounced light is left
//! out. Emission shows as in Bevy's deferred path, without exposure. While its own pipelines are compiled, and should
//! they fail, Bevy's lighting runs; while those of a technique are, bounced light is missing.

mod extract;
mod light_kinds;
mod lightmapped;
mod masked;
mod passes;
mod pipelines;
mod reflections;

use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::pbr::deferred::{deferred_lighting, prepare_deferred_lighting_pipelines};
use bevy::pbr::{MeshPipelineSystems, prepare_ssr_pipelines, screen_space_reflections};
use bevy::prelude::*;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::render_resource::{SpecializedMeshPipelines, SpecializedRenderPipelines};
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

pub(crate) use extract::{extract_views, hand_back_resets};
pub(crate) use lightmapped::LightmappedInView;
pub(crate) use pipelines::EnvironmentMaps;

use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_components;
use crate::view::{ViewTextures, prepare_view_textures};
use crate::{GiSystems, GlobalIllumination, camera};

/// What the picture of this camera holds; for looking at one term alone.
#[derive(Component, ExtractComponent, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[reflect(Component, Default, Debug, Clone, PartialEq, Hash)]
pub enum GiIsolate {
    /// Everything.
    #[default]
    All,
    /// What Bevy lights by itself, and emission.
    Direct,
    /// Bounced light alone: no sky, fog, forward or blended surfaces.
    Indirect,
    /// The same without bias compensation.
    Bounded,
    /// What bias compensation adds to it.
    Residual,
    /// [`Bounded`](Self::Bounded) in the left half, [`Indirect`](Self::Indirect) in the right.
    Split,
    /// Bounced light that is reflected glossily, where [`RadianceCacheSettings::glossy`](crate::RadianceCacheSettings::glossy) or
    /// [`CssmSettings::glossy`](crate::CssmSettings::glossy) or the technique has it.
    Glossy,
    /// Bounced light as it falls on surfaces, whatever their colour: irradiance over pi.
    Irradiance,
    /// Colours of the voxels, as rays of the camera through the grid meet them: the planes of the cells, as paths and shadows do.
    VoxelAlbedo,
    /// Their normals: -1 to 1 as 0 to 1, by red, green and blue for x, y and z.
    VoxelNormal,
    /// Light that they send, as radiance caches see it. Lights the voxels, whatever the technique.
    VoxelLight,
    /// The levels that cones of radiance caches march through, light and coverage: bands side by side, the finest on
    /// the left, each of the next with texels twice as wide. Those of the world, without
    /// [`VoxelizedGroup`](crate::VoxelizedGroup)s. Lights the voxels, whatever the technique.
    VoxelLevels,
    /// Shadow maps of the virtual lights, tile by tile in the order of their list: white is near, blue is empty.
    ShadowAtlas,
    /// Clusters of pixels that share a radiance cache, each in a colour of its own; where the caches are, white.
    Clusters,
    /// What the radiance caches hold, one after the other in rows: the light from the 16x16 directions of a hemisphere; below, the same
    /// convolved by three roughnesses and by a cosine.
    Caches,
    /// How many nodes of baked objects' hierarchies each pixel gathers from: 0 black, 1 blue, 8 cyan, 64 green, 512 yellow, 4096 and
    /// more red.
    CutSize,
    /// The hierarchies of baked objects' texels: every node's first half is dark and its second half bright, the roots' in red, the next
    /// level's in green, then blue, then red half as much, and so on. What is not baked is black.
    TreeLevels,
    /// The atlases of baked objects with the light that their texels send, object by object in rows.
    BakedAtlas,
}

impl GiIsolate {
    /// Whether it is drawn over the finished picture.
    pub(crate) fn is_alone(self) -> bool {
        !matches!(self, Self::All | Self::Direct)
    }

    /// Whether it is no light of the picture, but a [picture](crate::debug) of an intermediate.
    pub(crate) fn is_picture(self) -> bool {
        use GiIsolate::{BakedAtlas, Caches, Clusters, CutSize, ShadowAtlas, TreeLevels, VoxelAlbedo, VoxelNormal};
        let of_voxels = matches!(self, VoxelAlbedo | VoxelNormal) || self.shows_voxel_light();
        of_voxels || matches!(self, ShadowAtlas | Clusters | Caches | CutSize | TreeLevels | BakedAtlas)
    }

    /// Whether it shows the light of the voxels.
    pub(crate) fn shows_voxel_light(self) -> bool {
        matches!(self, Self::VoxelLight | Self::VoxelLevels)
    }
}

/// Passes of a view, in order; all but the last within [`Core3dSystems::MainPass`].
#[derive(SystemSet, Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub enum ViewPass {
    /// Depth and normal are packed, `indirect` is cleared.
    Surface,
    /// Direct light; what has a lightmap is marked.
    Direct,
    /// Bounced light into `indirect`.
    Shade,
    /// Where radiance caches are.
    CacheDistribution,
    /// What they hold.
    CacheCreation,
    /// Glossy light from them; with [`Technique::RadianceCache`](crate::Technique::RadianceCache) `indirect`, too.
    CacheEvaluation,
    /// What bounding took from it is added.
    Compensate,
    /// It is averaged over frames.
    History,
    /// What screen-space reflections will show is taken from glossy light and the mirrored sky.
    Reflections,
    /// Into the picture.
    Compose,
    /// Something alone over the picture, after the main pass, where [`GiIsolate`] asks for it.
    Isolate,
}

/// Replaces Bevy's deferred lighting on cameras with [`GlobalIllumination`].
pub struct GiComposePlugin;

impl Plugin for GiComposePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GlobalIllumination>().register_type::<GiIsolate>();
    }

    fn finish(&self, app: &mut App) {
        camera::finish(app);
        if !camera::device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .init_gpu_resource::<SpecializedRenderPipelines<pipelines::ComposePipelines>>()
            .init_gpu_resource::<reflections::WithoutEnvironmentMaps>()
            .init_gpu_resource::<SpecializedMeshPipelines<lightmapped::LightmappedPipeline>>()
            .init_resource::<lightmapped::Lightmapped>()
            .add_systems(
                RenderStartup,
                (
                    pipelines::init_compose_pipelines.after(MeshPipelineSystems),
                    lightmapped::init_lightmapped_pipeline,
                    forget_components::<ViewTextures>,
                    forget_components::<LightmappedInView>,
                ),
            )
            .add_systems(ExtractSchedule, (extract_views, lightmapped::extract_lightmapped))
            .add_systems(
                Render,
                (
                    pipelines::prepare_compose_pipelines
                        .in_set(RenderSystems::Prepare)
                        .after(GiSystems::PrepareScene)
                        .before(prepare_deferred_lighting_pipelines),
                    reflections::take_environment_maps_from_reflections
                        .in_set(RenderSystems::Prepare)
                        .after(pipelines::prepare_compose_pipelines)
                        .after(prepare_ssr_pipelines),
                    masked::draw_masked_surfaces_once
                        .after(RenderSystems::PrepareAssets)
                        .before(RenderSystems::Specialize),
                    lightmapped::prepare_lightmapped.in_set(GiSystems::Prepare),
                    prepare_view_textures.in_set(GiSystems::Prepare).after(pipelines::prepare_compose_pipelines),
                ),
            );
        add_passes(render_app);
    }
}

/// The passes of a view, and their places in Bevy's schedule; those of other stages come into the same sets.
fn add_passes(render_app: &mut SubApp) {
    render_app
        .configure_sets(
            Core3d,
            (
                ViewPass::Surface,
                ViewPass::Direct,
                ViewPass::Shade,
                ViewPass::CacheDistribution,
                ViewPass::CacheCreation,
                ViewPass::CacheEvaluation,
                ViewPass::Compensate,
                ViewPass::History,
                ViewPass::Reflections,
                ViewPass::Compose,
            )
                .chain()
                .in_set(Core3dSystems::MainPass)
                .after(deferred_lighting)
                .before(screen_space_reflections)
                .before(main_opaque_pass_3d),
        )
        .configure_sets(
            Core3d,
            ViewPass::Isolate.after(Core3dSystems::MainPass).before(Core3dSystems::EarlyPostProcess),
        )
        .add_systems(
            Core3d,
            (
                passes::surface_pass.in_set(ViewPass::Surface),
                (passes::direct_pass, lightmapped::lightmapped_pass).chain().in_set(ViewPass::Direct),
                reflections::reflections_pass.in_set(ViewPass::Reflections),
                passes::compose_pass.in_set(ViewPass::Compose),
                passes::isolate_pass.in_set(ViewPass::Isolate),
            ),
        );
}
