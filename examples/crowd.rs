//! Forty-four skinned animals walk round a plaza: what bounces off them, and what they block, is that of this very frame.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::CrowdPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("crowd", |app| {
        app.add_plugins(CrowdPlugin);
    })
}
