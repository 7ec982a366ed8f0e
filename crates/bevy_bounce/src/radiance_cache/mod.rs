//! Caches of incident light on what the camera sees: diffuse and glossy bounced light.
//! Rehfeld, Zirr and Dachsbacher 2014, "Clustered Pre-convolved Radiance Caching".
//!
//! The voxels of the grid are lit, and their light is filtered into coarser and coarser levels. On the screen, pixels that lie and
//! look alike are put together, and each cluster gets a cache: the light from all directions of a hemisphere, one cone through
//! the levels for each of 16x16, then convolved with wider and wider lobes. Every pixel gathers from the caches around it, at
//! the level of its roughness in the direction in which it reflects, and diffuse light in that of its normal.
//!
//! | kernel | for each | from | to |
//! |---|---|---|---|
//! | `emit` | emissive triangle | scene | emission of the cells |
//! | `list_places`, `list_group_places` | voxel | grids | where each cell is |
//! | `light_cells` | cell | lights, virtual lights; rays through the grid | irradiance |
//! | `fill`, `reduce` | voxel, level by level | the above | light and coverage by facing |
//! | `choose_axes` | tile of the screen | normals | its three axes |
//! | `write_keys`, sort, `count_differences` to `number_clusters` | pixel | tile, facing, slice of depth | clusters |
//! | `keep` | cache of the last frame | what its place shows now | which caches stay |
//! | `place` | cluster | its pixels, what stays | a cache |
//! | `create` | cache | the levels | its hemisphere, convolved |
//! | `evaluate` | pixel | the caches around | glossy light; diffuse light |
//!
//! # Data
//!
//! | | bytes | holds |
//! |---|---|---|
//! | voxel light: cells | 48 a cell: 6 MiB at 64^3 | place, irradiance, emission |
//! | voxel light: levels | 62 a voxel: 15 MiB at 64^3 | six facings, half floats, relative to the scene's mean light |
//! | the same of a [`VoxelizedGroup`](crate::VoxelizedGroup) | 2.3 MiB | its cells and its levels, for each group by itself, in steps of powers of two of them; 192 KiB of emission for each grid |
//! | clusters | 20 a pixel, and counts | key and pixel, twice for the sort; which cache is kept there |
//! | atlas | 4 KiB a cache: 16 MiB at 2 million pixels | 16x16 as it comes, 3 x 8x8 by roughness, 8x8 by cosine |
//!
//! # Where it differs from the paper
//!
//! Voxels have six facings, so that a surface does not shade itself and walls do not leak. Levels of a cache are
//! convolved with their lobes instead of being means of four texels. All that decides about clusters is in whole
//! numbers, and the score of a place does not depend on the unit of length. A cache stays where it was while that is on
//! its surface and no place in its cluster is clearly better; its light is made anew every frame. Where there is no
//! room for a cache for every cluster, depth is sliced more coarsely, then facings are merged.
//!
//! # What it cannot know
//!
//! Light from outside of the grid is that of the sky where caches are the technique; beside virtual point lights it is
//! not in them, for Bevy reflects it. A reflection is as sharp as a texel of a cache, ten degrees, at most, and as fine
//! as a voxel. What is glossy lights others as if it were matt. At a distance, what is aslant to the axes of the grid
//! closes more of a cone than it fills, by up to three quarters at its outline.

mod counters;
mod light;
mod passes;
mod pipelines;
mod prepare;
mod settings;
mod volume;

use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::renderer::RenderGraph;
use bevy::render::{Render, RenderApp, RenderStartup};

use crate::avg::prepare_grid;
use crate::camera::device_is_adequate;
use crate::compose::ViewPass;
use crate::compute::load_shaders;
use crate::plugins::{GiSystems, configure_stages};
use crate::recovery::{forget_components, forget_resource};
use crate::view::prepare_view_textures;

pub use counters::{CacheCounts, cache_counts};
pub(crate) use prepare::CacheBuffers;
pub use settings::RadianceCacheSettings;
pub(crate) use volume::VoxelLight;

/// Caches incident light; see the [module](self).
pub struct RadianceCachePlugin;

impl Plugin for RadianceCachePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<RadianceCacheSettings>();
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) {
            return;
        }
        load_shaders(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .add_systems(
                RenderStartup,
                (
                    pipelines::init_light_pipelines,
                    pipelines::init_cache_pipelines,
                    forget_resource::<VoxelLight>,
                    forget_components::<CacheBuffers>,
                ),
            )
            .add_systems(
                Render,
                (
                    volume::prepare_voxel_light.in_set(GiSystems::Prepare).after(prepare_grid),
                    prepare::prepare_caches.in_set(GiSystems::Prepare).after(prepare_view_textures),
                ),
            )
            .add_systems(RenderGraph, light::light_voxels.in_set(GiSystems::VoxelLight))
            .add_systems(
                Core3d,
                (
                    passes::distribute.in_set(ViewPass::CacheDistribution),
                    passes::create.in_set(ViewPass::CacheCreation),
                    passes::evaluate.in_set(ViewPass::CacheEvaluation),
                ),
            );
    }
}
