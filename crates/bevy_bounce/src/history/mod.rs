//! History: bounced light is averaged over frames where it hardly changes, so that it is calm in motion.
//!
//! After the bounced light of a view is complete and before it is composed:
//!
//! 1. `average` finds each pixel's surface in the last frame
//!    ([`MotionVectorPrepass`](bevy::core_pipeline::prepass::MotionVectorPrepass) and depth), and averages its light
//!    with what was known there, over [`GiSettings::history`](crate::GiSettings::history) frames at most. What the last
//!    frames say counts less the further it is off this frame's light, and nothing from a few percent on: each frame is
//!    right on its own but for 2.4 percent where light is even, 4.1 where it is not. After Karis 2014, "High-Quality
//!    Temporal Supersampling", and Salvi 2016, "An Excursion in Temporal Supersampling".
//! 2. `keep` writes the average into the view's light, and keeps it with what each pixel shows.
//!
//! Where a [`budget`](crate::budget) has changed the number of lights, history may be further off for 40 frames.
//!
//! Diffuse light first, glossy light after it where there is any. Light is irradiance, before it is multiplied by the colours of
//! surfaces: textures stay as sharp as they are.
//!
//! A frame that repeats the last one is the same to the bit, for nothing is off. Nothing is recalled in the first
//! frame, after the size, the technique or any setting of the view changed (other than by its
//! [`budget`](crate::budget)), after a frame without bounced light, and where
//! [`GlobalIllumination::reset`](crate::GlobalIllumination::reset) says so. A camera that is cut needs nothing: what it
//! sees is recalled by its place in the world, or not at all.
//!
//! # Data
//!
//! | texture | bytes a pixel | holds |
//! |---|---|---|
//! | `light` | 8, with glossy light 16 | light, pre-exposed, and over how many frames it is averaged |
//! | `surfaces` | 4 | depth and normal: see `history/surfaces.wgsl` |
//!
//! The view's `interleaved` texture, free by then, holds what is averaged. Bevy's motion vectors take 4 bytes a pixel more.

mod motion;
mod passes;
mod pipelines;
mod prepare;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderStartup, RenderSystems};

use crate::GiSystems;
use crate::camera::device_is_adequate;
use crate::compose::ViewPass;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_components;
use crate::view::prepare_view_textures;

pub(crate) use prepare::History;

/// Averages bounced light over frames; see the [module](self).
pub struct HistoryPlugin;

impl Plugin for HistoryPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        app.add_systems(PostUpdate, motion::prepare_motion_vectors);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_components::<History>))
            .add_systems(
                Render,
                (
                    prepare::prepare.in_set(GiSystems::Prepare).after(prepare_view_textures),
                    motion::forget_background.in_set(RenderSystems::Prepare),
                ),
            )
            .add_systems(Core3d, passes::average.in_set(ViewPass::History));
    }
}
