//! What the examples share: options, windows and windowless runs, capture, statistics, glTF loading, generated scenes.
//!
//! An example is a `main` that hands [`launch`] a name and the systems that build its scene. The options of [`Options`]
//! come with it: a window by default, `--output FILE` for a picture without one.

pub mod adapter;
pub mod app;
pub mod baked;
pub mod camera;
pub mod capture;
pub mod error;
pub mod glb;
pub mod gltf;
pub mod headless;
pub mod metering;
pub mod options;
pub mod run;
pub mod scenes;
pub mod stage_clock;
pub mod stats;
pub mod window;

use std::process::ExitCode;

use bevy::prelude::App;
use clap::Parser;

use options::TechniqueOption;

pub use error::Error;
pub use options::Options;
pub use run::Run;

#[derive(Parser)]
#[command(version)]
struct Cli {
    #[command(flatten)]
    options: Options,
}

/// Runs an example: reads the command line, adds `scene` to the app, opens a window or writes pictures.
///
/// `scene` adds the systems that spawn a camera, lights and meshes.
pub fn launch(name: &'static str, scene: impl FnOnce(&mut App)) -> ExitCode {
    launch_with(name, |_| {}, scene)
}

/// The same, with what the example chooses where the command line does not.
pub fn launch_with(name: &'static str, choose: impl FnOnce(&mut Options), scene: impl FnOnce(&mut App)) -> ExitCode {
    run_example(name, choose, false, scene)
}

/// The same for a scene that is baked: baked visibility is its technique where the command line does not say otherwise.
pub fn launch_baked(name: &'static str, scene: impl FnOnce(&mut App)) -> ExitCode {
    let choose = |options: &mut Options| {
        options.technique.get_or_insert(TechniqueOption::Cssm);
    };
    run_example(name, choose, true, scene)
}

fn run_example(
    name: &'static str,
    choose: impl FnOnce(&mut Options),
    is_baked: bool,
    scene: impl FnOnce(&mut App),
) -> ExitCode {
    error::exit(name, || {
        let mut cli: Cli = options::parse(name)?;
        choose(&mut cli.options);
        let run = cli.options.check()?;
        if cli.options.technique() == TechniqueOption::Cssm && !is_baked {
            return Err(Error::Usage("--technique cssm: nothing is baked here; try cssm_heads or the viewer".into()));
        }
        app::launch(run, None, scene)
    })
}
