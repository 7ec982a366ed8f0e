//! Bias compensation: gives back the light that the bounded geometry term takes from corners and contacts.
//! Novak, Engelhardt and Dachsbacher 2011, "Screen-Space Bias Compensation for Interactive High-Quality Global Illumination
//! with Virtual Point Lights".
//!
//! What a bound b takes from the transport operator T is the residual operator, with max(G - b, 0) for the geometry term
//! G. Applied to what surfaces really send, which has no singularities, it gives the light that is missing:
//! L = S + R S + R R S + ..., where S is direct diffuse light, bounded bounced light and emission, as far as the camera
//! sees them.
//!
//! Each iteration:
//!
//! 1. `radiance`: what each pixel sends, with what the iterations before have found, beside its depth, normal and area: the
//!    lowest level of the hierarchy.
//! 2. `reduce`, twice: six levels of the same above the pixels, each texel marked where an edge runs through it.
//! 3. `gather`: a descent through the levels at each pixel, or at each fourth, from the few texels that hold all that can be
//!    above the bound; pixels next to the receiver as the polygons that they show, up to the seam with its surface, in strips
//!    where they are long.
//! 4. `blur_rows`, `blur_columns`: at every pixel the mean over the tent through which the interleaved sub-images of bounded
//!    light go. Right at a seam bounded light is too bright by what it got from pixels farther off, and there is too little of
//!    it beside the seam; the residual is the reverse, once it went the same way. Where both are of one resolution they are
//!    taken at the same samples, too (those that the filter of virtual lights has told): what either misses
//!    because a seam passes between two of them, the other has left over. So its own energy is not that of the residual at
//!    all pixels; that of the sum is right.
//! 5. At half resolution `repair`: integrated anew, and not blurred, at the pixels for which that finds too few samples of their
//!    surface, from a list of them.
//!
//! Without [`SsbcSettings::blur`], number 4 is `spread` at half resolution: upsampled among samples of one surface, and more
//! pixels on the list; and nothing at full resolution.
//!
//! Then `apply` adds the residual to the bounced light.
//!
//! # Data
//!
//! | texture | bytes at 1280x720 | holds |
//! |---|---|---|
//! | `hierarchy` | 20 MiB | levels of 1 to 64 pixels a texel: see `ssbc/hierarchy.wgsl` |
//! | `residual` | 7 MiB, at half resolution 1.8 MiB | irradiance over pi that is added, rgba16float |
//! | `at_pixels` | 7 MiB for two iterations and more; that of a single one takes the place of the view's `direct_diffuse` | the same at every pixel, where it is blurred or of half resolution |
//! | `repairs` | 3.5 MiB at half resolution | the pixels where it is integrated anew |
//!
//! # Where it differs from the paper
//!
//! Emission is part of what is integrated: emissive surfaces light others through virtual lights here, and those are
//! bounded, too. The descent starts from the smallest sphere round the lobe over the receiver in which the geometry term can be
//! above the bound, and a texel that can have nothing above it anywhere within it is left out at once, by the heights of
//! each end over the other's plane. An edge keeps the range of its depths, so that what lies near is not overlooked because
//! the mean lies far. The descent's stack is a word. The paper takes pixels for points; where surfaces touch, the light of those
//! next to the receiver would be an accident of the raster, from nothing to half too much, along the seam in dashes. At grazing
//! angles it lets areas decay, from 80 degrees on; here the radiance decays, from 87: the length of a pixel says how far it reaches.
//!
//! # What it cannot know
//!
//! What the camera does not see gives nothing back. Lights that [`GiLight`](crate::GiLight) changes and meshes that
//! [`VoxelizedMesh`](crate::VoxelizedMesh) leaves out count as they look. Nothing is taken to lie between two points that
//! are nearer to each other than 1 / sqrt(b).

mod passes;
mod pipelines;
mod prepare;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::{Render, RenderApp, RenderStartup};

use crate::camera::device_is_adequate;
use crate::compose::ViewPass;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;
use crate::recovery::forget_components;
use crate::{GiSystems, Resolution};

pub(crate) use prepare::SsbcTextures;

/// How bias compensation is computed; part of [`GiSettings`](crate::GiSettings).
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Default)]
pub struct SsbcSettings {
    /// Iterations, 0 to 8; 0 is off. Each costs the same, and gives back what light that is given back loses in turn: n
    /// leave out about the (n + 1)th power of the albedo. Two and more hold eight bytes a pixel that one does not, where the result is
    /// blurred or of half resolution.
    #[reflect(@0..=8_u32)]
    pub iterations: u32,
    /// Projected solid angle, sr, above which a group of pixels is taken apart. Less is more exact; cost grows with its
    /// inverse where surfaces meet. 0.0001 to 7.
    #[reflect(@1e-4..=7.0_f32)]
    pub solid_angle: f32,
    /// The same for a group of pixels that an edge runs through.
    #[reflect(@1e-4..=7.0_f32)]
    pub edge_solid_angle: f32,
    /// Pixels at which it is integrated.
    pub resolution: Resolution,
    /// Blurs the result within surfaces as widely as bounded light is, which is the mean of several pixels': without it,
    /// seams glow, and a pixel beside them lacks light. Costs each iteration what joining the sub-images of bounded light does, at most.
    pub blur: bool,
}

impl SsbcSettings {
    /// No compensation.
    pub const OFF: Self = Self { iterations: 0, ..Self::DEFAULT };
    const DEFAULT: Self =
        Self { iterations: 1, solid_angle: 0.08, edge_solid_angle: 0.04, resolution: Resolution::Half, blur: true };

    /// The same within the documented ranges.
    pub(crate) fn clamped(self) -> Self {
        let finite = |value: f32, default: f32| if value.is_finite() { value.clamp(1e-4, 7.0) } else { default };
        Self {
            iterations: self.iterations.min(8),
            solid_angle: finite(self.solid_angle, Self::DEFAULT.solid_angle),
            edge_solid_angle: finite(self.edge_solid_angle, Self::DEFAULT.edge_solid_angle),
            ..self
        }
    }
}

impl Default for SsbcSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Gives back the light that bounding takes; see the [module](self).
pub struct SsbcPlugin;

impl Plugin for SsbcPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<SsbcSettings>();
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_components::<SsbcTextures>))
            .add_systems(
                Render,
                prepare::prepare_textures.in_set(GiSystems::Prepare).after(crate::view::prepare_view_textures),
            )
            .add_systems(Core3d, passes::compensate.in_set(ViewPass::Compensate));
    }
}
