//! Uploads what changed, and hands out the buffers.

use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy::render::render_resource::{BindingResource, Buffer, BufferDescriptor, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{LIGHT_DIRECTIONAL, Scene};

use super::bounds::Bounds;
use super::deform::DeformJobs;
use super::instances::Instances;
use super::lights::Lights;
use super::materials::Materials;
use super::meshes::{Geometry, Meshes};
use super::occluders::Occluders;
use super::regions::Regions;
use super::table::STORAGE_USAGES;
use super::thumbnails::Thumbnails;

/// The scene on the GPU, the same for every camera. Written in `GiSystems::PrepareScene`; every buffer can be bound at any
/// time, and is a new one after growth: bind groups are made anew every frame.
#[derive(Resource)]
pub(crate) struct SceneBuffers {
    /// `array<u32>`: vertices, indices, deformed vertices. See `types/scene.rs`.
    pub geometry: Buffer,
    /// `array<Instance>`, by slot; free ones have no triangles.
    pub instances: Buffer,
    /// `array<Chunk>`: `chunk_count` of them cover all triangles.
    pub chunks: Buffer,
    /// `array<Chunk>`: `emissive_chunk_count` of them cover the triangles that shine.
    pub emissive_chunks: Buffer,
    /// `array<OccluderChunk>`.
    pub occluder_chunks: Buffer,
    /// `array<SurfacePoint>`.
    pub surface_points: Buffer,
    /// `array<Material>`.
    pub materials: Buffer,
    /// `array<u32>`: 16 x 16 texels each.
    pub thumbnails: Buffer,
    /// `array<Light>`: `light_count` of them, then `sky_count` that the GPU sets.
    pub lights: Buffer,
    uniform: UniformBuffer<Scene>,
    bounds: Bounds,
    regions: Regions,
    occluders: OccluderCounts,
    pose_bytes: u64,
    light_revision: u64,
    sky_count: u32,
    has_directional_lights: bool,
}

impl SceneBuffers {
    fn new(device: &RenderDevice, geometry: &Geometry) -> Self {
        let placeholder = || {
            device.create_buffer(&BufferDescriptor {
                label: Some("bounce_nothing"),
                size: 256,
                usage: STORAGE_USAGES,
                mapped_at_creation: false,
            })
        };
        Self {
            geometry: geometry.buffer.clone(),
            instances: placeholder(),
            chunks: placeholder(),
            emissive_chunks: placeholder(),
            occluder_chunks: placeholder(),
            materials: placeholder(),
            thumbnails: placeholder(),
            lights: placeholder(),
            uniform: UniformBuffer::default(),
            bounds: Bounds::EMPTY,
            regions: Regions::default(),
            occluders: OccluderCounts::default(),
            surface_points: placeholder(),
            pose_bytes: 0,
            light_revision: 0,
            sky_count: 0,
            has_directional_lights: false,
        }
    }

    /// Uniform `Scene`: sizes and bounds; there from the first frame on.
    pub fn uniform(&self) -> Option<BindingResource<'_>> {
        self.uniform.binding()
    }

    /// Box of all that takes part; `None` without anything.
    pub fn bounds(&self) -> Option<Aabb3d> {
        (!self.bounds.is_empty()).then(|| Aabb3d { min: self.bounds.min.into(), max: self.bounds.max.into() })
    }

    /// Boxes round the cameras, from the innermost to all that takes part.
    pub fn regions(&self) -> &[Bounds] {
        self.regions.boxes()
    }

    /// Box of what takes part near the cameras; `None` without anything.
    pub fn inner_bounds(&self) -> Option<Aabb3d> {
        let inner = self.regions().first().filter(|inner| !inner.is_empty())?;
        Some(Aabb3d { min: inner.min.into(), max: inner.max.into() })
    }

    /// Chunks of all instances.
    pub fn chunk_count(&self) -> u32 {
        self.uniform.get().chunk_count
    }

    /// Chunks of those that shine.
    pub fn emissive_chunk_count(&self) -> u32 {
        self.uniform.get().emissive_chunk_count
    }

    /// Of those, the ones voxelised with the world.
    pub fn world_chunk_count(&self) -> u32 {
        self.uniform.get().world_chunk_count
    }

    /// The same of those that shine.
    pub fn world_emissive_chunk_count(&self) -> u32 {
        self.uniform.get().world_emissive_chunk_count
    }

    /// What casts shadows into the maps of virtual lights.
    pub fn occluders(&self) -> OccluderCounts {
        self.occluders
    }

    /// Directional lights that stand for the sky; 0 without one.
    pub fn sky_count(&self) -> u32 {
        self.sky_count
    }

    /// Whether paths may start at directional lights, those of the sky among them.
    pub fn has_directional_lights(&self) -> bool {
        self.has_directional_lights || self.sky_count > 0
    }

    /// Sets that number for this frame, before the upload.
    pub(super) fn set_sky_count(&mut self, count: u32) {
        self.sky_count = count;
    }

    /// Counts the frames in which lights, materials or their textures became others.
    pub fn light_revision(&self) -> u64 {
        self.light_revision
    }

    /// What each buffer holds on the GPU, bytes.
    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("scene: geometry", self.geometry.size()),
            ("scene: instances", self.instances.size()),
            ("scene: chunks", self.chunks.size() + self.emissive_chunks.size()),
            ("scene: occluders", self.occluder_chunks.size() + self.surface_points.size()),
            ("scene: materials", self.materials.size()),
            ("scene: thumbnails", self.thumbnails.size()),
            ("scene: lights", self.lights.size()),
            ("scene: poses", self.pose_bytes),
        ]
    }
}

/// What casts shadows into the maps of virtual lights.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct OccluderCounts {
    /// Chunks of triangles.
    pub chunks: u32,
    /// Their triangles.
    pub triangles: u32,
    /// How far they are from the surfaces, world units.
    pub error: f32,
    /// Points.
    pub points: u32,
    /// Of a point, square world units.
    pub point_area: f32,
}

impl OccluderCounts {
    fn of(occluders: &Occluders) -> Self {
        let chunks = occluders.chunks.values();
        Self {
            chunks: chunks.len() as u32,
            triangles: chunks.iter().map(|chunk| chunk.triangle_count).sum(),
            error: occluders.error,
            points: occluders.points.values().len() as u32,
            point_area: occluders.point_area,
        }
    }
}

/// Buffers on a device that is new: at start, and after the old one was lost.
pub(super) fn init_scene(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut instances: ResMut<Instances>,
    mut materials: ResMut<Materials>,
    mut lights: ResMut<Lights>,
    mut deform: ResMut<DeformJobs>,
    mut occluders: ResMut<Occluders>,
) {
    instances.lose_buffers();
    occluders.lose_buffers();
    deform.lose_buffers();
    materials.table.lose_buffer();
    lights.table.lose_buffer();
    let geometry = Geometry::new(&device);
    let mut thumbnails = Thumbnails::new(&device);
    materials.reacquire(&mut thumbnails);
    commands.insert_resource(thumbnails);
    commands.insert_resource(SceneBuffers::new(&device, &geometry));
    commands.insert_resource(geometry);
    commands.insert_resource(Meshes::default());
}

/// Uploads the tables and the sizes.
pub(super) fn upload_scene(
    mut buffers: ResMut<SceneBuffers>,
    mut instances: ResMut<Instances>,
    mut occluders: ResMut<Occluders>,
    mut materials: ResMut<Materials>,
    mut lights: ResMut<Lights>,
    geometry: Res<Geometry>,
    thumbnails: Res<Thumbnails>,
    deform: Res<DeformJobs>,
    regions: Res<Regions>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let (buffers, instances) = (&mut *buffers, &mut *instances);
    let follow = |held: &mut Buffer, current: Option<&Buffer>| {
        if let Some(current) = current {
            *held = current.clone();
        }
    };
    let changed = lights.table.is_dirty() || materials.table.is_dirty() || !thumbnails.queue.is_empty();
    let fewer = lights.table.values().len() as u32 != buffers.uniform.get().light_count;
    buffers.light_revision += u64::from(changed || fewer);
    lights.table.reserve(buffers.sky_count as usize);
    macro_rules! upload {
        ($table:expr, $buffer:expr) => {
            $table.upload(&device, &queue);
            follow(&mut $buffer, $table.buffer());
        };
    }
    upload!(instances.table, buffers.instances);
    upload!(instances.chunks, buffers.chunks);
    upload!(instances.emissive_chunks, buffers.emissive_chunks);
    upload!(occluders.chunks, buffers.occluder_chunks);
    upload!(occluders.points, buffers.surface_points);
    upload!(materials.table, buffers.materials);
    upload!(lights.table, buffers.lights);
    follow(&mut buffers.geometry, Some(&geometry.buffer));
    follow(&mut buffers.thumbnails, Some(&thumbnails.buffer));

    buffers.has_directional_lights = lights.table.values().iter().any(|light| light.kind == LIGHT_DIRECTIONAL);
    buffers.bounds = instances.bounds();
    buffers.regions.clone_from(&regions);
    buffers.occluders = OccluderCounts::of(&occluders);
    buffers.pose_bytes = deform.bytes();
    let scene = scene_of(buffers, instances, &materials, &lights);
    if *buffers.uniform.get() != scene || buffers.uniform.buffer().is_none() {
        buffers.uniform.set(scene);
        buffers.uniform.write_buffer(&device, &queue);
    }
}

/// What shaders are told of the whole scene; bounds and regions are those in the buffers.
fn scene_of(buffers: &SceneBuffers, instances: &Instances, materials: &Materials, lights: &Lights) -> Scene {
    let (scene_regions, region_count) = buffers.regions.on_gpu();
    let bounds = if buffers.bounds.is_empty() { Bounds { min: Vec3::ZERO, max: Vec3::ZERO } } else { buffers.bounds };
    Scene {
        bounds_min: bounds.min,
        light_count: lights.table.values().len() as u32,
        bounds_max: bounds.max,
        light_power: lights.power,
        chunk_count: instances.chunks.values().len() as u32,
        emissive_chunk_count: instances.emissive_chunks.values().len() as u32,
        max_emission: materials.max_emission(),
        sky_count: buffers.sky_count,
        regions: scene_regions,
        region_count,
        world_chunk_count: instances.world_chunks[0],
        world_emissive_chunk_count: instances.world_chunks[1],
    }
}
