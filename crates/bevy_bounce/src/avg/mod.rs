//! The approximate visibility grid: the scene as voxels, built anew every frame.
//! Bashford-Rogers et al. 2012, "Approximate Visibility Grids for Interactive Indirect Illumination", III-A.
//!
//! # Data
//!
//! The scene's bounds are covered with cubic voxels, `grid`^3 of them at most, one word each. A voxel keeps what faces +x
//! apart from what faces -x, and so on: each of its six facings that holds a surface has a *cell*, so that the two sides of
//! a thin wall mix neither colour nor normal. Cells are compact (a prefix sum over the voxels places them).
//!
//! | buffer | bytes at 64^3 | holds |
//! |---|---|---|
//! | `voxels` | 1 MiB | first cell, facings, distance to the nearest occupied voxel |
//! | `cells` | 2 MiB | albedo, share of rays that is stopped, normal, plane, area, bounds: 16 bytes each, room for one cell per two voxels |
//! | `sums` | 10.5 MiB | their fixed-point sums |
//! | `occupied`, `along_x`, `along_y` | 1.5 MiB | distances in blocks of 2^3 voxels, axis by axis |
//! | `queue` | 0.5 MiB | bricks of large triangles; then those that lists of triangles are filled from |
//!
//! The albedo of a cell is the mean of its surfaces as long as they have room side by side; the more they lie behind each other (their area
//! across the facing's axis against that of their bounds), the more those in front count: a panel on a wall has its own colour.
//!
//! Of masked surfaces a cell knows how much is there, and lets the rest of the rays pass: as if no two of its surfaces stood behind each
//! other, so that foliage of which much lies in one voxel stops more than it does in truth. What shares a cell with an opaque surface
//! stops all.
//!
//! A scene wider than twice `GiSettings::range` has up to four such grids, one within the other: those but the last lie
//! around the cameras, and move by whole bricks of 8^3 voxels. They share all buffers, which are so many times as
//! large; the finest comes first. See `GridLevel` in `types/grid.rs`.
//!
//! Behind the world's are the grids of [`VoxelizedGroup`](crate::VoxelizedGroup)s, each with room for 32^3 voxels (384
//! KiB): voxelised once, by the same kernels, in the group's own space. A ray goes through each group that stands in
//! its way, in voxels of the group.
//!
//! # Where it differs from the paper
//!
//! The paper rasterises slices and blends floats; here a compute kernel tests triangles against voxels exactly and adds
//! integers, so that no triangle is lost and two runs agree to the bit. A ray meets the mean plane of a cell, not its cube:
//! see `shared/rays.wgsl`.

mod grid;
mod groups;
mod passes;
mod pipelines;
mod triangles;

use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{Render, RenderApp, RenderStartup};

use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::{GiSystems, configure_stages};
use crate::recovery::forget_resource;

pub(crate) use grid::{PHASE, VoxelGrid, Workspace, finest_voxel, prepare_grid};
pub(crate) use groups::{GROUP_CELLS, has_room_for_groups};
pub use groups::{GroupCounts, group_counts};
pub(crate) use pipelines::{bind_grid, bind_sky, grid_layout, sky_layout};
pub(crate) use triangles::TriangleRun;

/// Builds the voxel grid; see the [module](self).
pub struct AvgPlugin;

impl Plugin for AvgPlugin {
    fn build(&self, _app: &mut App) {}

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(RenderStartup, (pipelines::init_pipelines, forget_resource::<VoxelGrid>))
            .add_systems(Render, grid::prepare_grid.in_set(GiSystems::Prepare))
            .add_systems(RenderGraph, passes::voxelize.in_set(GiSystems::Voxelize));
    }
}
