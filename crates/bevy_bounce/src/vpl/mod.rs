//! Virtual point lights: paths from the lights through the voxel grid, a light wherever one is reflected.
//! Keller 1997, "Instant Radiosity"; Bashford-Rogers et al. 2012, III-B.
//!
//! # Data
//!
//! | buffer | bytes at 1024 lights, 12 bounces | holds |
//! |---|---|---|
//! | `vertices` | 4.9 MiB, in the sums of the voxel grid where these are as large | path by path, where it was reflected |
//! | `paths` | 128 KiB | vertices of each path, and how many come before; which paths go on |
//! | `candidates` | 256 KiB | where light from places falls in which paths from suns and the sky may start |
//! | `order` | 1.7 MiB | key and slot of each vertex, twice for the sort |
//! | `starts` | 416 KiB | what the vertices before each weigh |
//! | `nodes`, `steps` | 420 KiB | where the order may be cut, then places of the lights in the list; how often each error occurs |
//! | `firsts`, `vertex_count` | 4 KiB | first vertex of each light; how many vertices there are |
//! | `bricks` | 8 KiB | lights in each brick of the grid, what light from the candidates falls into it, and area of groups |
//! | `densities` | 4 KiB | lights and area of the surfaces in each brick |
//! | `vpls` | 48 KiB | the list: position, normal, flux, area of the surface it stands for |
//! | `compact_vpls` | 64 KiB, 32 B a light above 2048 | position, normal and flux of each again, as shading reads them: see `vpl/compact.wgsl` |
//! | `alive_count`, `alive_workgroups` | 16 B | how many paths go on; which these are is in `paths` |
//! | `triangle_lists` | 3 MiB at 64^3 voxels, 30 B a triangle | the triangles in each voxel |
//! | `header` | 80 B | where each of the sixteen subsets begins, paths, mean bound of the geometry term |
//! | `emitters` | 80 B a triangle | emissive triangles and the running sum of their power |
//!
//! Flux is in lumens; a virtual light of flux F sends F / pi * cos candela.
//!
//! # Where it differs from the paper
//!
//! Points come from an Owen-scrambled Sobol' sequence computed where it is needed, not from a texture; each light has a part of
//! it for itself, and of the paths as many as its power says. The paper prints the
//! polar angle of a reflected path as sqrt(cos x); it is acos(sqrt(1 - x)). Paths end by roulette on the albedo, so that
//! all vertices carry about the same flux, and at a greatest length. Eight times as many paths are traced as there are lights in
//! the list; their vertices are sorted by facing and along a Hilbert curve and cut into runs, one light each: see
//! `vpl/cuts.wgsl`; it stands near the middle of its run: see `vpl/list.wgsl`. Paths from suns and from the sky start at one of eight places, more often where they go on to meet
//! something: see `vpl/starts.wgsl`. Where they are reflected they are set on the triangles that they met, take on the colour that
//! these have there, and go on: see `vpl/settle.wgsl`. Where the grid was met and no triangle, they take that of the voxel.

mod counters;
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
use crate::sort::init_sort_pipelines;

pub use counters::vpl_count;
pub(crate) use prepare::VplBuffers;

/// Traces virtual point lights; see the [module](self).
pub struct VplPlugin;

impl Plugin for VplPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, (init_sort_pipelines, pipelines::init_pipelines, forget_resource::<VplBuffers>))
            .add_systems(Render, prepare::prepare_vpls.in_set(GiSystems::Prepare).after(prepare_grid))
            .add_systems(RenderGraph, passes::trace_vpls.in_set(GiSystems::VplTrace));
    }
}
