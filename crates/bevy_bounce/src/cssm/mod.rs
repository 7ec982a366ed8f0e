//! Baked visibility at run time. Ritschel, Grosch, Kautz and Seidel 2008, "Interactive Global Illumination Based on Coherent
//! Surface Shadow Maps".
//!
//! The texels of rigid objects' atlases are small lamps that know what they see of their object. They are lit by emission and
//! direct light, then light each other, bounce after bounce; last, every pixel gathers from them. Light from far away or from
//! little is taken together: sums go over cuts through hierarchies of texels, one for each object, in the object's own space, so
//! that objects move and nothing is built anew but the [tree over them](top).
//!
//! | kernel | for each | from | to |
//! |---|---|---|---|
//! | `emit` | texel | material and texture of its triangle | `sources` |
//! | `direct` | texel | lights; cube maps, maps from outside | added to `sources` |
//! | `leaves`, `pull`, `pull_top` | texel; node, level by level; node over the objects | `sources`, `gathered` | `powers` |
//! | `bounce` | texel | `powers` along its cuts; cube maps, maps from outside | `gathered`; the last one, where texels receive it, `received` |
//! | `pixels` | pixel | the same | the view's `indirect`, and `glossy` where it is asked for |
//! | or `smooth_pixels` | pixel | `received` of the texels around it, where these receive the last bounce | the view's `indirect` |
//!
//! All but the last two run only when lights, materials, the objects' places or settings are others than before.
//!
//! Where a [budget](crate::GlobalIllumination::budget) asks for it, one `bounce` with its `leaves` and `pull` runs a
//! frame, on `powers` and `gathered` of its own (48 bytes a texel), which are shown once all bounces are there; what
//! the lamps send is pulled when it changes. Where texels receive the last bounce, they do so once more in frames in
//! which something changes, and once all bounces are there.
//!
//! # What hides what
//!
//! Section 3.3 of the paper. Between a sender and a receiver:
//!
//! | object | is asked by | is right |
//! |---|---|---|
//! | that of the sender | the sender's cube map, and outside the object's box also its maps from outside | wherever surfaces are closed |
//! | that of the receiver, if it is another one | likewise, by the cube map of the texel that the receiver is on | the same |
//! | every other one | its maps from outside, from that end which is outside its box | if one end is; otherwise it hides nothing |
//!
//! With one object alone its cube maps are all that is asked for bounces.
//!
//! The paper asks that hulls stay apart. Here an object may stand in another one, as a head in a room; what that room hides of it from
//! lamps and objects that are also in the room is then not known. Overlapping hulls are told once, with the names of the pair.
//!
//! # Data
//!
//! | buffer | bytes | holds |
//! |---|---|---|
//! | `texels`, `directory`, `blocks` | as the files, each once | [`words`] |
//! | `tree` | 36 a texel, each bake once | [`tree`] |
//! | `powers` | 32 a texel | of each node, radiance times area, and area |
//! | `sources`, `gathered`, `received` | 16 a texel each, the last where it is asked for | radiance without bounces, share reflected at the surface; irradiance over pi by bounces, nodes of the cuts |
//! | `surfaces` | 12 a texel | which triangle each texel shows |
//! | `kept` | 16 a pixel, 32 with glossy light, where light is averaged | mean light of a pixel that rests, what it shows |
//! | `bakes` | 18 KiB | where each object stands, where its words are, and the tree over the objects |
//!
//! # Cost
//!
//! Nodes of the cuts times receivers: pixels, and texels for each bounce but one. A cut has at least as many nodes as
//! the receiver's light has steps of [`CssmSettings::error`], and at least one. With several objects a node of the cut
//! costs a second query, and one for each further object whose sphere is in the way. Glossy light refines what is mirrored.
//! A query reads at most ten words on average: the slot of its texel's cube map, one of the directory, the rest of the block. What else the
//! texel's record holds is not counted, for a node of the cut needs that in any case.
//! Memory is that of the files and a hundred bytes a texel.
//!
//! # What counts
//!
//! Up to [`MOST_OBJECTS`] objects, rigid: turned, moved, scaled evenly. Their colours are those of their bakes, their
//! emission and what they reflect at their surface are those of their materials now. What is not baked receives light
//! and neither blocks nor reflects it. Lamps shine evenly into their cones: Bevy's textures of lights are not looked
//! at. A light or another object within an object's box that has only one surface of it on a line with a texel, or
//! stands between two of them, may be seen through the first: the cube maps know where surfaces are, not what stands
//! between them.
//!
//! A node of the cut sends from one of its texels, chosen in proportion to what they send: no light is lost, however coarse the cut; what a
//! larger error costs is noise from pixel to pixel and texel to texel. With [history](crate::GiSettings::history) other texels send in each
//! frame while the camera, the objects and the light rest, and a pixel shows the mean of up to 64 frames, after which it costs a load.
//! Where a texel is near, its light is that of a square in closed form; of what mirrors it, each of these frames looks at another place of
//! it, in a lobe that is widened the less the more frames there are (section 4.5). What hides it is asked from its middle.
//!
//! Mesa's software rasteriser ends the loops of a thread after 65,535 rounds, two to four of which are a node's: beyond some 16,000
//! nodes that a single receiver visits it leaves light out. Errors of a fraction of a step over large atlases come to that.
//!
//! Glossy light is that of the lit texels; in a single frame it is as sharp as those are fine. What is metal or
//! polished lights others, and is mirrored, by its base colour and by what it reflects at its surface before that, as
//! if it were matt.

mod counters;
mod display;
mod hull;
mod object;
mod passes;
mod pipelines;
mod pixels;
mod prepare;
mod settings;
mod surfaces;
pub mod top;
pub mod tree;
pub mod words;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderStartup};
use bevy_bounce_cssm::CssmAsset;

use crate::camera::device_is_adequate;
use crate::compose::ViewPass;
use crate::compute::load_shaders;
use crate::plugins::{GiSystems, configure_stages};
use crate::recovery::{forget_components, forget_resource};
use crate::view::prepare_view_textures;

pub use bevy_bounce_shaders::types::CSSM_OBJECTS as MOST_OBJECTS;
pub use counters::texel_cuts;
pub(crate) use passes::Pixels;
pub(crate) use pipelines::{bind_maps, maps_layout, pixel_kernel};
pub(crate) use pixels::PixelLight;
pub(crate) use prepare::Baked;
pub use settings::{CssmFilter, CssmReceivers, CssmSettings};
pub use surfaces::surfaces;

/// Baked visibility of a rigid object: of the mesh it is on and of those below it, in the space of this entity.
///
/// Meshes are told apart by their asset labels, `Mesh3/Primitive0`, as Bevy's glTF loader gives them, or by [`CssmPart`].
#[derive(Component, Reflect, Clone, Debug, PartialEq)]
#[reflect(Component, Debug, Clone, PartialEq)]
#[require(Transform)]
pub struct CssmObject {
    /// What `bounce-bake` made of it.
    pub bake: Handle<CssmAsset>,
}

/// Which part of a bake a mesh is, by its place in [`Parts`](bevy_bounce_cssm::Parts); for meshes whose asset label does not say.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq)]
#[reflect(Component, Debug, Clone, PartialEq)]
pub struct CssmPart(pub u32);

/// How often the texels of baked objects were lit: it rises in frames in which something changed, and begins anew after frames in
/// which no camera asks for them. For measurements.
pub fn times_lit(render_world: &World) -> u64 {
    render_world.get_resource::<Baked>().map_or(0, |baked| baked.times_lit)
}

/// Lights by baked visibility; see the [module](self).
pub struct CssmPlugin;

impl Plugin for CssmPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<CssmSettings>().register_type::<CssmObject>().register_type::<CssmPart>();
        if !app.is_plugin_added::<bevy_bounce_cssm::CssmPlugin>() {
            app.add_plugins(bevy_bounce_cssm::CssmPlugin);
        }
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .init_resource::<object::ExtractedCssm>()
            .init_resource::<prepare::PreparedBakes>()
            .add_systems(
                RenderStartup,
                (pipelines::init_pipelines, forget_resource::<Baked>, forget_components::<PixelLight>),
            )
            .add_systems(ExtractSchedule, (object::extract_cameras, object::extract_objects).chain())
            .add_systems(Render, prepare::prepare_light.in_set(GiSystems::Prepare))
            .add_systems(
                Render,
                pixels::prepare_pixels
                    .in_set(GiSystems::Prepare)
                    .after(prepare::prepare_light)
                    .after(prepare_view_textures),
            )
            .add_systems(RenderGraph, passes::light_texels.in_set(GiSystems::Cssm))
            .add_systems(Core3d, passes::light_pixels.in_set(ViewPass::Shade));
    }
}
