//! A furnished office whose lamp moves: bounced light follows without delay.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::OfficePlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("moving_lamp", |app| {
        app.add_plugins(OfficePlugin);
    })
}
