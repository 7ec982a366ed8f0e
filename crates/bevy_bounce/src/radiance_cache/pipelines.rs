//! Kernels of the radiance caches and their bindings.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_3d, texture_storage_2d,
    texture_storage_3d, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    AddressMode, BindGroup, BindGroupLayoutDescriptor, BindingResource, FilterMode, MipmapFilterMode, PipelineCache,
    Sampler, SamplerBindingType, SamplerDescriptor, StorageTextureAccess, TextureFormat, TextureSampleType,
};
use bevy::render::renderer::RenderDevice;

use super::volume::VoxelLight;
use crate::avg::{TriangleRun, VoxelGrid, grid_layout};
use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, bind_group, group_layout};

/// Kernels that light the voxels, in the order they run.
#[derive(Resource)]
pub(super) struct LightPipelines {
    pub emit: TriangleRun,
    pub list_places: Kernel,
    pub list_group_places: Kernel,
    pub measure_unit: Kernel,
    pub light_cells: Kernel,
    pub fill: Kernel,
    pub fill_groups: Kernel,
    pub reduce: Kernel,
}

/// Kernels of a view, in the order they run.
#[derive(Resource)]
pub(super) struct CachePipelines {
    pub choose_axes: Kernel,
    pub write_keys: Kernel,
    pub count_differences: Kernel,
    pub choose_coarseness: Kernel,
    pub count_blocks: Kernel,
    pub scan_blocks: Kernel,
    pub number_clusters: Kernel,
    pub keep: Kernel,
    pub place: Kernel,
    create: Kernel,
    create_with_sky: Kernel,
    evaluate_glossy: Kernel,
    evaluate_all: Kernel,
    /// Linear between texels and levels.
    pub sampler: Sampler,
}

impl LightPipelines {
    /// Whether all are compiled.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        let places = [&self.list_places, &self.list_group_places, &self.measure_unit];
        let light = [&self.light_cells, &self.fill, &self.fill_groups, &self.reduce];
        are_ready(self.emit.kernels().into_iter().chain(places).chain(light), cache)
    }
}

impl CachePipelines {
    /// Whether all that light pixels so are compiled, under a sky or not.
    pub fn are_ready(&self, diffuse: bool, cache: &PipelineCache) -> bool {
        let clusters = [&self.choose_axes, &self.write_keys, &self.count_differences, &self.choose_coarseness];
        let blocks = [&self.count_blocks, &self.scan_blocks, &self.number_clusters];
        let caches = [&self.keep, &self.place, &self.create, &self.create_with_sky, self.evaluate(diffuse)];
        are_ready(clusters.into_iter().chain(blocks).chain(caches), cache)
    }

    /// The kernel that fills caches: with bounced light alone, or with the sky's too.
    pub fn create(&self, sky: bool) -> &Kernel {
        if sky { &self.create_with_sky } else { &self.create }
    }

    /// The kernel that lights pixels: glossy alone, or diffuse too.
    pub fn evaluate(&self, diffuse: bool) -> &Kernel {
        if diffuse { &self.evaluate_all } else { &self.evaluate_glossy }
    }
}

/// Group 1 of what marches cones: grid, volume, levels by axis, sampler; groups, their levels by axis. See `radiance_cache/march.wgsl`.
fn volume_layout() -> BindGroupLayoutDescriptor {
    let uniform = uniform_buffer_sized(false, None);
    let light = texture_3d(TextureSampleType::Float { filterable: true });
    let filtering = sampler(SamplerBindingType::Filtering);
    group_layout("bounce_volume", &[uniform, uniform, light, light, light, filtering, uniform, light, light, light])
}

/// The light of the voxels as group 1.
pub(super) fn bind_volume(
    p: &CachePipelines,
    grid: &VoxelGrid,
    light: &VoxelLight,
    device: &RenderDevice,
    cache: &PipelineCache,
) -> Option<BindGroup> {
    let [x, y, z] = light.world.light.each_ref().map(|view| BindingResource::TextureView(view));
    let [group_x, group_y, group_z] = light.group_light().each_ref().map(|view| BindingResource::TextureView(view));
    let resources = [
        grid.uniform.binding()?,
        light.parameters.binding()?,
        x,
        y,
        z,
        BindingResource::Sampler(&p.sampler),
        grid.groups.uniform.binding()?,
        group_x,
        group_y,
        group_z,
    ];
    Some(bind_group(device, cache, &volume_layout(), &resources))
}

pub(super) fn init_light_pipelines(mut commands: Commands, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let finer = texture_3d(TextureSampleType::Float { filterable: false });
    let level = texture_storage_3d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let kernel = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    // Geometry, instances, materials, thumbnails; grid, scene; chunks, queue; voxels, sums.
    let emission = [read, read, read, read, uniform, uniform, read, write, read, write];
    // Grid, scene; voxels, emitters; places, unit; lights; volume, groups.
    let places = [uniform, uniform, read, read, write, write, read, uniform, uniform];
    // Scene; lights, header, list, places; grid, densities; irradiance, volume.
    let light = [uniform, read, read, read, read, uniform, read, write, uniform];
    // Volume, grid, scene; voxels, cells, irradiance, emission, unit; levels; groups.
    let fill = [uniform, uniform, uniform, read, read, read, read, read, level, level, level, uniform];
    // Volume; finer levels; levels.
    let reduce = [uniform, finer, finer, finer, level, level, level];
    commands.insert_resource(LightPipelines {
        emit: TriangleRun::new(&shaders, &emission, &["ACCUMULATE".into(), "EMISSION".into()]),
        list_places: kernel("radiance_cache/places.wgsl", "list_places", &places, &[], vec![]),
        list_group_places: kernel("radiance_cache/places.wgsl", "list_group_places", &places, &[], vec![]),
        measure_unit: kernel("radiance_cache/places.wgsl", "measure_unit", &places, &[], vec![]),
        light_cells: kernel("radiance_cache/light.wgsl", "light_cells", &light, &[grid_layout()], vec![]),
        fill: kernel("radiance_cache/volume.wgsl", "fill", &fill, &[], vec![]),
        fill_groups: kernel("radiance_cache/volume.wgsl", "fill", &fill, &[], vec!["GROUPS".into()]),
        reduce: kernel("radiance_cache/reduce.wgsl", "reduce", &reduce, &[], vec![]),
    });
}

pub(super) fn init_cache_pipelines(mut commands: Commands, device: Res<RenderDevice>, shaders: Res<GiShaders>) {
    let uniform = uniform_buffer_sized(false, None);
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    let words = texture_2d(TextureSampleType::Uint);
    let light = texture_2d(TextureSampleType::Float { filterable: true });
    let output = texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let filtering = sampler(SamplerBindingType::Filtering);
    let kernel = |path, entry, bindings: &[_], groups: &[_], defs| {
        Kernel::new(&shaders, KernelDescriptor { path, entry, bindings, groups, defs })
    };
    // Parameters, pairs; counters, blocks, starts, ranges.
    let clusters = [uniform, read, write, write, write, write];
    let cluster = |entry| kernel("radiance_cache/clusters.wgsl", entry, &clusters, &[], vec![]);
    // View, parameters, surface; last frame's caches; which are kept.
    let keep = [uniform, uniform, words, read, write];
    // View, parameters, surface; counters, pairs, starts; last frame's caches, which are kept; caches.
    let place = [uniform, uniform, words, read, read, read, read, read, write];
    // View, parameters, surface, G-buffer; atlas and sampler; unit, caches, ranges; counters; glossy light, clearcoats', diffuse light.
    let evaluate = [uniform, uniform, words, words, light, filtering, read, read, read, write, output, output, output];
    let frames = [uniform, words, write];
    let keys = [uniform, words, read, write, write];
    // Counters, caches; atlas; sky, unit.
    let create = [read, read, output, read, read];
    let creation =
        |bindings: &[_], defs| kernel("radiance_cache/create.wgsl", "create", bindings, &[volume_layout()], defs);
    let evaluation = |bindings: &[_], defs| kernel("radiance_cache/evaluate.wgsl", "evaluate", bindings, &[], defs);
    commands.insert_resource(CachePipelines {
        choose_axes: kernel("radiance_cache/frame.wgsl", "choose_axes", &frames, &[], vec![]),
        write_keys: kernel("radiance_cache/keys.wgsl", "write_keys", &keys, &[], vec![]),
        count_differences: cluster("count_differences"),
        choose_coarseness: cluster("choose_coarseness"),
        count_blocks: cluster("count_blocks"),
        scan_blocks: cluster("scan_blocks"),
        number_clusters: cluster("number_clusters"),
        keep: kernel("radiance_cache/keep.wgsl", "keep", &keep, &[], vec![]),
        place: kernel("radiance_cache/place.wgsl", "place", &place, &[], vec![]),
        create: creation(&create[..3], vec![]),
        create_with_sky: creation(&create, vec!["SKY".into()]),
        evaluate_glossy: evaluation(&evaluate[..12], vec![]),
        evaluate_all: evaluation(&evaluate, vec!["DIFFUSE".into()]),
        sampler: device.create_sampler(&SamplerDescriptor {
            label: Some("bounce_linear"),
            address_mode_u: AddressMode::ClampToEdge,
            address_mode_v: AddressMode::ClampToEdge,
            address_mode_w: AddressMode::ClampToEdge,
            mag_filter: FilterMode::Linear,
            min_filter: FilterMode::Linear,
            mipmap_filter: MipmapFilterMode::Linear,
            ..default()
        }),
    });
}
