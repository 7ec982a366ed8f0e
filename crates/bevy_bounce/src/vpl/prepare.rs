//! Buffers of the path tracer.

use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{
    BRICK_WORDS, CANDIDATES, CHUNK_TRIANGLES, CompactVpl, Emitter, LIST_ENTRY_WORDS, NODE_STEPS, Path, UNIFORM_VPLS,
    Vpl, VplHeader, VplParameters,
};

use crate::avg::VoxelGrid;
use crate::scene::SceneBuffers;
use crate::settings::{GiWorldSettings, StatedLights};
use crate::sort::SortBuffers;

/// Paths traced for each virtual light there is room for. At a mean albedo a, a path has a / (1 - a) vertices: each light carries
/// the mean of nineteen at an albedo of 0.7, and the list is full down to an albedo of a ninth.
const PATHS_PER_VPL: u32 = 8;

/// Voxels that a triangle lies in: a small one in one or two of a grid.
const ENTRIES_PER_TRIANGLE: u64 = 3;

/// Virtual lights on the GPU.
#[derive(Resource)]
pub(crate) struct VplBuffers {
    /// Sizes, of what there is room for or less.
    pub parameters: UniformBuffer<VplParameters>,
    room: VplParameters,
    vertices: Option<Buffer>,
    vertex_bytes: u64,
    /// Vertices of each path.
    pub paths: Buffer,
    /// Where light from places falls in which paths from directional lights may start, [`CANDIDATES`] words each.
    pub candidates: Buffer,
    /// Vertices of all paths: one word.
    pub vertex_count: Buffer,
    /// Vertices in the order they are cut into lights.
    pub order: SortBuffers,
    /// What the vertices before each weigh, and all.
    pub starts: Buffer,
    /// Where the order may be cut, then places of the lights in the list; how often each error of a node occurs,
    /// [`NODE_STEPS`] words: see `vpl/cuts.wgsl`.
    pub nodes: Buffer,
    pub steps: Buffer,
    /// First vertex of each light, and the end of the last.
    pub firsts: Buffer,
    /// What is known of each brick of the grid, [`BRICK_WORDS`] each.
    pub bricks: Buffer,
    /// By brick: lights, times the scale of the bound; area of the surfaces, square world units.
    pub densities: Buffer,
    /// The list; and once more as shading reads it, [`UNIFORM_VPLS`] lights at least.
    pub vpls: Buffer,
    pub compact_vpls: Buffer,
    /// How many paths go on, one word; and the workgroups that take them. See `vpl/alive.wgsl`.
    pub alive_count: Buffer,
    pub alive_workgroups: Buffer,
    /// Triangles in each voxel. See `vpl/triangle_lists.wgsl`.
    pub triangle_lists: Buffer,
    /// What the list holds.
    pub header: Buffer,
    /// Emissive triangles.
    pub emitters: Buffer,
}

impl VplBuffers {
    fn new(device: &RenderDevice, parameters: VplParameters) -> Self {
        let paths = u64::from(parameters.path_count);
        let slots = paths * u64::from(parameters.max_bounces + 1);
        Self {
            parameters: UniformBuffer::from(parameters),
            room: parameters,
            vertices: None,
            vertex_bytes: slots * u64::from(Vpl::min_size()),
            paths: storage(device, "bounce_paths", paths * u64::from(Path::min_size())),
            candidates: storage(device, "bounce_path_candidates", paths * u64::from(CANDIDATES) * 4),
            vertex_count: storage(device, "bounce_path_vertex_count", 4),
            order: SortBuffers::new(device, slots as u32),
            starts: storage(device, "bounce_vpl_starts", (slots + 1) * 4),
            nodes: storage(device, "bounce_vpl_nodes", slots * 4),
            steps: storage(device, "bounce_vpl_node_steps", u64::from(NODE_STEPS) * 4),
            firsts: storage(device, "bounce_vpl_firsts", u64::from(parameters.capacity + 1) * 4),
            bricks: storage(device, "bounce_vpl_bricks", 4),
            densities: storage(device, "bounce_vpl_densities", 8),
            vpls: storage(device, "bounce_vpls", u64::from(parameters.capacity) * u64::from(Vpl::min_size())),
            compact_vpls: device.create_buffer(&BufferDescriptor {
                label: Some("bounce_compact_vpls"),
                size: u64::from(parameters.capacity.max(UNIFORM_VPLS)) * u64::from(CompactVpl::min_size()),
                usage: BufferUsages::STORAGE | BufferUsages::UNIFORM,
                mapped_at_creation: false,
            }),
            alive_count: storage(device, "bounce_paths_alive", 4),
            alive_workgroups: device.create_buffer(&BufferDescriptor {
                label: Some("bounce_path_workgroups"),
                size: 12,
                usage: BufferUsages::STORAGE | BufferUsages::INDIRECT,
                mapped_at_creation: false,
            }),
            triangle_lists: storage(device, "bounce_triangle_lists", 4),
            header: storage(device, "bounce_vpl_header", u64::from(VplHeader::min_size())),
            emitters: storage(device, "bounce_emitters", emitter_bytes(1)),
        }
    }

    /// Whether the list as shading reads it may be bound as a uniform buffer: by the lights stated, so that a budget does not change it.
    pub fn fits_uniform(&self) -> bool {
        self.room.capacity <= UNIFORM_VPLS
    }

    /// What is too small is made anew.
    fn make_room(&mut self, needs: &Needs, limit: u64, device: &RenderDevice) {
        if self.emitters.size() < needs.emitters {
            let roomy = needs.emitters.next_power_of_two().min(limit).max(needs.emitters);
            self.emitters = storage(device, "bounce_emitters", roomy);
        }
        let brick_bytes = needs.bricks * u64::from(BRICK_WORDS) * 4;
        if self.bricks.size() < brick_bytes {
            self.bricks = storage(device, "bounce_vpl_bricks", brick_bytes);
            self.densities = storage(device, "bounce_vpl_densities", needs.bricks * 8);
        }
        if self.triangle_lists.size() < needs.triangle_lists {
            self.triangle_lists = storage(device, "bounce_triangle_lists", needs.roomy_triangle_lists);
        }
        if self.vertex_bytes <= needs.shared {
            self.vertices = None;
        } else if self.vertices.is_none() {
            self.vertices = Some(storage(device, "bounce_path_vertices", self.vertex_bytes));
        }
    }

    /// Where paths were reflected: in the sums of the voxel grid, which are done with by then, where these are large enough.
    pub fn vertices<'a>(&'a self, grid: &'a VoxelGrid) -> &'a Buffer {
        self.vertices.as_ref().unwrap_or(&grid.work.sums)
    }

    /// Sizes of the path tracer.
    pub fn parameters(&self) -> VplParameters {
        *self.parameters.get()
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        vec![
            (
                "vpl: paths",
                self.vertices.as_ref().map_or(0, |vertices| vertices.size())
                    + self.paths.size()
                    + self.candidates.size()
                    + self.bricks.size()
                    + self.alive_count.size()
                    + self.alive_workgroups.size()
                    + self.densities.size(),
            ),
            (
                "vpl: order",
                self.order.bytes()
                    + [&self.starts, &self.nodes, &self.steps, &self.firsts, &self.vertex_count]
                        .iter()
                        .map(|buffer| buffer.size())
                        .sum::<u64>(),
            ),
            ("vpl: triangles", self.triangle_lists.size()),
            ("vpl: list", self.vpls.size() + self.compact_vpls.size() + self.header.size()),
            ("vpl: emitters", self.emitters.size()),
        ]
    }
}

fn storage(device: &RenderDevice, label: &'static str, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn emitter_bytes(chunks: u32) -> u64 {
    u64::from(chunks) * u64::from(CHUNK_TRIANGLES) * u64::from(Emitter::min_size())
}

/// Lists of the triangles in so many voxels have room for as many entries as there are voxels, for what is larger than one, and for
/// [`ENTRIES_PER_TRIANGLE`].
fn list_bytes(voxels: u64, triangles: u64) -> u64 {
    let entries = voxels + triangles * ENTRIES_PER_TRIANGLE;
    (1 + voxels + entries * u64::from(LIST_ENTRY_WORDS)) * 4
}

/// What follows from scene and grid: bytes, but for `bricks`.
struct Needs {
    emitters: u64,
    /// Their number.
    bricks: u64,
    triangle_lists: u64,
    /// The same with a quarter more triangles.
    roomy_triangle_lists: u64,
    /// That the grid lends.
    shared: u64,
}

impl Needs {
    /// Of bindings of `limit` bytes at most.
    fn new(scene: &SceneBuffers, grid: Option<&VoxelGrid>, limit: u64) -> Self {
        let voxels = grid.map_or(0, |grid| grid.world_voxels().1 / 4);
        let triangles = u64::from(scene.chunk_count()) * u64::from(CHUNK_TRIANGLES);
        let lists = |triangles| list_bytes(voxels, triangles).min(limit & !3);
        Self {
            emitters: emitter_bytes(scene.emissive_chunk_count().max(1)),
            bricks: grid.map_or(0, |grid| u64::from(grid.brick_count())),
            triangle_lists: lists(triangles),
            roomy_triangle_lists: lists(triangles + triangles / 4),
            shared: grid.map_or(0, |grid| grid.work.sums.size()),
        }
    }
}

pub(super) fn prepare_vpls(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    settings: Res<GiWorldSettings>,
    stated: Res<StatedLights>,
    scene: Option<Res<SceneBuffers>>,
    grid: Option<Res<VoxelGrid>>,
    buffers: Option<ResMut<VplBuffers>>,
) {
    let Some(settings) = settings.0 else {
        if buffers.is_some() {
            commands.remove_resource::<VplBuffers>();
        }
        return;
    };
    let Some(scene) = scene else { return };
    let limit = device.limits().max_storage_buffer_binding_size;
    let path_bytes = u64::from(settings.bounces + 1) * u64::from(Vpl::min_size());
    let sizes = |vpls: u32| VplParameters {
        capacity: vpls,
        path_count: u64::from(vpls * PATHS_PER_VPL).min(limit / path_bytes) as u32,
        max_bounces: settings.bounces,
        bound_scale: settings.bound,
    };
    let (parameters, room) = (sizes(settings.vpls), sizes(stated.0));
    let needs = Needs::new(&scene, grid.as_deref(), limit);
    let prepare = |buffers: &mut VplBuffers| {
        buffers.make_room(&needs, limit, &device);
        if buffers.parameters.buffer().is_none() || buffers.parameters() != parameters {
            buffers.parameters.set(parameters);
            buffers.parameters.write_buffer(&device, &queue);
        }
    };
    match buffers {
        Some(mut buffers) if buffers.room == room => prepare(&mut buffers),
        _ => {
            let mut buffers = VplBuffers::new(&device, room);
            prepare(&mut buffers);
            commands.insert_resource(buffers);
        }
    }
}
