//! Runs without a window: warm up, step animation time, time the frames, capture.

use std::time::{Duration, Instant};

use bevy::app::PluginsState;
use bevy::camera::Exposure;
use bevy::diagnostic::DiagnosticsStore;
use bevy::prelude::*;
use bevy::render::RenderApp;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache, PollType};
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_bounce_egui::Counts;

use crate::capture::{self, CaptureScene, Targets};
use crate::metering::{Metered, exposure_for};
use crate::{Error, Run, stage_clock, stats};

/// Frames in a row without a waiting asset, a waiting or a new pipeline that count as warm.
const CALM_FRAMES: u32 = 2;
/// Warm-up gives up after this long: a big scene on a software adapter takes a minute or two.
const PATIENCE: Duration = Duration::from_secs(600);

/// What still keeps a scene from being complete; windowless runs wait until it is empty.
///
/// Systems that load assets add a line and take it away when what they loaded is spawned.
#[derive(Resource, Default, Debug)]
pub struct Pending(Vec<String>);

/// What went wrong in a system; ends the run.
#[derive(Resource, Default, Debug)]
pub struct Failed(Option<Error>);

impl Pending {
    /// One more thing to wait for.
    pub fn add(&mut self, what: impl Into<String>) {
        self.0.push(what.into());
    }

    /// No longer wait for it.
    pub fn done(&mut self, what: &str) {
        self.0.retain(|pending| pending != what);
    }
}

impl Failed {
    /// Ends the run; the first error is the one that is reported.
    pub fn set(&mut self, error: Error) {
        self.0.get_or_insert(error);
    }

    /// The error to report, if any.
    pub fn take(&mut self) -> Option<Error> {
        self.0.take()
    }
}

/// Runs the app as `run` asks, and writes its pictures and statistics.
pub fn drive(mut app: App, run: &Run) -> Result<(), Error> {
    warm_up(&mut app)?;
    meter(&mut app, run)?;
    fill_panel(&mut app)?;
    if let Some(mut diagnostics) = app.world_mut().get_resource_mut::<DiagnosticsStore>() {
        diagnostics.iter_mut().for_each(|diagnostic| diagnostic.clear_history());
    }
    let mut times = Vec::with_capacity(run.steps.len());
    for (index, step) in run.steps.iter().enumerate() {
        if index + 1 == run.steps.len() {
            capture_scene(&mut app);
        }
        times.push(frame(&mut app, *step)?);
    }
    capture::write(&mut app, run)?;
    match &run.stats {
        Some(path) => {
            stage_clock::measure(&mut app, times.len())?;
            stats::write(&mut app, run, &times, path)
        }
        None => Ok(()),
    }
}

/// Finishes the app's plugins and renders at time zero until every asset is there and every pipeline is compiled.
pub fn warm_up(app: &mut App) -> Result<(), Error> {
    app.init_resource::<Pending>().init_resource::<Failed>();
    while app.plugins_state() == PluginsState::Adding {
        bevy::tasks::tick_global_task_pools_on_main_thread();
    }
    app.finish();
    app.cleanup();
    // Steps are as long as asked for, not shortened to what a game may want at most.
    app.world_mut().resource_mut::<Time<Virtual>>().set_max_delta(Duration::from_secs(1_000_000));
    settle(app, CALM_FRAMES)
}

/// Renders at the time there is until so many frames in a row needed nothing new.
pub fn settle(app: &mut App, calm_frames: u32) -> Result<(), Error> {
    let (begin, mut calm, mut known) = (Instant::now(), 0, pipelines(app)?.pipelines().count());
    while calm < calm_frames {
        frame(app, Duration::ZERO)?;
        let waiting = waiting(app, &mut known)?;
        calm = if waiting.is_none() { calm + 1 } else { 0 };
        if let Some(waiting) = waiting.filter(|_| begin.elapsed() > PATIENCE) {
            return Err(Error::Render(format!(
                "not ready after {} s: still waiting for {waiting}",
                PATIENCE.as_secs()
            )));
        }
    }
    Ok(())
}

fn pipelines(app: &App) -> Result<&PipelineCache, Error> {
    let render_app = app.get_sub_app(RenderApp).ok_or_else(|| Error::Adapter("the renderer did not start".into()))?;
    Ok(render_app.world().resource::<PipelineCache>())
}

/// What is not there yet; `known`: how many pipelines there were a frame ago.
fn waiting(app: &App, known: &mut usize) -> Result<Option<String>, Error> {
    if let Some(pending) = app.world().resource::<Pending>().0.first() {
        return Ok(Some(pending.clone()));
    }
    let cache = pipelines(app)?;
    let waiting = cache.waiting_pipelines().count();
    if waiting > 0 {
        return Ok(Some(format!("{waiting} shader pipelines")));
    }
    for pipeline in cache.pipelines() {
        if let CachedPipelineState::Err(error) = &pipeline.state {
            let error = error.to_string().lines().map(str::trim).collect::<Vec<_>>().join(" ");
            return Err(Error::Render(format!("a shader pipeline does not compile: {error}")));
        }
    }
    let before = std::mem::replace(known, cache.pipelines().count());
    Ok((*known > before).then(|| format!("{} new shader pipelines", *known - before)))
}

/// Renders one frame to its end, `step` later in animation time, and says how long it took.
pub fn frame(app: &mut App, step: Duration) -> Result<Duration, Error> {
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let begin = Instant::now();
    app.update();
    let device = app.world().get_resource::<RenderDevice>().cloned();
    if let Some(device) = device {
        let polled = device.poll(PollType::wait_indefinitely());
        polled.map_err(|error| Error::Render(format!("the device stopped: {error}")))?;
    }
    let elapsed = begin.elapsed();
    if let Some(error) = app.world_mut().get_resource_mut::<Failed>().and_then(|mut failed| failed.take()) {
        return Err(error);
    }
    match app.should_exit() {
        Some(AppExit::Error(_)) => Err(Error::Render("the renderer stopped, see above".into())),
        _ => Ok(elapsed),
    }
}

fn capture_scene(app: &mut App) {
    let scene = app.world().resource::<Targets>().scene.clone();
    let mut cameras = app.world_mut().query_filtered::<Entity, With<Camera3d>>();
    let cameras: Vec<Entity> = cameras.iter(app.world()).collect();
    for camera in cameras {
        app.world_mut().entity_mut(camera).insert(CaptureScene(scene.clone()));
    }
}

/// Counts what the panel shows, where there is one, and lets it be laid out.
fn fill_panel(app: &mut App) -> Result<(), Error> {
    let Some(counts) = app.world().get_resource::<Counts>() else { return Ok(()) };
    counts.want();
    (0..2).try_for_each(|_| frame(app, Duration::ZERO).map(drop))
}

/// Chooses the exposure of [`Metered`] cameras.
fn meter(app: &mut App, run: &Run) -> Result<(), Error> {
    let mut cameras = app.world_mut().query_filtered::<Entity, (With<Camera3d>, With<Metered>)>();
    let cameras: Vec<Entity> = cameras.iter(app.world()).collect();
    if run.exposure.is_some() || cameras.is_empty() {
        return Ok(());
    }
    capture_scene(app);
    frame(app, Duration::ZERO)?;
    let ev100 = exposure_for(&capture::luminances(app)?);
    for camera in cameras {
        let mut camera = app.world_mut().entity_mut(camera);
        camera.remove::<CaptureScene>();
        if let Some(ev100) = ev100 {
            camera.insert(Exposure { ev100 });
        }
    }
    for _ in 0..2 {
        frame(app, Duration::ZERO)?;
    }
    Ok(())
}
