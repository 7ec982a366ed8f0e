//! Small scenes in the form that the shaders read, built by hand: no app, no extraction.

use bevy::math::{Affine3A, UVec3, Vec2, Vec3, Vec4};
use bevy_bounce_shaders::types::{
    CHUNK_TRIANGLES, Cell, Chunk, Emitter, FURTHER_LEVELS, Grid, GridLevel, Instance, LIST_ENTRY_WORDS, Light,
    Material, NONE, OccluderChunk, Path, REGIONS, Region, Scene, THUMBNAIL_SIZE, UNSETTLED, VERTEX_WORDS, VoxelGroup,
    VoxelGroups, Vpl, VplParameters,
};
use half::f16;

use crate::compose::compose;
use crate::gpu::{Gpu, Kernel, Resources};
use crate::twins::grid::SUM_WORDS;
use crate::twins::voxels::Triangle;

/// Meshes, materials and lights as in `shared/scene.wgsl`.
#[derive(Clone, Debug, Default)]
pub struct TestScene {
    /// Vertices and indices.
    pub geometry: Vec<u32>,
    /// One for each mesh added.
    pub instances: Vec<Instance>,
    /// Materials.
    pub materials: Vec<Material>,
    /// 256 words each: see `scene/thumbnail.wgsl`.
    pub thumbnails: Vec<u32>,
    /// Lights; their running sum of power is computed when they are bound.
    pub lights: Vec<Light>,
    /// Boxes round a camera, from the innermost; the whole scene follows them.
    pub regions: Vec<(Vec3, Vec3)>,
    /// All triangles in world space, in the order of instances.
    pub triangles: Vec<Triangle>,
}

/// Boxes round a camera as the shaders read them, from the innermost; each counts a 64th of the one before.
pub fn regions(boxes: &[(Vec3, Vec3)]) -> [Region; REGIONS] {
    let mut regions = [Region::default(); REGIONS];
    for (i, (region, &(min, max))) in regions.iter_mut().zip(boxes).enumerate() {
        *region = Region { min, weight: 64f32.powi(-(i as i32)), max, padding: 0 };
    }
    regions
}

/// An opaque, diffuse material.
pub fn matte(albedo: Vec3) -> Material {
    Material {
        albedo: albedo.extend(1.0),
        uv_x: Vec4::X,
        uv_y: Vec4::Y,
        albedo_thumbnail: NONE,
        emissive_thumbnail: NONE,
        ..Default::default()
    }
}

impl TestScene {
    /// One material and no meshes.
    pub fn new(albedo: Vec3) -> Self {
        Self { materials: vec![matte(albedo)], ..Default::default() }
    }

    /// Adds a masked, white material, of which as much is there as asked at each texel of its thumbnail; returns its index.
    pub fn masked(&mut self, share: impl Fn(u32, u32) -> f32) -> u32 {
        let albedo_thumbnail = self.thumbnails.len() as u32;
        let texels = (0..THUMBNAIL_SIZE * THUMBNAIL_SIZE).map(|i| share(i % THUMBNAIL_SIZE, i / THUMBNAIL_SIZE));
        self.thumbnails.extend(texels.map(|share| ((share * 255.0).round() as u32) << 24 | 0x00ff_ffff));
        self.materials.push(Material { albedo_thumbnail, alpha_cutoff: 0.5, ..matte(Vec3::ONE) });
        self.materials.len() as u32 - 1
    }

    /// Adds a mesh; returns its instance.
    pub fn mesh(&mut self, triangles: &[Triangle], material: u32, flags: u32, transform: Affine3A) -> u32 {
        let vertex_offset = self.geometry.len() as u32;
        for vertex in triangles.as_flattened() {
            self.geometry.extend(vertex.to_array().map(f32::to_bits));
            self.geometry.push(pack_uv(Vec2::new(vertex.x, vertex.z)));
        }
        let index_offset = self.geometry.len() as u32;
        self.geometry.extend(0..3 * triangles.len() as u32);
        self.triangles.extend(triangles.iter().map(|t| t.map(|p| transform.transform_point3(p))));
        let rows = transform.matrix3.transpose();
        let row = |i: usize| Vec3::from(rows.col(i)).extend(transform.translation[i]);
        self.instances.push(Instance {
            world_from_local_x: row(0),
            world_from_local_y: row(1),
            world_from_local_z: row(2),
            index_offset,
            triangle_count: triangles.len() as u32,
            vertex_offset,
            deformed_offset: NONE,
            color_offset: NONE,
            material,
            flags,
            ..Default::default()
        });
        self.instances.len() as u32 - 1
    }

    /// Adds world-space triangles with the first material, seen from the side where they wind counter-clockwise.
    pub fn soup(&mut self, triangles: &[Triangle]) -> u32 {
        self.mesh(triangles, 0, 0, Affine3A::IDENTITY)
    }

    /// Adds the inside of a box: twelve triangles that face its centre.
    pub fn room(&mut self, min: Vec3, max: Vec3) -> u32 {
        let faces = cuboid(min, max).map(|[a, b, c]| [a, c, b]);
        self.soup(&faces)
    }

    /// Corners of the bounds.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let corners = self.triangles.as_flattened();
        corners.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
    }

    /// A grid of cubic voxels of that size over the bounds, with a border of one and a bit.
    pub fn grid(&self, voxel_size: f32) -> Grid {
        let (low, high) = self.bounds();
        let origin = low - voxel_size * Vec3::new(1.37, 1.31, 1.43);
        let dims = ((high - origin) / voxel_size).ceil() + 1.0;
        let dims = dims.as_uvec3();
        Grid { origin, voxel_size, dims, cell_capacity: 6 * dims.element_product(), ..Default::default() }
    }

    /// Grids within each other: boxes and their voxels from the innermost, then one of that voxel size over the bounds.
    pub fn nested_grid(&self, inner: &[(Vec3, Vec3, f32)], voxel_size: f32) -> Grid {
        let place = |(low, high, size): &(Vec3, Vec3, f32)| GridLevel {
            origin: *low - *size * Vec3::new(0.37, 0.31, 0.43),
            voxel_size: *size,
            dims: ((*high - *low) / *size).ceil().as_uvec3() + 1,
            ..Default::default()
        };
        let whole = self.grid(voxel_size);
        let whole = GridLevel { origin: whole.origin, voxel_size, dims: whole.dims, ..Default::default() };
        let mut levels: Vec<GridLevel> = inner.iter().map(place).chain([whole]).collect();
        for i in 1..levels.len() {
            let before = levels[i - 1];
            let count = |edge: u32| before.dims.map(|voxels| voxels.div_ceil(edge)).element_product();
            levels[i].first_voxel = before.first_voxel + count(1);
            levels[i].first_brick = before.first_brick + count(8);
            levels[i].first_block = before.first_block + count(2);
        }
        let GridLevel { origin, voxel_size, dims, .. } = levels[0];
        let mut further = [GridLevel::default(); FURTHER_LEVELS];
        further[..inner.len()].copy_from_slice(&levels[1..]);
        let further_count = inner.len() as u32;
        let mut grid = Grid { origin, voxel_size, dims, further, further_count, ..Default::default() };
        grid.cell_capacity = 3 * count_of(&grid, 1) as u32;
        grid
    }

    /// Binds everything under the names of the shaders.
    pub fn resources(&self, gpu: &Gpu) -> Resources {
        let chunks = self.chunks(|_| true);
        let emissive = self.chunks(|instance| self.materials[instance.material as usize].emissive != Vec3::ZERO);
        let mut power = 0.0;
        let mut lights = self.lights.clone();
        for (name, light) in lights.iter_mut().enumerate() {
            power += light.cumulative_power;
            light.cumulative_power = power;
            light.name = name as u32;
        }
        let (bounds_min, bounds_max) = self.bounds();
        let boxes: Vec<_> = self.regions.iter().copied().chain([(bounds_min, bounds_max)]).collect();
        let scene = Scene {
            bounds_min,
            bounds_max,
            light_count: lights.len() as u32,
            light_power: power,
            regions: regions(&boxes),
            region_count: self.regions.len() as u32 + 1,
            chunk_count: chunks.len() as u32,
            emissive_chunk_count: emissive.len() as u32,
            world_chunk_count: chunks.len() as u32,
            world_emissive_chunk_count: emissive.len() as u32,
            max_emission: self.materials.iter().map(|material| material.emissive.max_element()).fold(0.0, f32::max),
            ..Default::default()
        };
        let emitters = vec![Emitter::default(); (emissive.len() * CHUNK_TRIANGLES as usize).max(1)];
        Resources::new(gpu)
            .words("geometry", &self.geometry)
            .structs("instances", &at_least_one(self.instances.clone()))
            .structs("materials", &at_least_one(self.materials.clone()))
            .words("thumbnails", &at_least_one(self.thumbnails.clone()))
            .structs("chunks", &at_least_one(chunks))
            .structs("emissive_chunks", &at_least_one(emissive))
            .structs("lights", &at_least_one(lights))
            .structs("emitters", &emitters)
            .uniform("scene", &scene)
    }

    /// Chunks of all triangles as they cast shadows, and the number of triangles.
    pub fn occluder_chunks(&self) -> (Vec<OccluderChunk>, u32) {
        let mut first_occluder = 0;
        let mut chunks = Vec::new();
        for Chunk { instance, first_triangle } in self.chunks(|_| true) {
            let data = &self.instances[instance as usize];
            let triangle_count = (data.triangle_count - first_triangle).min(CHUNK_TRIANGLES);
            let first_index = data.index_offset + 3 * first_triangle;
            chunks.push(OccluderChunk { instance, first_index, first_occluder, triangle_count, error: 0 });
            first_occluder += triangle_count;
        }
        (chunks, first_occluder)
    }

    /// Chunks of the instances that pass, and their number.
    pub fn chunks(&self, passes: impl Fn(&Instance) -> bool) -> Vec<Chunk> {
        let instances = (0..).zip(&self.instances).filter(|(_, instance)| passes(instance));
        let chunks = instances.flat_map(|(instance, data)| {
            let starts = (0..data.triangle_count).step_by(CHUNK_TRIANGLES as usize);
            starts.map(move |first_triangle| Chunk { instance, first_triangle })
        });
        chunks.collect()
    }
}

fn at_least_one<T: Default>(mut values: Vec<T>) -> Vec<T> {
    if values.is_empty() {
        values.push(T::default());
    }
    values
}

/// Twelve triangles that face outwards.
pub fn cuboid(min: Vec3, max: Vec3) -> [Triangle; 12] {
    let corner = |i: usize| {
        Vec3::new(
            if i & 1 == 0 { min.x } else { max.x },
            if i & 2 == 0 { min.y } else { max.y },
            if i & 4 == 0 { min.z } else { max.z },
        )
    };
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let mut triangles = [[Vec3::ZERO; 3]; 12];
    for (face, [a, b, c, d]) in quads.into_iter().enumerate() {
        triangles[2 * face] = [corner(a), corner(b), corner(c)];
        triangles[2 * face + 1] = [corner(a), corner(c), corner(d)];
    }
    triangles
}

fn pack_uv(uv: Vec2) -> u32 {
    u32::from(f16::from_f32(uv.x).to_bits()) | u32::from(f16::from_f32(uv.y).to_bits()) << 16
}

/// Words of the voxeliser's queue of bricks, in entries.
const QUEUE_ENTRIES: usize = 4096;

/// Runs a shipped kernel once.
pub fn run(gpu: &Gpu, path: &str, entry: &str, resources: &Resources, groups: [u32; 3]) {
    run_with(gpu, path, entry, &[], resources, groups);
}

/// Runs a shipped kernel once, with definitions.
pub fn run_with(gpu: &Gpu, path: &str, entry: &str, defs: &[&str], resources: &Resources, groups: [u32; 3]) {
    let kernel = shipped(gpu, path, entry, defs);
    gpu.dispatch(&kernel, resources, groups).unwrap_or_else(|error| panic!("{path}, {entry}: {error}"));
}

/// A shipped kernel, compiled once a test binary.
pub fn shipped(gpu: &Gpu, path: &str, entry: &str, defs: &[&str]) -> std::sync::Arc<Kernel> {
    let name = format!("{path} {entry} {defs:?}");
    gpu.cached(&name, || {
        let defs: Vec<_> = defs.iter().map(|def| (*def).into()).collect();
        gpu.kernel(&compose(path, &defs)?, entry)
    })
    .unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Voxelises the scene with the shipped kernels; the buffers of the grid are added to the scene's.
pub fn voxelize(gpu: &Gpu, scene: &TestScene, grid: &Grid, queue_entries: Option<usize>) -> Resources {
    let voxels = count_of(grid, 1);
    let blocks = voxels.div_ceil(1024);
    let queue = 1 + 2 * queue_entries.unwrap_or(QUEUE_ENTRIES);
    let mut resources = scene
        .resources(gpu)
        .uniform("grid", grid)
        .uniform("voxel_groups", &VoxelGroups::default())
        .zeroed("voxels", voxels)
        .zeroed("blocks", blocks)
        .zeroed("counters", 4)
        .zeroed("sums", grid.cell_capacity as usize * SUM_WORDS)
        .structs("cells", &vec![Cell::default(); grid.cell_capacity as usize])
        .zeroed("occupied", leap_count(grid))
        .zeroed("along_x", leap_count(grid))
        .zeroed("along_y", leap_count(grid))
        .zeroed("queue", queue)
        .zeroed("brick_workgroups", 3);
    let chunks = scene.chunks(|_| true).len() as u32 * (grid.further_count + 1);
    let run_chunks = |defs: &[&str], resources: &Resources| {
        if chunks > 0 {
            run_over_triangles(gpu, defs, resources, chunks);
        }
    };
    run_chunks(&[], &resources);
    run(gpu, "avg/cells.wgsl", "count_blocks", &resources, [blocks as u32, 1, 1]);
    run(gpu, "avg/cells.wgsl", "scan_blocks", &resources, [1, 1, 1]);
    run(gpu, "avg/cells.wgsl", "assign_cells", &resources, [blocks as u32, 1, 1]);
    resources = resources.zeroed("queue", queue);
    run_chunks(&["ACCUMULATE"], &resources);
    run(gpu, "avg/cells.wgsl", "resolve", &resources, [grid.cell_capacity.div_ceil(64), 1, 1]);
    measure_distances(gpu, grid, &resources);
    resources
}

/// Groups with grids of their own, behind the voxels of a world: grids, each of a scene in the group's space, and which of them stand
/// where, world from group.
pub fn add_groups(
    gpu: &Gpu,
    world: Resources,
    grids: &[(&TestScene, Grid)],
    placed: &[(usize, Affine3A)],
) -> Resources {
    let read = |resources: &Resources, name| resources.read_words(name).unwrap_or_else(|error| panic!("{error}"));
    let (mut voxels, mut cells) = (read(&world, "voxels"), read(&world, "cells"));
    let mut firsts = Vec::new();
    for (scene, grid) in grids {
        let resources = voxelize(gpu, scene, grid, None);
        firsts.push((voxels.len() as u32, cells.len() as u32 / CELL_WORDS));
        voxels.extend(read(&resources, "voxels"));
        cells.extend(read(&resources, "cells"));
    }
    let mut groups = VoxelGroups { count: placed.len() as u32, ..Default::default() };
    for (slot, &(index, world_from_group)) in groups.groups.iter_mut().zip(placed) {
        let grid = &grids[index].1;
        let scale = Affine3A::from_scale(Vec3::splat(grid.voxel_size));
        let voxels_from_world = (world_from_group * Affine3A::from_translation(grid.origin) * scale).inverse();
        let rows = voxels_from_world.matrix3.transpose();
        let row = |i: usize| Vec3::from(rows.col(i)).extend(voxels_from_world.translation[i]);
        let corner = |i: u32| grid.dims.as_vec3() * (UVec3::new(i, i >> 1, i >> 2) & 1).as_vec3();
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| voxels_from_world.inverse().transform_point3(corner(i)));
        let middle = corners.iter().sum::<Vec3>() / 8.0;
        *slot = VoxelGroup {
            middle,
            radius: corners.iter().map(|corner| corner.distance(middle)).fold(0.0, f32::max),
            voxels_from_world_x: row(0),
            voxels_from_world_y: row(1),
            voxels_from_world_z: row(2),
            dims: grid.dims,
            first_voxel: firsts[index].0,
            first_cell: firsts[index].1,
            inverse_determinant: 1.0 / voxels_from_world.matrix3.determinant(),
            ..Default::default()
        };
    }
    world.words("voxels", &voxels).words("cells", &cells).uniform("voxel_groups", &groups)
}

/// Words of a cell.
const CELL_WORDS: u32 = 4;

/// Runs the kernels that take triangles, and bricks of large ones, in so many workgroups.
pub fn run_over_triangles(gpu: &Gpu, defs: &[&str], resources: &Resources, chunks: u32) {
    let path = "avg/voxelize.wgsl";
    run_with(gpu, path, "triangles", defs, resources, [chunks, 1, 1]);
    run(gpu, "avg/bricks.wgsl", "size_bricks", resources, [1, 1, 1]);
    run_indirect(gpu, path, "bricks", defs, resources, "brick_workgroups");
}

// Runs a kernel in as many workgroups as that buffer says.
fn run_indirect(gpu: &Gpu, path: &str, entry: &str, defs: &[&str], resources: &Resources, size: &str) {
    let kernel = shipped(gpu, path, entry, defs);
    gpu.dispatch_indirect(&kernel, resources, size, 0).unwrap_or_else(|error| panic!("{path}, {entry}: {error}"));
}

/// Blocks of 2^3 voxels that distances count.
pub fn leap_count(grid: &Grid) -> usize {
    count_of(grid, 2)
}

/// Cubes of so many voxels an edge in all of the grids.
pub fn count_of(grid: &Grid, edge: u32) -> usize {
    let further = grid.further[..grid.further_count as usize].iter().map(|level| level.dims);
    let count = |dims: UVec3| dims.map(|voxels| voxels.div_ceil(edge)).element_product() as usize;
    std::iter::once(grid.dims).chain(further).map(count).sum()
}

/// Runs the kernels that store in each voxel how far rays may leap.
pub fn measure_distances(gpu: &Gpu, grid: &Grid, resources: &Resources) {
    for pass in ["find_occupied", "pass_x", "pass_y", "pass_z"] {
        run(gpu, "avg/distance.wgsl", pass, resources, [leap_count(grid).div_ceil(64) as u32, 1, 1]);
    }
}

/// Traces paths through the grid of `resources`, which also hold `parameters`, `vertices` and `paths`; each is set on what it met.
pub fn trace_paths(gpu: &Gpu, scene: &TestScene, grid: &Grid, parameters: &VplParameters, resources: &Resources) {
    let resources = &with_lists(gpu, scene, grid, resources);
    run(gpu, "vpl/alive.wgsl", "begin_paths", resources, [parameters.path_count.div_ceil(64), 1, 1]);
    for _ in 0..parameters.max_bounces {
        gather_alive(gpu, parameters, resources);
        run_indirect(gpu, "vpl/trace.wgsl", "trace_paths", &[], resources, "alive_workgroups");
        settle(gpu, resources);
    }
}

/// Adds lists of the triangles in each voxel of `grid`, which `resources` hold.
pub fn list_triangles(
    gpu: &Gpu,
    scene: &TestScene,
    grid: &Grid,
    resources: &Resources,
    queue_entries: Option<usize>,
) -> Resources {
    let chunks = scene.chunks(|_| true).len() as u32;
    let entries = count_of(grid, 1) + 3 * (chunks * CHUNK_TRIANGLES) as usize;
    let resources = resources
        .clone()
        .zeroed("lists", 1 + count_of(grid, 1) + entries * LIST_ENTRY_WORDS as usize)
        .zeroed("queue", 1 + 2 * queue_entries.unwrap_or(QUEUE_ENTRIES))
        .zeroed("brick_workgroups", 3);
    if chunks > 0 {
        run(gpu, "vpl/fill_lists.wgsl", "list_triangles", &resources, [chunks, 1, 1]);
        run(gpu, "avg/bricks.wgsl", "size_bricks", &resources, [1, 1, 1]);
        run_indirect(gpu, "vpl/fill_lists.wgsl", "list_bricks", &[], &resources, "brick_workgroups");
    }
    resources
}

// Adds what paths are gathered in, and the lists of triangles that they look into.
fn with_lists(gpu: &Gpu, scene: &TestScene, grid: &Grid, resources: &Resources) -> Resources {
    list_triangles(gpu, scene, grid, resources, None).zeroed("alive_count", 1).zeroed("alive_workgroups", 3)
}

fn gather_alive(gpu: &Gpu, parameters: &VplParameters, resources: &Resources) {
    run(gpu, "vpl/alive.wgsl", "gather_alive", resources, [parameters.path_count.div_ceil(64), 1, 1]);
    run(gpu, "vpl/alive.wgsl", "size_alive", resources, [1, 1, 1]);
}

// Sets vertices on what their paths met, and reflects them there.
fn settle(gpu: &Gpu, resources: &Resources) {
    run_indirect(gpu, "vpl/settle.wgsl", "meet_triangles", &[], resources, "alive_workgroups");
    run_indirect(gpu, "vpl/places.wgsl", "set_vertices", &[], resources, "alive_workgroups");
}

/// Virtual lights of a white scene that paths brought to where they are, set on what these met; what is emitted stays.
pub fn settled(gpu: &Gpu, scene: &TestScene, grid: &Grid, vpls: &[Vpl]) -> Vec<Vpl> {
    let path_count = vpls.len() as u32;
    let parameters = VplParameters { path_count, max_bounces: 1, ..Default::default() };
    let first = |vpl: &Vpl| if vpl.bounce() > 0 { 1 | UNSETTLED } else { 0 };
    let path = |vpl: &Vpl| Path { length: 0, first_bounce: 1, first: first(vpl), alive: 0 };
    let white = Cell { albedo: u32::MAX, ..Default::default() };
    let slots = |vpl: &Vpl| [Vpl { bounce_met: 0, ..*vpl }, Vpl::default()];
    let resources = scene
        .resources(gpu)
        .uniform("grid", grid)
        .uniform("voxel_groups", &VoxelGroups::default())
        .zeroed("voxels", count_of(grid, 1))
        .structs("cells", &[white])
        .uniform("parameters", &parameters)
        .structs("paths", &vpls.iter().map(path).collect::<Vec<_>>())
        .structs("vertices", &vpls.iter().flat_map(slots).collect::<Vec<_>>());
    let resources = with_lists(gpu, scene, grid, &resources);
    gather_alive(gpu, &parameters, &resources);
    settle(gpu, &resources);
    let vertices: Vec<Vpl> = resources.read_structs("vertices").unwrap_or_else(|error| panic!("{error}"));
    vertices.into_iter().step_by(2).collect()
}

/// Words of a vertex, for tests that reach into the geometry.
pub const WORDS: usize = VERTEX_WORDS as usize;
