//! Baked visibility at run time. Ritschel, Grosch, Kautz and Seidel 2008, "Interactive Global Illumination Based on Coherent
//! Surface Shadow Maps".
//!
//! The texels of a rigid object's atlas are small lamps that know what they see of the object. They are lit by emission and
//! direct light, then light each other, bounce after bounce; last, every pixel gathers from them. Light from far away or from
//! little is taken together: sums go over a cut through a hierarchy of texels.
//!
//! | kernel | for each | from | to |
//! |---|---|---|---|
//! | `emit` | texel | material and texture of its triangle | `sources` |
//! | `direct` | texel | lights; cube maps, maps from outside | added to `sources` |
//! | `leaves`, `pull` | texel; node, level by level | `sources`, `gathered` | `powers` |
//! | `bounce` | texel | `powers` along its cut; cube maps | `gathered` |
//! | `pixels` | pixel | the same | the view's `indirect` |
//!
//! All but the last run only when lights, materials, the object's place or settings are others than before.
//!
//! # Data
//!
//! | buffer | bytes | holds |
//! |---|---|---|
//! | `texels`, `directory`, `blocks` | as the file | [`words`] |
//! | `tree` | 36 a texel | [`tree`] |
//! | `powers` | 32 a texel | of each node, radiance times area, and area |
//! | `sources`, `gathered` | 16 a texel each | radiance without bounces; irradiance over pi by bounces, nodes of the cut |
//! | `surfaces` | 12 a texel | which triangle each texel shows |
//!
//! # Cost
//!
//! Nodes of the cuts times receivers: pixels, and texels for each bounce but one. A cut has at least as many nodes as
//! the receiver's light has steps of [`CssmSettings::error`]. Memory is that of the file and a hundred bytes a texel.
//!
//! # What counts
//!
//! One object at a time, rigid: turned, moved, scaled evenly. Its diffuse colours are those of the bake, its emission is that of
//! its materials now. What is not baked receives light and neither blocks nor reflects it. A light within the object's box that has
//! only one surface of it on a line with a texel, or stands between two of them, may be seen through the first: the cube maps
//! know where surfaces are, not where lights are. A node of the cut is as visible as one of its texels: where bright ones are
//! together with dark ones that are hidden, some light is lost, less with a smaller error.

mod display;
mod hull;
mod object;
mod passes;
mod pipelines;
mod prepare;
mod settings;
mod surfaces;
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

pub(crate) use prepare::Baked;
pub use settings::{CssmFilter, CssmSettings};
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

/// How often the texels of the baked object were lit: it rises in frames in which something changed. For measurements.
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
            .add_systems(RenderStartup, (pipelines::init_pipelines, prepare::forget))
            .add_systems(ExtractSchedule, (object::extract_cameras, object::extract_objects).chain())
            .add_systems(Render, (prepare::prepare_light, prepare::prepare_views).in_set(GiSystems::Prepare))
            .add_systems(RenderGraph, passes::light_texels.in_set(GiSystems::Cssm))
            .add_systems(Core3d, passes::light_pixels.in_set(ViewPass::Shade));
    }
}
