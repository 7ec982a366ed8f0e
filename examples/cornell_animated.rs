//! An elephant walks round a Cornell box: skinned meshes bounce light where they are in this very frame.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::AnimalPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("cornell_animated", |app| {
        app.add_plugins(AnimalPlugin);
    })
}
