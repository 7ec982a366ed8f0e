//! Two heads turn in a room over a floor with letters, lit by the room and by each other: baked visibility, one bake of the room
//! and one of the heads. They are baked at the first start, which takes some seconds, and kept in the system's temporary folder.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::scenes::HeadsPlugin;

fn main() -> ExitCode {
    bevy_bounce_examples::launch_baked("cssm_heads", |app| {
        app.add_plugins(HeadsPlugin);
    })
}
