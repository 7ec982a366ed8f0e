//! Windows: fly camera, screenshots, the way out.

use bevy::camera::Exposure;
use bevy::camera_controller::free_camera::{FreeCamera, FreeCameraPlugin, FreeCameraState};
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, save_to_disk};
use bevy_egui::input::EguiWantsInput;

use crate::Error;
use crate::headless::{Failed, Pending};
use crate::metering::MeteringPlugin;

/// Keys of a window: ESC leaves, F1 opens the panel, F12 takes a picture, `-` and `=` change the exposure, the free camera's own keys fly.
pub struct WindowPlugin;

/// Size of the scene, metres; a [`Camera3d`] with it can be flown, at a speed to match.
#[derive(Component, Clone, Copy, Debug)]
pub struct Fly {
    /// How far across.
    pub extent: f32,
}

impl Default for Fly {
    fn default() -> Self {
        Self { extent: 20.0 }
    }
}

impl Plugin for WindowPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Pending>()
            .init_resource::<Failed>()
            .add_plugins((FreeCameraPlugin, MeteringPlugin))
            .add_systems(Startup, print_keys)
            .add_systems(Update, (leave, take_picture, expose, stop_on_failure, yield_to_panel))
            .add_observer(fly);
    }
}

/// Is there a display? winit would panic without one.
pub fn check_display() -> Result<(), Error> {
    let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(target_os = "linux") && !set("DISPLAY") && !set("WAYLAND_DISPLAY") && !set("WAYLAND_SOCKET") {
        return Err(Error::NoDisplay);
    }
    Ok(())
}

fn print_keys() {
    println!(
        "right mouse button: look; W A S D Q E: fly; shift: faster; wheel: speed; - =: exposure; F1: panel; F12: picture; ESC: leave"
    );
}

fn fly(add: On<Add, Camera3d>, extents: Query<&Fly>, mut commands: Commands) {
    let Fly { extent } = extents.get(add.entity).copied().unwrap_or_default();
    let walk_speed = extent / 8.0;
    commands.entity(add.entity).insert(FreeCamera { walk_speed, run_speed: 4.0 * walk_speed, ..default() });
}

/// What the panel takes of mouse and keyboard does not fly.
fn yield_to_panel(panel: Option<Res<EguiWantsInput>>, mut cameras: Query<&mut FreeCameraState>) {
    let free = !panel.is_some_and(|panel| panel.wants_any_input());
    cameras.iter_mut().filter(|camera| camera.enabled != free).for_each(|mut camera| camera.enabled = free);
}

fn leave(keys: Res<ButtonInput<KeyCode>>, mut exit: MessageWriter<AppExit>) {
    if keys.just_pressed(KeyCode::Escape) {
        exit.write(AppExit::Success);
    }
}

fn take_picture(keys: Res<ButtonInput<KeyCode>>, mut commands: Commands) {
    if !keys.just_pressed(KeyCode::F12) {
        return;
    }
    let free =
        (1..10_000).map(|number| format!("screenshot-{number}.png")).find(|name| !std::path::Path::new(name).exists());
    if let Some(name) = free {
        println!("{name}");
        commands.spawn(Screenshot::primary_window()).observe(save_to_disk(name));
    }
}

fn expose(keys: Res<ButtonInput<KeyCode>>, mut cameras: Query<&mut Exposure>) {
    let pressed = |key| if keys.just_pressed(key) { 0.5 } else { 0.0 };
    let stops = pressed(KeyCode::Minus) - pressed(KeyCode::Equal);
    if stops != 0.0 {
        cameras.iter_mut().for_each(|mut exposure| exposure.ev100 += stops);
    }
}

fn stop_on_failure(mut failed: ResMut<Failed>, mut exit: MessageWriter<AppExit>) {
    if let Some(error) = failed.take() {
        eprintln!("{error}");
        exit.write(AppExit::from_code(error.status()));
    }
}
