//! A room lit round the corner: what the camera sees is light that bounced, and bounced again.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::URoomPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("u_room", |app| {
        app.add_plugins(URoomPlugin);
    })
}
