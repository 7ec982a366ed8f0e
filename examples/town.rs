//! A drive through a town of one square kilometre: light that is fine near the camera, and there all the way to the horizon.
//!
//! A window by default; `--output FILE.png` renders without one, `--time SECONDS` chooses the place, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::TownPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("town", |app| {
        app.add_plugins(TownPlugin);
    })
}
