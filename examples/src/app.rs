//! The Bevy app around a scene: same plugins with a window and without.

use std::path::PathBuf;

use bevy::app::TerminalCtrlCHandlerPlugin;
use bevy::asset::UnapprovedPathMode;
use bevy::log::{Level, LogPlugin};
use bevy::pbr::DefaultOpaqueRendererMethod;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::window::{ExitCondition, WindowResolution};
use bevy::winit::WinitPlugin;
use bevy_bounce::{GiGizmos, GlobalIlluminationPlugins};
use bevy_bounce_egui::BouncePanelPlugin;

use crate::stage_clock::StageClockPlugin;
use crate::{Error, Run, adapter, camera, capture, headless, window};

/// Builds the app, adds `scene`, and runs it as `run` asks. `assets` is the folder that asset paths start from.
pub fn launch(run: Run, assets: Option<PathBuf>, scene: impl FnOnce(&mut App)) -> Result<(), Error> {
    adapter::check(&adapter::settings(run.webgpu_limits))?;
    if run.headless {
        let mut app = build(&run, assets);
        scene(&mut app);
        headless::drive(app, &run)
    } else {
        window::check_display()?;
        let mut app = build(&run, assets);
        app.add_plugins(window::WindowPlugin);
        scene(&mut app);
        match app.run() {
            AppExit::Success => Ok(()),
            AppExit::Error(code) => Err(Error::Render(format!("the renderer stopped with status {code}, see above"))),
        }
    }
}

/// The app without a scene. Windowless ones neither poll a window system nor pipeline their frames, and compile every
/// shader before they use it, so that a frame is finished when `update` returns and the next is the same.
pub fn build(run: &Run, assets: Option<PathBuf>) -> App {
    let mut app = App::new();
    let mut plugins = DefaultPlugins
        .set(LogPlugin {
            level: Level::WARN,
            // A software adapter and low limits are choices here, not mistakes.
            filter: format!("{},bevy_render::renderer=error,bevy_pbr::ssao=error", bevy::log::DEFAULT_FILTER),
            ..default()
        })
        .set(RenderPlugin {
            render_creation: adapter::settings(run.webgpu_limits).into(),
            synchronous_pipeline_compilation: run.headless,
            ..default()
        })
        .set(bevy::window::WindowPlugin {
            primary_window: (!run.headless).then(|| Window {
                title: "bevy_bounce".into(),
                resolution: WindowResolution::new(run.size.x, run.size.y),
                ..default()
            }),
            exit_condition: if run.headless { ExitCondition::DontExit } else { ExitCondition::OnPrimaryClosed },
            ..default()
        })
        .set(AssetPlugin {
            file_path: assets.map_or("assets".into(), |folder| folder.to_string_lossy().into_owned()),
            unapproved_path_mode: UnapprovedPathMode::Allow,
            ..default()
        });
    if run.headless {
        plugins = plugins
            .disable::<WinitPlugin>()
            .disable::<PipelinedRenderingPlugin>()
            .disable::<TerminalCtrlCHandlerPlugin>();
    }
    app.add_plugins(plugins);
    if run.plain_bevy {
        app.insert_resource(DefaultOpaqueRendererMethod::deferred());
    } else {
        app.add_plugins(if run.forward {
            GlobalIlluminationPlugins::forward()
        } else {
            GlobalIlluminationPlugins::default()
        });
        app.insert_resource(GiGizmos { virtual_lights: run.gizmos, ..default() });
        if run.panel || !run.headless {
            app.add_plugins(BouncePanelPlugin { open: run.panel, ..default() });
        }
    }
    app.insert_resource(run.clone())
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(GlobalAmbientLight::NONE)
        .add_plugins((camera::CameraPlugin, capture::CapturePlugin));
    let budget = run.illumination.as_ref().is_some_and(|illumination| illumination.budget.is_some());
    if (run.stats.is_some() || budget) && !app.is_plugin_added::<RenderDiagnosticsPlugin>() {
        app.add_plugins(RenderDiagnosticsPlugin);
    }
    if run.stats.is_some() && !run.plain_bevy {
        app.add_plugins(StageClockPlugin);
    }
    app
}
