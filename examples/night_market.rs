//! A market at night: hundreds of small things that glow, dozens of lamps, and lanterns that sway.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::NightMarketPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("night_market", |app| {
        app.add_plugins(NightMarketPlugin);
    })
}
