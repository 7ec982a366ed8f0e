//! A car-like body in a showroom, of metal, lacquer and rubber: bounced light is seen in it. `--glossy off` against the default is
//! what radiance caches add to virtual point lights; `--technique radiance-cache` lights by caches alone.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options.

use std::process::ExitCode;

use bevy_bounce_examples::options::Switch;
use bevy_bounce_examples::scenes::ShowroomPlugin;

fn main() -> ExitCode {
    let choose = |options: &mut bevy_bounce_examples::Options| {
        options.glossy.get_or_insert(Switch::On);
    };
    bevy_bounce_examples::launch_with("glossy_showroom", choose, |app| {
        app.add_plugins(ShowroomPlugin);
    })
}
