//! Interleaved shading: every pixel is lit by a sixteenth of the virtual lights, and its 4x4 neighbourhood by all.
//! Keller & Heidrich 2001, "Interleaved Sampling"; Bashford-Rogers et al. 2012, III-C.
//!
//! Four compute passes: `near` writes what near lights bring into `interleaved`, `shade` that and the irradiance of one subset
//! into `indirect`, `filter_rows` means along rows into `interleaved`, `filter_columns` means of these along columns into `indirect`
//! (textures of the view). Samples across edges are left out. At half resolution the first two work on every second pixel of every
//! second row, and the last lights pixels anew whose surface has hardly any of them near.
//!
//! What of the geometry term is above an eighth of its bound is not interleaved: each pixel that is shaded finds its few near lights
//! among all, as in tiled shading. A light that only a sixteenth of them knew of would be a spot sixteen times as bright, which no tent
//! hides beside an edge.
//!
//! Threads of `shade` read the same light at once: up to 2048 lights are a uniform buffer there, which costs least so; more are a storage
//! buffer, as they are for `near`, whose threads read different ones.
//!
//! Where there is a sky, each pixel also sends rays in a sixteenth of its directions: see `interleaved/sky.wgsl`. What share of its light
//! they find is joined in the same way into `sky_seen`, for what surfaces mirror of an environment map.
//!
//! The geometry term is bounded by the number of lights around a pixel over the area of the surfaces there: no light counts for more
//! than at the distance between lights. What this takes from corners is left to bias compensation.

mod passes;
mod pipelines;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{RenderApp, RenderStartup};

use crate::camera::device_is_adequate;
use crate::compose::ViewPass;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;

/// Lights pixels by virtual lights; see the [module](self).
pub struct InterleavedShadingPlugin;

impl Plugin for InterleavedShadingPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, pipelines::init_pipelines)
            .add_systems(Core3d, passes::shade.in_set(ViewPass::Shade));
    }
}
