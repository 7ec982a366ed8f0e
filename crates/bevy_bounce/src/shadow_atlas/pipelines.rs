//! Kernels of the shadow atlas and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer_sized,
};
use bevy::render::render_resource::{BindGroup, BindGroupLayoutDescriptor, PipelineCache};
use bevy::render::renderer::RenderDevice;
use bevy::shader::ShaderDefVal;

use super::prepare::ShadowAtlas;
use crate::VplVisibility;
use crate::avg::{VoxelGrid, bind_grid, bind_sky, grid_layout, sky_layout};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, bind_group, group_layout, whole};
use crate::cssm::maps_layout;
use crate::scene::SceneBuffers;

/// Kernels in the order they run.
#[derive(Resource)]
pub(super) struct AtlasPipelines {
    pub place_occluders: Kernel,
    pub rasterize: Kernel,
    pub place_points: Kernel,
    pub splat_points: Kernel,
    /// What lights on baked objects see of these.
    pub find_eyes: Kernel,
    pub draw_baked: Kernel,
    /// `place_occluders` and `rasterize` for what they see of the rest.
    pub place_others: Kernel,
    pub rasterize_others: Kernel,
}

impl AtlasPipelines {
    /// Whether all are compiled that draw what lights see in that way, with bakes or without.
    pub fn are_ready(&self, visibility: VplVisibility, cache: &PipelineCache) -> bool {
        let points = [&self.place_points, &self.splat_points];
        let triangles = [&self.place_occluders, &self.rasterize];
        let bakes = [&self.find_eyes, &self.draw_baked, &self.place_others, &self.rasterize_others];
        match visibility {
            VplVisibility::None | VplVisibility::Voxel => true,
            VplVisibility::Ism => are_ready(points, cache),
            VplVisibility::Atlas => are_ready(triangles, cache),
            VplVisibility::Baked => are_ready(triangles.into_iter().chain(bakes), cache),
        }
    }
}

/// Group 2 of the kernels that look up depths: sizes, the atlas. See `shadow_atlas/lookup.wgsl`.
fn atlas_layout() -> BindGroupLayoutDescriptor {
    group_layout("bounce_atlas", &[uniform_buffer_sized(false, None), storage_buffer_read_only_sized(false, None)])
}

/// Definition by which shaders look in that way; all maps are looked up alike.
pub(crate) fn visibility_def(visibility: VplVisibility) -> Option<ShaderDefVal> {
    match visibility {
        VplVisibility::None => None,
        VplVisibility::Voxel => Some("VISIBILITY_VOXEL".into()),
        VplVisibility::Ism | VplVisibility::Atlas | VplVisibility::Baked => Some("VISIBILITY_ATLAS".into()),
    }
}

/// Groups 1 and 2 of the kernels in which virtual lights see, where they need them: the grid, with the sky or without; the atlas.
pub(crate) fn visibility_layouts(visibility: VplVisibility, sky: bool) -> Vec<BindGroupLayoutDescriptor> {
    let grid = if sky { sky_layout() } else { grid_layout() };
    match visibility {
        VplVisibility::None if !sky => vec![],
        VplVisibility::None | VplVisibility::Voxel => vec![grid],
        VplVisibility::Ism | VplVisibility::Atlas | VplVisibility::Baked => vec![grid, atlas_layout()],
    }
}

/// What virtual lights see by, of what is asked for and what is there, and the groups of [`visibility_layouts`]; `sky` is the scene where
/// there is one. Without maps they see by rays through the grid.
pub(crate) fn bind_visibility(
    asked: VplVisibility,
    atlas: Option<&ShadowAtlas>,
    grid: &VoxelGrid,
    sky: Option<&SceneBuffers>,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> Option<(VplVisibility, Vec<BindGroup>)> {
    let bind_grid = || match sky {
        Some(scene) => bind_sky(grid, scene, device, cache),
        None => bind_grid(grid, device, cache),
    };
    let atlas_group = || {
        let atlas = atlas?;
        let resources = [atlas.parameters.binding()?, whole(&atlas.atlas)];
        Some(bind_group(device, cache, &atlas_layout(), &resources))
    };
    match asked {
        VplVisibility::None if sky.is_none() => Some((asked, vec![])),
        VplVisibility::None | VplVisibility::Voxel => Some((asked, vec![bind_grid()?])),
        VplVisibility::Ism | VplVisibility::Atlas | VplVisibility::Baked => Some(match atlas_group() {
            Some(atlas) => (VplVisibility::Atlas, vec![bind_grid()?, atlas]),
            None => (VplVisibility::Voxel, vec![bind_grid()?]),
        }),
    }
}

pub(super) fn init_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let kernel_with = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    let kernel = |path, entry, bindings: &[_]| kernel_with(path, entry, bindings, &[], vec![]);
    let others = |path, entry, bindings: &[_]| kernel_with(path, entry, bindings, &[], vec!["BAKED".into()]);
    // Geometry, instances, materials, thumbnails, chunks or points; occluders; where there are bakes, objects of the instances.
    let place = [read, read, read, read, read, write, read];
    // The same for points, and parameters.
    let place_points = [read, read, read, read, read, write, uniform];
    // Parameters, grid; header, occluders; lights, atlas; where there are bakes, eyes.
    let draw = [uniform, uniform, read, read, read, write, read];
    // Texels, bakes; tree; header, lights; eyes.
    let find = [read, uniform, read, read, read, write];
    // Texels, bakes; sizes; eyes, lights; atlas.
    let look = [read, uniform, uniform, read, read, write];
    commands.insert_resource(AtlasPipelines {
        place_occluders: kernel("shadow_atlas/occluders.wgsl", "place_occluders", &place[..6]),
        rasterize: kernel("shadow_atlas/rasterize.wgsl", "rasterize", &draw[..6]),
        place_points: kernel("shadow_atlas/points.wgsl", "place_points", &place_points),
        splat_points: kernel("shadow_atlas/splat.wgsl", "splat_points", &draw[..6]),
        find_eyes: kernel("shadow_atlas/eyes.wgsl", "find_eyes", &find),
        draw_baked: kernel_with("shadow_atlas/baked.wgsl", "draw_baked", &look, &[maps_layout()], vec![]),
        place_others: others("shadow_atlas/occluders.wgsl", "place_occluders", &place),
        rasterize_others: others("shadow_atlas/rasterize.wgsl", "rasterize", &draw),
    });
}
