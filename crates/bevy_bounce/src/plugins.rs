//! The plugin group, and the order of the frame.

use bevy::app::{PluginGroupBuilder, SubApp};
use bevy::core_pipeline::schedule::camera_driver;
use bevy::prelude::*;
use bevy::render::renderer::{RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, Render, RenderSystems};

use crate::compose::{extract_views, hand_back_resets};
use crate::settings::{GiWorldSettings, StatedLights, extract_world_settings};
use crate::{
    AvgPlugin, BudgetPlugin, CssmPlugin, GiComposePlugin, GiDebugPlugin, GiFogPlugin, GiForwardPlugin, GiScenePlugin,
    HistoryPlugin, InterleavedShadingPlugin, ProbeVolumePlugin, RadianceCachePlugin, ShadowAtlasPlugin, SsbcPlugin,
    VplPlugin,
};

/// Everything a game needs for bounced light; each plugin can be disabled on its own.
///
/// | plugin | what it does | without it |
/// |---|---|---|
/// | [`GiScenePlugin`] | scene on the GPU: meshes, materials, lights | nothing bounces |
/// | [`AvgPlugin`] | voxel grid | nothing bounces |
/// | [`VplPlugin`] | virtual point lights | nothing bounces |
/// | [`ShadowAtlasPlugin`] | what virtual point lights see | they see by rays through the grid |
/// | [`ProbeVolumePlugin`] | bounced light on transparent and forward-rendered surfaces | none there |
/// | [`GiFogPlugin`] | bounced light in volumetric fog | Bevy's ambient term there |
/// | [`InterleavedShadingPlugin`] | indirect light per pixel | nothing bounces |
/// | [`SsbcPlugin`] | gives back what bounding took from the indirect light | corners are darker |
/// | [`RadianceCachePlugin`] | glossy light; `Technique::RadianceCache` | neither |
/// | [`CssmPlugin`] | light from baked objects | `Technique::SurfaceRadiosity` bounces nothing |
/// | [`HistoryPlugin`] | averages bounced light over frames | each frame by itself |
/// | [`BudgetPlugin`] | follows [`GlobalIllumination::budget`](crate::GlobalIllumination::budget) | quality stays as stated |
/// | [`GiDebugPlugin`] | pictures of intermediates, gizmos: see [`debug`](crate::debug) | neither |
/// | [`GiComposePlugin`] | into the picture | Bevy's own picture |
#[derive(Default)]
pub struct GlobalIlluminationPlugins {
    forward: bool,
}

impl GlobalIlluminationPlugins {
    /// For apps that stay forward: Bevy draws opaque materials as it does by itself, with MSAA, and lights them; bounced light comes from
    /// the volume of light probes alone. It costs no more the larger the picture, and is only as fine as the probes:
    /// [`GiSettings::probes`](crate::GiSettings::probes). Neither bias compensation nor glossy light nor baked objects, and
    /// [`GiIsolate`](crate::GiIsolate) does nothing.
    pub fn forward() -> Self {
        Self { forward: true }
    }
}

impl PluginGroup for GlobalIlluminationPlugins {
    fn build(self) -> PluginGroupBuilder {
        let group = PluginGroupBuilder::start::<Self>()
            .add(GiScenePlugin)
            .add(AvgPlugin)
            .add(VplPlugin)
            .add(ShadowAtlasPlugin)
            .add(ProbeVolumePlugin)
            .add(GiFogPlugin)
            .add(BudgetPlugin)
            .add(GiDebugPlugin);
        if self.forward {
            return group.add(GiForwardPlugin);
        }
        group
            .add(InterleavedShadingPlugin)
            .add(SsbcPlugin)
            .add(RadianceCachePlugin)
            .add(CssmPlugin)
            .add(HistoryPlugin)
            .add(GiComposePlugin)
    }
}

/// Order of the render world's stages.
///
/// `PrepareScene` and `Prepare` run in `RenderSystems::PrepareResources`; the others are passes in `RenderGraph`, chained,
/// before any camera.
#[derive(SystemSet, Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub enum GiSystems {
    /// Scene buffers are uploaded.
    PrepareScene,
    /// Grid, virtual lights and view textures are allocated; follows `PrepareScene`.
    Prepare,
    /// Deformed vertices and material thumbnails are written.
    Scene,
    /// The voxel grid is built.
    Voxelize,
    /// Virtual point lights are traced.
    VplTrace,
    /// Their shadow maps are drawn.
    ShadowAtlas,
    /// The volume of light probes is lit.
    Probes,
    /// The voxels are lit, and their light is filtered.
    VoxelLight,
    /// Texels of baked objects are lit.
    Cssm,
}

/// Orders the stages; every plugin of the group calls it, so that each works without the others.
pub(crate) fn configure_stages(render_app: &mut SubApp) {
    if !render_app.world().contains_resource::<GiWorldSettings>() {
        render_app
            .init_resource::<GiWorldSettings>()
            .init_resource::<StatedLights>()
            .add_systems(ExtractSchedule, (extract_world_settings, hand_back_resets.after(extract_views)));
    }
    render_app
        .configure_sets(
            Render,
            (GiSystems::PrepareScene, GiSystems::Prepare).chain().in_set(RenderSystems::PrepareResources),
        )
        .configure_sets(
            RenderGraph,
            (
                GiSystems::Scene,
                GiSystems::Voxelize,
                GiSystems::VplTrace,
                GiSystems::ShadowAtlas,
                GiSystems::Probes,
                GiSystems::VoxelLight,
                GiSystems::Cssm,
            )
                .chain()
                .in_set(RenderGraphSystems::Render)
                .before(camera_driver),
        );
}
