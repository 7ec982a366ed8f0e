//! For looking at what is going on: pictures of what lies between the scene and its light, and virtual lights as gizmos.
//!
//! [`GiIsolate`](crate::GiIsolate) on a camera chooses what its picture holds: one term alone, or an intermediate:
//! voxels as rays meet them, shadow maps of the virtual lights, clusters of the radiance caches, what pixels gather
//! from baked objects. [`GiGizmos`] draws the virtual lights over any picture. Both are reflected, so that an inspector
//! finds them; `bevy_bounce_egui` shows both.
//!
//! # Cost
//!
//! None while nothing is asked for: kernels are compiled when their picture is first asked for, and nothing is read back. With
//! [`GiGizmos::virtual_lights`] the list of virtual lights is copied on the GPU, 48 bytes a light, and read once the GPU is done: nothing
//! waits for it, and what is drawn is some frames old.

mod gizmos;
mod views;

use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems};

use crate::ViewPass;
use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_resource;

pub use gizmos::{GiGizmos, VirtualLightGizmos};

/// Pictures of intermediates, and gizmos; see the [module](self).
pub struct GiDebugPlugin;

impl Plugin for GiDebugPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GiGizmos>().init_resource::<GiGizmos>();
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let read_back = gizmos::finish(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .insert_resource(read_back)
            .add_systems(RenderStartup, (views::forget_kernels, forget_resource::<gizmos::Reading>))
            .add_systems(ExtractSchedule, gizmos::extract)
            .add_systems(Render, gizmos::read_lights.after(RenderSystems::Render).before(RenderSystems::Cleanup))
            .add_systems(Core3d, views::draw_picture.after(Core3dSystems::MainPass).before(ViewPass::Isolate));
    }
}
