//! Bounced light in volumetric fog.
//!
//! Bevy's volumetric fog scatters the light of lamps with `VolumetricLight`, and an even ambient term that stands for bounced light. On
//! cameras with [`GlobalIllumination`](crate::GlobalIllumination) and light probes that term is left out, and what the fog scatters
//! of the light that [probes](crate::probes) know is added to the picture:
//!
//! 1. `fog/scatter.wgsl` marches through each `FogVolume` as Bevy does, in the same order: what one scatters is dimmed by those that Bevy draws
//!    over it.
//! 2. `fog/add.wgsl` adds the sum to the picture, once Bevy has drawn its fog and before temporal anti-aliasing and what runs on finished
//!    pictures. As with Bevy's own, what is blended lies behind all fog before the next opaque surface.
//!
//! `FogVolume::fog_color`, `light_tint` and `light_intensity` count for bounced light as for lamps.
//!
//! # Cost
//!
//! `VolumetricFog::step_count` steps a pixel and volume, of six lookups each, and 8 bytes a pixel; the [probes](crate::probes), which are then lit in
//! every frame. Without fog, none.
//!
//! # What it cannot do
//!
//! It is as fine as the probes. Beyond the outermost ones there is their light. Fog takes nothing from the light that surfaces send to each other.
//!
//! Six directions tell what fog scatters evenly, not what it scatters in one direction: beside traced paths at fifty points of the Cornell
//! box, all are within 15 % at a `FogVolume::scattering_asymmetry` of 0, 47 at 0.5, and 22 at 0.8, Bevy's default; their means within 2 %
//! (`cargo test --workspace --test suite -- fog_at_a_point --nocapture`).
//!
//! Bevy dims what comes to fog by the radius of its volume, which leaves little in large and dense ones; so it is here. It gives the light of point and spot
//! lights no phase function, so that fog shows 4 pi times as much of it as of bounced light that is as bright.
//!
//! Bevy draws no fog at all while no light is a `VolumetricLight`, and no other technique than those with virtual lights has probes: there
//! the picture is Bevy's, as on the web, where Bevy reads no irradiance volumes. [`GiIsolate`](crate::GiIsolate) leaves out all that is added here.

mod extract;
mod passes;
mod pipelines;
mod prepare;

use bevy::anti_alias::taa::temporal_anti_alias;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::render_resource::SpecializedRenderPipelines;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};

use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_components;

pub(crate) use prepare::LitFog;

/// Lights volumetric fog; see the [module](self). Needs [`ProbeVolumePlugin`](crate::ProbeVolumePlugin).
pub struct GiFogPlugin;

impl Plugin for GiFogPlugin {
    fn build(&self, _: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .init_gpu_resource::<SpecializedRenderPipelines<pipelines::FogPipelines>>()
            .init_gpu_resource::<prepare::FogUniforms>()
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_components::<LitFog>))
            .add_systems(ExtractSchedule, extract::extract_fog)
            .add_systems(
                Render,
                (
                    prepare::take_over_from_ambient_light.in_set(RenderSystems::PrepareViews),
                    prepare::prepare_fog.in_set(RenderSystems::PrepareResources),
                ),
            )
            // Anti-aliasing puts another texture in the picture's place: what is added at the same time may be lost.
            .add_systems(Core3d, passes::fog_pass.in_set(Core3dSystems::EarlyPostProcess).before(temporal_anti_alias));
    }
}
