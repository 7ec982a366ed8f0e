//! A village from afternoon to night and on to noon: light from sky and sun, then from lamps and windows.
//!
//! A window by default; `--output FILE.png` renders without one, `--time SECONDS` chooses the hour (a day has 48), `--help` lists
//! the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::VillagePlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("day_night", |app| {
        app.add_plugins(VillagePlugin);
    })
}
