//! A panel for [`bevy_bounce`] that one key opens: every setting of the cameras live, what a frame costs, stage by stage, and what
//! is held on the GPU, and how each light and mesh takes part.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_bounce::prelude::*;
//! use bevy_bounce_egui::BouncePanelPlugin;
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, GlobalIlluminationPlugins::default(), BouncePanelPlugin::default()))
//!     .run();
//! ```
//!
//! Settings are found by reflection: every component of `bevy_bounce` that a camera with
//! [`GlobalIllumination`](bevy_bounce::GlobalIllumination) has, field by field, with its documentation as a hint and its range
//! from its attributes. [`edit`] shows them in an interface of one's own. Below them are lists of the scene's lights and meshes, by
//! name, each with its [`GiLight`](bevy_bounce::GiLight), [`VoxelizedMesh`](bevy_bounce::VoxelizedMesh) or
//! [`VoxelizedGroup`](bevy_bounce::VoxelizedGroup): what is changed there is inserted on the entity.
//!
//! # Cost
//!
//! Closed, the panel has neither a camera nor a context, and asks for nothing. Open, it counts twice a second what is on the GPU,
//! which waits for a frame, and in each frame lights and meshes. Stage times are those of Bevy's
//! [`RenderDiagnosticsPlugin`], which is added with the panel and takes
//! timestamps whether it is open or not.
//!
//! # Beside an interface of one's own
//!
//! [`EguiPlugin`] is added where it is missing, without a context for the game's cameras; a game that uses it adds it first. The
//! panel has a context and a schedule of its own, [`BouncePanelPass`].

mod camera;
mod costs;
mod counts;
mod edit;
mod number;
mod scene;
mod settings;

use bevy::diagnostic::FrameTimeDiagnosticsPlugin;
use bevy::ecs::schedule::ScheduleLabel;
use bevy::input::InputSystems;
use bevy::prelude::*;
use bevy::render::diagnostic::RenderDiagnosticsPlugin;
use bevy_egui::{EguiGlobalSettings, EguiPlugin, EguiPreUpdateSet};

pub use camera::PanelCamera;
pub use counts::{Counted, Counts};
pub use edit::{Edited, edit};
pub use scene::scene_rows;
pub use settings::{apply, components};

/// Adds the panel.
#[derive(Clone, Copy, Debug)]
pub struct BouncePanelPlugin {
    /// Opens and closes it.
    pub key: KeyCode,
    /// Whether it is open at first.
    pub open: bool,
}

impl Default for BouncePanelPlugin {
    fn default() -> Self {
        Self { key: KeyCode::F1, open: false }
    }
}

/// The panel, at run time.
#[derive(Resource, Reflect, Clone, Copy, Debug)]
#[reflect(Resource, Debug, Clone)]
pub struct BouncePanel {
    /// Opens and closes it.
    pub key: KeyCode,
    /// Whether it is open.
    pub open: bool,
    /// Settings that it showed in the last frame.
    pub settings: usize,
}

/// What the panel draws, in a context of its own.
#[derive(ScheduleLabel, Clone, Debug, PartialEq, Eq, Hash)]
pub struct BouncePanelPass;

impl Plugin for BouncePanelPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<EguiPlugin>() {
            app.add_plugins(EguiPlugin { bindless_mode_array_size: None, ..default() });
            app.insert_resource(EguiGlobalSettings { auto_create_primary_context: false, ..default() });
        }
        if !app.is_plugin_added::<RenderDiagnosticsPlugin>() {
            app.add_plugins(RenderDiagnosticsPlugin);
        }
        if !app.is_plugin_added::<FrameTimeDiagnosticsPlugin>() {
            app.add_plugins(FrameTimeDiagnosticsPlugin::default());
        }
        app.register_type::<BouncePanel>()
            .insert_resource(BouncePanel { key: self.key, open: self.open, settings: 0 })
            .add_plugins(counts::CountsPlugin)
            .add_systems(
                PreUpdate,
                (toggle, camera::follow).chain().after(InputSystems).before(EguiPreUpdateSet::InitContexts),
            )
            .add_systems(BouncePanelPass, (settings::show, costs::show).chain());
    }
}

fn toggle(keys: Option<Res<ButtonInput<KeyCode>>>, mut panel: ResMut<BouncePanel>) {
    if keys.is_some_and(|keys| keys.just_pressed(panel.key)) {
        panel.open = !panel.open;
    }
}
