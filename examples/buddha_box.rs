//! A statue full of folds in a box lit by a lamp that points at the ceiling: bounced light alone, and most of what bounding
//! takes from it. `--ssbc 0` against `--ssbc 2`, or `--show residual`, is what bias compensation gives back.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::BuddhaBoxPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("buddha_box", |app| {
        app.add_plugins(BuddhaBoxPlugin);
    })
}
