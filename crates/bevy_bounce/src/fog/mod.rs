//! Bounced light in volumetric fog.
//!
//! Bevy's volumetric fog scatters the light of lamps with `VolumetricLight`, and an even ambient term that stands for
//! bounced light. On cameras with [`GlobalIllumination`](crate::GlobalIllumination) and virtual lights that term is
//! left out, and what the fog scatters of bounced light is added to the picture:
//!
//! 1. `fog/froxels.wgsl` divides the view into froxels: columns and rows of the picture, and slices by distance. At
//!    each it sums up what comes to the eye of the light of all virtual lights and of the sky, with their visibility
//!    and by the phase function that `FogVolume::scattering_asymmetry` states, as Bevy has it for lamps.
//! 2. `fog/scatter.wgsl` marches through each `FogVolume` as Bevy does, in the same order, and reads the froxels: what
//!    one volume scatters is dimmed by those that Bevy draws over it.
//! 3. `fog/add.wgsl` adds the sum to the picture, once Bevy has drawn its fog and before temporal anti-aliasing and what runs on finished
//!    pictures. As with Bevy's own, what is blended lies behind all fog before the next opaque surface.
//!
//! `FogVolume::fog_color`, `light_tint` and `light_intensity` count for bounced light as for lamps.
//!
//! # Data
//!
//! | data | bytes at 1280x720 and 20 probes | holds |
//! |---|---|---|
//! | froxels | 288 KiB for each asymmetry that the volumes of a view have | what fog there scatters to the eye, a half float colour, pre-exposed |
//! | light | 7 MiB | what all volumes scatter, and what they take of the light behind |
//!
//! There are twice as many froxels along the picture's longer edge, and slices, as
//! [`GiSettings::probes`](crate::GiSettings::probes) states, and none where that is 0. Slices lie between the nearest
//! and the farthest volume that the view looks at, and become thicker with distance.
//!
//! # Cost
//!
//! A sum over all virtual lights a froxel: at 16:9, 20 probes and 2048 lights 75 million lookups, whatever the
//! picture's size, for each asymmetry; about as many as shading takes at half resolution for a picture of 1920x1080.
//! `VolumetricFog::step_count` steps a pixel and volume, of two lookups each. Without fog, none.
//!
//! # What it cannot do
//!
//! It is as fine as its froxels: at the edges of what is near, light of before it mixes with light of behind. A froxel
//! behind what is seen in the middle of its column takes the light where pixels beside that see as far. Fog takes
//! nothing from the light that surfaces send to each other.
//!
//! The sky's light comes from [`GiSettings::sky`](crate::GiSettings::sky) directions, and is scattered no more straight
//! on than these are apart: of a bright part of the sky fog shows a wider and dimmer glow than of a lamp.
//!
//! What is scattered in one direction comes from few lights, which shows where they are sparse. Beside traced paths at
//! fifty points of the Cornell box all are within 15 % at a `FogVolume::scattering_asymmetry` of 0, 49 at 0.5 and 48 at
//! 0.8, Bevy's default, with [`Quality::High`](crate::Quality::High); the others are near dim surfaces; with
//! [`Quality::Ultra`](crate::Quality::Ultra) all of them
//! (`cargo test --workspace --test suite -- fog_at_a_point --include-ignored --nocapture`).
//!
//! Bevy dims what comes to fog by the radius of its volume, which leaves little in large and dense ones; so it is here.
//! It gives the light of point and spot lights no phase function, so that fog shows 4 pi times as much of it as of
//! bounced light that is as bright.
//!
//! Bevy draws no fog at all while no light is a `VolumetricLight`, and without virtual lights, or where `probes` is 0, the picture is
//! Bevy's. [`GiIsolate`](crate::GiIsolate) leaves out all that is added here.

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

/// Lights volumetric fog; see the [module](self).
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
