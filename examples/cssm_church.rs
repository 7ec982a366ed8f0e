//! The nave of a church, lit by sun through its windows and by what the floor sends on: baked visibility. It is baked at the first start,
//! which takes some seconds, and kept in the system's temporary folder.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::ChurchPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch_baked("cssm_church", |app| {
        app.add_plugins(ChurchPlugin);
    })
}
