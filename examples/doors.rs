//! A corridor without a lamp beside lit rooms: doors open and shut, and light comes and goes with them.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::DoorsPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("doors", |app| {
        app.add_plugins(DoorsPlugin);
    })
}
