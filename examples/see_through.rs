//! What is not in the G-buffer in bounced light: glass, a blended screen, a forward-rendered ball, sparks of dust.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::SeeThroughPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("see_through", |app| {
        app.add_plugins(SeeThroughPlugin);
    })
}
