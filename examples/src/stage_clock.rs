//! Stage times on a software adapter, whose timestamps tell little: lavapipe runs a dispatch when it is recorded and draws
//! later, so that the times of a stage are another's.
//!
//! Between stages everything recorded is submitted and waited for, and wall time is taken. That costs a little overlap, so
//! it is done in frames of its own, which count neither for the frame time nor for the picture.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems, camera_driver};
use bevy::ecs::schedule::ApplyDeferred;
use bevy::pbr::deferred::deferred_lighting;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::PollType;
use bevy::render::renderer::{FlushCommands, RenderAdapterInfo, RenderDevice, RenderGraph, RenderGraphSystems};
use bevy_bounce::{GiSystems, ViewPass};

use crate::{Error, headless};

/// Frames to measure, at most.
const FRAMES: usize = 16;

/// Adds a [`StageClock`], which stands still until [`measure`].
pub struct StageClockPlugin;

/// Milliseconds by stage, one for each frame and summed over its views; shared by both worlds.
#[derive(Resource, Clone, Default)]
pub struct StageClock(Arc<Mutex<Times>>);

#[derive(Default)]
struct Times {
    running: bool,
    last: Option<Instant>,
    frame: BTreeMap<&'static str, f64>,
    stages: BTreeMap<&'static str, Vec<f64>>,
}

impl StageClock {
    fn times(&self) -> MutexGuard<'_, Times> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What was measured; empty on hardware, which has timestamps.
    pub fn stages(&self) -> BTreeMap<&'static str, Vec<f64>> {
        self.times().stages.clone()
    }
}

impl Plugin for StageClockPlugin {
    fn build(&self, app: &mut App) {
        let clock = StageClock::default();
        app.insert_resource(clock.clone());
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        let world =
            |stage| (ApplyDeferred, mark(stage)).chain().in_set(RenderGraphSystems::Render).before(camera_driver);
        let view = |stage| (ApplyDeferred, mark(stage)).chain().in_set(Core3dSystems::MainPass);
        render_app
            .insert_resource(clock)
            .add_systems(
                RenderGraph,
                (
                    world(None).before(GiSystems::Scene),
                    world(Some("scene")).after(GiSystems::Scene).before(GiSystems::Voxelize),
                    world(Some("voxelize")).after(GiSystems::Voxelize).before(GiSystems::VplTrace),
                    world(Some("vpl_trace")).after(GiSystems::VplTrace).before(GiSystems::ShadowAtlas),
                    world(Some("shadow_atlas")).after(GiSystems::ShadowAtlas).before(GiSystems::Probes),
                    world(Some("probes")).after(GiSystems::Probes).before(GiSystems::VoxelLight),
                    world(Some("voxel_light")).after(GiSystems::VoxelLight),
                ),
            )
            .add_systems(
                Core3d,
                (
                    view(None).after(deferred_lighting).before(ViewPass::Surface),
                    view(Some("gbuffer")).after(ViewPass::Surface).before(ViewPass::Direct),
                    view(Some("direct")).after(ViewPass::Direct).before(ViewPass::Shade),
                    view(Some("interleaved")).after(ViewPass::Shade).before(ViewPass::CacheDistribution),
                    view(Some("cache_distribution")).after(ViewPass::CacheDistribution).before(ViewPass::CacheCreation),
                    view(Some("cache_creation")).after(ViewPass::CacheCreation).before(ViewPass::CacheEvaluation),
                    view(Some("cache_evaluation")).after(ViewPass::CacheEvaluation).before(ViewPass::Compensate),
                    view(Some("ssbc")).after(ViewPass::Compensate).before(ViewPass::History),
                    view(Some("history")).after(ViewPass::History).before(ViewPass::Reflections),
                    view(Some("reflections")).after(ViewPass::Reflections).before(ViewPass::Compose),
                    view(Some("compose")).after(ViewPass::Compose).before(main_opaque_pass_3d),
                ),
            );
    }
}

/// Ends `stage`, and begins the next; `None` only begins.
fn mark(stage: Option<&'static str>) -> impl Fn(FlushCommands, Res<RenderDevice>, Res<StageClock>) {
    move |mut commands, device, clock| {
        let mut times = clock.times();
        if !times.running {
            return;
        }
        commands.flush();
        // A lost device shows in the frame itself.
        let _ = device.poll(PollType::wait_indefinitely());
        let now = Instant::now();
        let last = times.last.replace(now);
        if let Some((stage, last)) = stage.zip(last) {
            *times.frame.entry(stage).or_default() += (now - last).as_secs_f64() * 1e3;
        }
    }
}

/// Renders up to `frames` more frames and takes the times of their stages, where the adapter is software.
pub fn measure(app: &mut App, frames: usize) -> Result<(), Error> {
    let software =
        app.world().get_resource::<RenderAdapterInfo>().is_some_and(|info| info.device_type == wgpu::DeviceType::Cpu);
    let Some(clock) = app.world().get_resource::<StageClock>().filter(|_| software).cloned() else { return Ok(()) };
    clock.times().running = true;
    let measured = (0..frames.min(FRAMES)).try_for_each(|_| {
        headless::frame(app, Duration::ZERO)?;
        let mut times = clock.times();
        for (stage, time) in std::mem::take(&mut times.frame) {
            times.stages.entry(stage).or_default().push(time);
        }
        Ok(())
    });
    clock.times().running = false;
    measured
}
