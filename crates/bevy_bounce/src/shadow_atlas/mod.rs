//! What virtual point lights see: a shadow map each. Keller 1997; Bashford-Rogers et al. 2012, III-C.
//!
//! # Data
//!
//! | buffer | bytes at 1024 lights, tiles of 32 x 32 | holds |
//! |---|---|---|
//! | `atlas` | 4 MiB | light by light: depth (14 bits of the scene's diagonal), how far what casts may be off its surface (2 bits), and normal over its hemisphere |
//! | `occluders` | 48 B a triangle, 3 MiB at most | triangles that cast, in the world |
//! | `eyes` | 8 B a light, where visibility is baked | object and texel that each light is on |
//!
//! A tile maps the hemisphere to a square by the half octahedron, without waste. Each texel is tested against the planes through
//! the light and a triangle's edges, so that large triangles stay straight. A point is hidden where it is farther from the light than
//! the surface that its texel shows, lies behind the plane of that, and that before its own: however coarse texels are, surfaces do not
//! shadow themselves.
//!
//! Masked triangles leave out texels, as many as their holes are of them: holes that are a quarter of a triangle's edge
//! or more are where they are, finer ones anywhere within that. See `shadow_atlas/masks.wgsl`. A masked triangle costs
//! some 4000 operations more a frame, and 60 more a texel; others a comparison.
//!
//! Where visibility is baked, lights on baked objects have these from the bake: the codes of its cube maps are the
//! first layer of their tiles, and triangles of all else are drawn over it. Ritschel, Grosch, Kautz and Seidel 2008.
//!
//! Imperfect shadow maps (Ritschel et al. 2008) fill the same tiles from points spread over the surfaces.
//!
//! # How large a tile
//!
//! Shares of pairs of a pixel and a light that face each other for which a tile agrees with an exact ray, of 8000 pairs and 256 lights
//! each (`cargo test --workspace --test suite -- maps_agree_by the_largest_maps --ignored --nocapture`): tiles of triangles, of points,
//! and what those of triangles would be if each texel knew exactly what is in its middle.
//!
//! | texels | corner | sibenik | sponza |
//! |---|---|---|---|
//! | 24 x 24 | .981, .965, .981 | .873, .783, .872 | .842, .714, .839 |
//! | 32 x 32 | .985, .974, .985 | .895, .808, .893 | .862, .740, .859 |
//! | 48 x 48 | .990, .977, .991 | .916, .827, .915 | .885, .767, .884 |
//! | 64 x 64 | .992, .987, .992 | .934, .853, .933 | .904, .797, .902 |
//! | 96 x 96 | .994, .989, .994 | .946, .872, .944 | -, -, .927 |
//! | 128 x 128 | -, -, .996 | -, -, .954 | -, -, .933 |
//! | 256 x 256 | -, -, .998 | .976, -, .975 | -, -, .960 |
//!
//! Of all pairs, half of which face each other in sibenik and the others agree whatever a tile says, 32 x 32 texels of triangles and of
//! points agree in .989 and .982 in corner, and in .948 and .905 in sibenik; 96 x 96 in .996 and .992, and in .973 and .937.
//!
//! What is left in tiles of triangles is the width of their texels. Four times the memory make a third fewer mistakes, and mistakes of
//! many lights even out: tiles of triangles see as much as rays do, within three hundredths. So the default is small, and lights are many.
//!
//! # Cost
//!
//! Work grows with lights times triangles, which is bounded: large meshes cast by a coarser version, made when the mesh
//! is loaded, and what lies within its error of a map's surface is on that surface: each texel knows that of the mesh
//! it shows. Maps above 48 x 48 texels are drawn in parts, each of which counts as a light here: 4 at 96 x 96, 36 at 256 x 256.
//! 34 million of these pairs are drawn, or as many more as it takes that nothing is more than a voxel off.
//! Where that is more than 268 million, or 65,535 triangles, no maps are drawn, and lights see by rays through the
//! grid.
//!
//! # Where it differs from the paper
//!
//! The paper draws a paraboloid for each light, and ordinary shadow maps where large triangles would bend in it.

mod passes;
mod pipelines;
mod prepare;

use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{Render, RenderApp, RenderStartup};

use crate::avg::prepare_grid;
use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::{GiSystems, configure_stages};
use crate::recovery::forget_resource;

pub(crate) use pipelines::{bind_visibility, visibility_def, visibility_layouts};
pub(crate) use prepare::ShadowAtlas;

/// Draws the shadow maps of virtual point lights; see the [module](self).
pub struct ShadowAtlasPlugin;

impl Plugin for ShadowAtlasPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_resource::<ShadowAtlas>))
            .add_systems(Render, prepare::prepare_atlas.in_set(GiSystems::Prepare).after(prepare_grid))
            .add_systems(RenderGraph, passes::draw_atlas.in_set(GiSystems::ShadowAtlas));
    }
}
