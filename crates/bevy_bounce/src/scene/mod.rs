//! The scene on the GPU: everything that can bounce light, seen by a camera or not.
//!
//! Every technique reads only this: `SceneBuffers` and the WGSL module `bevy_bounce::shared::scene`. Data flows one way:
//!
//! | file | from | to |
//! |---|---|---|
//! | `extract` | main world, by change | components as they are |
//! | `meshes`, `pack` | extracted mesh assets | geometry buffer |
//! | `stand_in` | materials of a game's own | `StandardMaterial`s that stand for them |
//! | `materials` | `StandardMaterial`s | table of [`Material`](bevy_bounce_shaders::types::Material)s |
//! | `thumbnails` | images | 16x16 means |
//! | `instances` | all of the above | instances, chunks, bounds |
//! | `groups` | rigid groups of instances | which voxel grids of their own they have, where these stand |
//! | `deform` | skins and morph weights | poses, room for deformed vertices |
//! | `air` | Bevy's atmosphere | what it takes from directional lights |
//! | `lights` | Bevy's lights, bounds | lights and their powers |
//! | `sky` | the cube map or ambient light that lights a camera | directional lights that stand for it, on the GPU |
//! | `prepare` | the tables | buffers, uploads of what changed |
//! | `passes` | poses, images | deformed vertices, thumbnails, on the GPU |
//!
//! What takes part is said in `instances`, `materials` and `lights`.

mod air;
mod allocator;
mod bounds;
mod deform;
mod deviation;
mod extract;
mod groups;
mod instances;
mod lights;
mod lods;
mod materials;
mod meshes;
mod occluders;
mod pack;
mod passes;
mod prepare;
mod regions;
mod sky;
mod stand_in;
mod table;
#[cfg(test)]
mod tests;
mod thumbnails;

use bevy::prelude::*;
use bevy::render::mesh::RenderMesh;
use bevy::render::render_asset::prepare_assets;
use bevy::render::renderer::RenderGraph;
use bevy::render::texture::GpuImage;
use bevy::render::{ExtractSchedule, Render, RenderApp, RenderStartup, RenderSystems};

use self::deform::{DeformJobs, ExtractedPoses, extract_poses, update_deformed};
use self::extract::{ExtractedInstances, ExtractedMaterials, SceneCameras};
use self::extract::{extract_cameras, forget_changes};
use self::groups::{ExtractedGroups, extract_groups, update_groups};
use self::instances::{resolve_instances, update_instances};
use self::lights::{ExtractedLights, Lights, extract_lights, update_lights};
use self::materials::{Materials, resolve_materials, update_materials};
use self::meshes::collect_meshes;
use self::occluders::{Occluders, choose_occluders};
use self::passes::{init_pipelines, scene_pass};
use self::prepare::{init_scene, upload_scene};
use self::regions::place_regions;
use self::sky::{ExtractedSky, extract_sky, init_sky, light_sky, update_sky};
use self::thumbnails::{Wraps, collect_images, update_thumbnails};
use crate::GiSystems;
use crate::camera::device_is_adequate;
use crate::compute::load_shaders;
use crate::plugins::configure_stages;

pub(crate) use self::bounds::Bounds;
pub use self::groups::VoxelizedGroup;
pub(crate) use self::groups::{GroupGrid, Groups};
pub(crate) use self::instances::Instances;
pub(crate) use self::occluders::LARGEST_ERROR;
pub(crate) use self::prepare::SceneBuffers;
pub(crate) use self::regions::Regions;
pub(crate) use self::sky::SkyBuffers;
pub use self::stand_in::{GiMaterial, GiMaterialPlugin};

/// What a light adds to the bounced light; without it a light takes part as [`GiLight::default`]. On a camera, it is that of the
/// sky, ambient light included: see [`GiSettings::sky`](crate::GiSettings::sky).
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct GiLight {
    /// Scales its bounced light; 1 is physical, 0 is off.
    pub intensity: f32,
    /// Scales its share of the virtual lights; 1 is by power. More is calmer for this light, noisier for the others.
    pub share: f32,
    /// Longest path from it, in bounces.
    pub bounces: u32,
}

impl GiLight {
    /// Does not bounce.
    pub const OFF: Self = Self { intensity: 0.0, share: 0.0, bounces: 0 };
}

impl Default for GiLight {
    fn default() -> Self {
        Self { intensity: 1.0, share: 1.0, bounces: u32::MAX }
    }
}

/// How a mesh takes part; without it a mesh takes part as [`VoxelizedMesh::default`].
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct VoxelizedMesh {
    /// Is there for bounced light: reflects it and blocks it.
    pub enabled: bool,
    /// Diffuse albedo instead of the material's.
    pub albedo: Option<Color>,
    /// Reflects on both sides; `None` follows the material's `double_sided` and `cull_mode`.
    pub two_sided: Option<bool>,
}

impl VoxelizedMesh {
    /// Neither reflects nor blocks bounced light.
    pub const OFF: Self = Self { enabled: false, albedo: None, two_sided: None };
}

impl Default for VoxelizedMesh {
    fn default() -> Self {
        Self { enabled: true, albedo: None, two_sided: None }
    }
}

/// Keeps instances, materials and lights on the GPU.
pub struct GiScenePlugin;

impl Plugin for GiScenePlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<GiLight>().register_type::<VoxelizedMesh>().register_type::<VoxelizedGroup>();
        app.add_plugins(GiMaterialPlugin::<StandardMaterial>::default());
    }

    fn finish(&self, app: &mut App) {
        if !device_is_adequate(app) || !app.world().contains_resource::<Assets<StandardMaterial>>() {
            return;
        }
        load_shaders(app);
        let images = app.get_added_plugins::<ImagePlugin>();
        let wraps = images.first().map_or_else(Wraps::default, |images| Wraps::new(&images.default_sampler));
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        configure_stages(render_app);
        render_app
            .init_resource::<SceneCameras>()
            .init_resource::<ExtractedInstances>()
            .init_resource::<ExtractedGroups>()
            .init_resource::<ExtractedMaterials>()
            .init_resource::<ExtractedLights>()
            .init_resource::<ExtractedPoses>()
            .init_resource::<ExtractedSky>()
            .init_resource::<Instances>()
            .init_resource::<Groups>()
            .init_resource::<Regions>()
            .init_resource::<Materials>()
            .init_resource::<Occluders>()
            .init_resource::<Lights>()
            .init_resource::<DeformJobs>()
            .insert_resource(wraps)
            .add_systems(RenderStartup, (init_scene, init_pipelines, init_sky))
            .add_systems(
                ExtractSchedule,
                (forget_changes, extract_cameras, (extract_groups, extract_lights, extract_poses, extract_sky)).chain(),
            )
            .add_systems(
                Render,
                (
                    collect_meshes.in_set(RenderSystems::PrepareAssets).before(prepare_assets::<RenderMesh>),
                    collect_images.in_set(RenderSystems::PrepareAssets).before(prepare_assets::<GpuImage>),
                    (
                        update_materials,
                        update_thumbnails,
                        resolve_materials,
                        update_instances,
                        update_deformed,
                        resolve_instances,
                        place_regions,
                        choose_occluders,
                        update_groups,
                        update_lights,
                        update_sky,
                        upload_scene,
                    )
                        .chain()
                        .in_set(GiSystems::PrepareScene),
                ),
            )
            .add_systems(RenderGraph, (scene_pass, light_sky).chain().in_set(GiSystems::Scene));
    }
}
