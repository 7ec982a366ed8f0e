//! Where the grids lie, and their buffers.

use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{Cell, FURTHER_LEVELS, Grid, GridLevel};

use super::groups::GroupGrids;
use crate::compute::MAX_WORKGROUPS;
use crate::scene::{Bounds, Groups, SceneBuffers};
use crate::settings::GiWorldSettings;

/// Words of a cell's sums. See `SUM_WORDS` in `shared/grid.wgsl`.
pub(crate) const SUM_WORDS: u64 = 21;
/// Voxels a workgroup of the prefix sum takes.
pub(crate) const BLOCK_VOXELS: u32 = 1024;
/// Edge of the blocks that distances count, voxels.
const LEAP_BLOCK: u32 = 2;
/// Edge of a brick, voxels.
const BRICK: u32 = 8;
/// Bricks of large triangles the queue holds; what does not fit is done by the thread that found it, slower.
/// A workgroup takes an entry: as many as there may be along an axis.
const QUEUE_ENTRIES: u64 = MAX_WORKGROUPS as u64;
/// Cells that a voxel's word can address.
const MAX_CELLS: u64 = (1 << 22) - 1;
/// Steps of the voxel size in a doubling: the size is a function of the scene's bounds alone, and changes seldom.
const SIZE_STEPS: f32 = 16.0;
/// Where a lattice lies within its steps, so that the round numbers walls stand at are not on it.
pub(crate) const PHASE: Vec3 = Vec3::new(0.37, 0.31, 0.43);

/// What voxelising needs besides voxels and cells.
pub(crate) struct Workspace {
    /// Marked facings of each block, then of those before it.
    pub blocks: Buffer,
    /// Cells in use, cells there was no room for, area.
    pub counters: Buffer,
    /// Fixed-point sums of the cells.
    pub sums: Buffer,
    /// Which blocks of 2^3 voxels have a surface.
    pub occupied: Buffer,
    /// Chebyshev distance along x, one word a block.
    pub along_x: Buffer,
    /// Chebyshev distance along x and y.
    pub along_y: Buffer,
    /// Bricks of large triangles.
    pub queue: Buffer,
    /// Workgroups that take them.
    pub brick_workgroups: Buffer,
}

impl Workspace {
    /// For so many voxels and cells.
    pub fn new(device: &RenderDevice, voxels: u64, cells: u64, levels: usize) -> Self {
        // Blocks round up on every axis: of a grid one voxel thin there are as many as half the voxels.
        let leaps = voxels / 2 + levels as u64;
        Self {
            blocks: storage(device, "bounce_voxel_blocks", voxels.div_ceil(u64::from(BLOCK_VOXELS)) * 4),
            counters: storage(device, "bounce_voxel_counters", 16),
            sums: storage(device, "bounce_voxel_sums", cells * SUM_WORDS * 4),
            occupied: storage(device, "bounce_voxel_occupied", leaps * 4),
            along_x: storage(device, "bounce_voxel_distance_x", leaps * 4),
            along_y: storage(device, "bounce_voxel_distance_y", leaps * 4),
            queue: storage(device, "bounce_voxel_queue", 4 + QUEUE_ENTRIES * 8),
            brick_workgroups: device.create_buffer(&BufferDescriptor {
                label: Some("bounce_brick_workgroups"),
                size: 12,
                usage: BufferUsages::STORAGE | BufferUsages::INDIRECT,
                mapped_at_creation: false,
            }),
        }
    }

    fn bytes(&self) -> [(&'static str, u64); 4] {
        [
            ("grid: voxels", self.blocks.size() + self.counters.size()),
            ("grid: sums", self.sums.size()),
            ("grid: distances", self.occupied.size() + self.along_x.size() + self.along_y.size()),
            ("grid: queue", self.queue.size() + self.brick_workgroups.size()),
        ]
    }
}

fn storage(device: &RenderDevice, label: &'static str, size: u64) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some(label),
        size,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// The voxel grids on the GPU, one within the other, each buffer for all of them.
#[derive(Resource)]
pub(crate) struct VoxelGrid {
    /// Where they lie.
    pub grid: Grid,
    /// The same as a uniform.
    pub uniform: UniformBuffer<Grid>,
    /// One word a voxel. See `shared/grid.wgsl`.
    pub voxels: Buffer,
    /// What the sums come to.
    pub cells: Buffer,
    /// What they are made with.
    pub work: Workspace,
    /// Grids of groups, behind the world's in the voxels and the cells.
    pub groups: GroupGrids,
    edge: u32,
    levels: usize,
}

impl VoxelGrid {
    fn new(device: &RenderDevice, edge: u32, levels: usize, groups: usize) -> Self {
        let voxels = u64::from(edge).pow(3) * levels as u64;
        let limit = device.limits().max_storage_buffer_binding_size;
        let cells = (voxels / 2).min(MAX_CELLS).min(limit / (SUM_WORDS * 4));
        let groups = GroupGrids::new(groups, voxels, cells);
        Self {
            grid: Grid { cell_capacity: cells as u32, ..default() },
            uniform: UniformBuffer::default(),
            voxels: storage(device, "bounce_voxels", groups.voxel_count() * 4),
            cells: storage(device, "bounce_voxel_cells", groups.cell_count() * u64::from(Cell::min_size())),
            work: Workspace::new(device, voxels, cells, levels),
            groups,
            edge,
            levels,
        }
    }

    /// Grids within each other.
    pub fn level_count(&self) -> u32 {
        self.levels as u32
    }

    // Where a level after the last would begin.
    fn end(&self) -> GridLevel {
        let grid = &self.grid;
        let after_finest = after(&GridLevel { dims: grid.dims, ..default() });
        grid.further[..grid.further_count as usize].last().map_or(after_finest, after)
    }

    /// Voxels of all nested grids.
    pub fn voxel_count(&self) -> u32 {
        self.end().first_voxel
    }

    /// Blocks of 2^3 voxels. See `leap_dims` in `shared/grid.wgsl`.
    pub fn leap_count(&self) -> u32 {
        self.end().first_block
    }

    /// Bricks of 8^3 voxels. See `brick_index` in `shared/grid.wgsl`.
    pub fn brick_count(&self) -> u32 {
        self.end().first_brick
    }

    /// Where the world's voxels are, bytes.
    pub fn world_voxels(&self) -> (u64, u64) {
        (0, u64::from(self.edge).pow(3) * self.levels as u64 * 4)
    }

    /// Where its cells are, bytes.
    pub fn world_cells(&self) -> (u64, u64) {
        (0, u64::from(self.grid.cell_capacity) * u64::from(Cell::min_size()))
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        let mut bytes = vec![("grid: voxels", self.voxels.size()), ("grid: cells", self.cells.size())];
        bytes.extend(self.work.bytes());
        bytes.extend(self.groups.work.iter().flat_map(Workspace::bytes));
        bytes
    }
}

/// Places the grids and keeps their buffers.
pub(crate) fn prepare_grid(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    settings: Res<GiWorldSettings>,
    scene: Option<Res<SceneBuffers>>,
    groups: Option<Res<Groups>>,
    grid: Option<ResMut<VoxelGrid>>,
) {
    let Some(settings) = settings.0 else {
        if grid.is_some() {
            commands.remove_resource::<VoxelGrid>();
        }
        return;
    };
    let (Some(scene), Some(groups)) = (scene, groups) else { return };
    let regions = scene.regions();
    let place = |grid: &mut VoxelGrid| {
        let placed = nest(regions, settings.grid);
        let placed = Grid { cell_capacity: grid.grid.cell_capacity, ..placed };
        if placed != grid.grid || grid.uniform.buffer().is_none() {
            grid.grid = placed;
            grid.uniform.set(placed);
            grid.uniform.write_buffer(&device, &queue);
        }
        grid.groups.update(&groups, &device, &queue);
    };
    let levels = regions.len().max(1);
    let needed = groups.placed.iter().map(|group| group.grid + 1).max().unwrap_or(0);
    match grid {
        Some(mut grid) if (grid.edge, grid.levels) == (settings.grid, levels) && needed <= grid.groups.capacity => {
            place(&mut grid);
        }
        _ => {
            // Room grows by doubling, so that it seldom does.
            let capacity = if needed == 0 { 0 } else { needed.next_power_of_two() };
            let mut grid = VoxelGrid::new(&device, settings.grid, levels, capacity);
            place(&mut grid);
            commands.insert_resource(grid);
        }
    }
}

/// A grid over each region; all but the last move with the cameras.
fn nest(regions: &[Bounds], edge: u32) -> Grid {
    let [inner @ .., all] = regions else { return fit(&Bounds::EMPTY, edge) };
    let mut levels = inner.iter().map(|region| fit_moving(region, edge)).chain([fit(all, edge)]);
    let mut grid = levels.next().unwrap_or_default();
    let mut last = GridLevel { dims: grid.dims, ..default() };
    for (slot, level) in grid.further.iter_mut().zip(levels) {
        let Grid { origin, voxel_size, dims, .. } = level;
        last = GridLevel { origin, voxel_size, dims, ..after(&last) };
        *slot = last;
    }
    grid.further_count = inner.len().min(FURTHER_LEVELS) as u32;
    grid
}

/// Edge of the voxels of the finest of the grids over these regions, world units.
pub(crate) fn finest_voxel(regions: &[Bounds], edge: u32) -> f32 {
    nest(regions, edge).voxel_size
}

/// A level that begins where another ends.
fn after(level: &GridLevel) -> GridLevel {
    let count = |edge: u32| level.dims.map(|voxels| voxels.div_ceil(edge)).element_product();
    GridLevel {
        first_voxel: level.first_voxel + level.dims.element_product(),
        first_brick: level.first_brick + count(BRICK),
        first_block: level.first_block + count(LEAP_BLOCK),
        ..default()
    }
}

/// Largest edge of some bounds, above 0.
pub(super) fn extent_of(min: Vec3, max: Vec3) -> f32 {
    (max - min).max_element().max(1e-4 * max.abs().max(min.abs()).max_element()).max(1e-6)
}

/// The first of the sizes in steps at which a grid of `edge`^3 voxels at most, and no more than four edges long, is large enough.
fn first_fitting<T>(extent: f32, edge: u32, place: impl Fn(f32) -> (UVec3, T)) -> (f32, UVec3, T) {
    let budget = u64::from(edge).pow(3);
    // Even a line of voxels cannot be longer than four edges: start below the smallest size possible.
    let mut step = (SIZE_STEPS * (extent / (4.0 * edge as f32)).log2()).floor();
    loop {
        let size = (step / SIZE_STEPS).exp2();
        let (dims, placed) = place(size);
        if dims.max_element() <= 4 * edge && dims.as_u64vec3().element_product() <= budget {
            return (size, dims, placed);
        }
        step += 1.0;
    }
}

/// Cubic voxels over the bounds, `edge`^3 at most, with an empty one all round. A function of its arguments alone, so that
/// a frame does not depend on those before it; origin and size go in steps, so that a moving object does not make the grid
/// swim.
pub(crate) fn fit(bounds: &Bounds, edge: u32) -> Grid {
    let (min, max) = if bounds.is_empty() { (Vec3::ZERO, Vec3::ZERO) } else { (bounds.min, bounds.max) };
    let (voxel_size, dims, low) = first_fitting(extent_of(min, max), edge, |size| {
        let low = (min / size - 1.0 - PHASE).floor() + PHASE;
        (((max / size - low).ceil() + 1.0).as_uvec3(), low)
    });
    Grid { origin: low * voxel_size, voxel_size, dims, ..default() }
}

/// The same for bounds that move and keep their size: the voxels keep theirs, too, and the grid moves by whole bricks, so that
/// what is known of a brick stays with its place in the world. A grid that has hardly room for bricks moves by smaller steps.
fn fit_moving(bounds: &Bounds, edge: u32) -> Grid {
    let size = bounds.max - bounds.min;
    let brick = BRICK.min(edge / 4).max(1) as f32;
    let (voxel_size, dims, ()) = first_fitting(extent_of(Vec3::ZERO, size), edge, |voxel| {
        // An empty voxel on either side, and one less than a brick for where the bounds begin.
        (((size / voxel).ceil() + 2.0 + brick).as_uvec3(), ())
    });
    let low = ((bounds.min / voxel_size - 1.0 - PHASE) / brick).floor() * brick + PHASE;
    Grid { origin: low * voxel_size, voxel_size, dims, ..default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_holds_the_bounds_with_a_border() {
        for (min, max) in [
            (Vec3::splat(-2.8), Vec3::splat(2.8)),
            (Vec3::new(-18.0, -0.1, -11.0), Vec3::new(19.0, 15.0, 12.0)),
            (Vec3::new(1000.0, 5.0, 3.0), Vec3::new(1000.0, 5.0, 3.0)),
            (Vec3::ZERO, Vec3::new(1e4, 0.0, 1e4)),
        ] {
            let grid = fit(&Bounds { min, max }, 64);
            let low = (min - grid.origin) / grid.voxel_size;
            let high = (max - grid.origin) / grid.voxel_size;
            assert!(low.cmpge(Vec3::splat(0.9)).all(), "{grid:?} {low}");
            assert!(high.cmple(grid.dims.as_vec3() - 0.9).all(), "{grid:?} {high}");
            assert!(grid.dims.element_product() <= 64 * 64 * 64);
        }
    }

    #[test]
    fn grid_stays_while_the_bounds_move_a_little() {
        let a = fit(&Bounds { min: Vec3::splat(-2.8), max: Vec3::new(2.8, 2.8, 2.80) }, 64);
        let b = fit(&Bounds { min: Vec3::splat(-2.8), max: Vec3::new(2.8, 2.8, 2.81) }, 64);
        assert_eq!(a.voxel_size, b.voxel_size);
        assert_eq!(a.origin, b.origin);
    }

    #[test]
    fn grid_uses_its_budget() {
        let grid = fit(&Bounds { min: Vec3::ZERO, max: Vec3::new(37.0, 15.0, 23.0) }, 64);
        assert!(grid.dims.element_product() > 64 * 64 * 64 * 3 / 4, "{grid:?}");
    }

    #[test]
    fn nested_grids_hold_their_regions_wherever_these_are() {
        for edge in [8, 9, 13, 32, 64, 128] {
            let mut first: Option<Grid> = None;
            for step in 0..200 {
                let low = Vec3::new(-300.0 + 0.37 * step as f32, 0.0, 71.3 - 1.1 * step as f32);
                let boxes = [80.0, 320.0].map(|size| {
                    let min = low - Vec3::new(0.5 * size, 0.0, 0.5 * size);
                    Bounds { min, max: min + Vec3::new(size, 20.0, size) }
                });
                let world = Bounds { min: Vec3::new(-600.0, 0.0, -600.0), max: Vec3::new(600.0, 20.0, 600.0) };
                let grid = nest(&[boxes[0], boxes[1], world], edge);
                let finest =
                    GridLevel { origin: grid.origin, voxel_size: grid.voxel_size, dims: grid.dims, ..default() };
                for (level, region) in [(finest, boxes[0]), (grid.further[0], boxes[1]), (grid.further[1], world)] {
                    let low = (region.min - level.origin) / level.voxel_size;
                    let high = (region.max - level.origin) / level.voxel_size;
                    assert!(low.cmpge(Vec3::splat(0.9)).all(), "{level:?} {low}");
                    assert!(high.cmple(level.dims.as_vec3() - 0.9).all(), "{level:?} {high}");
                }
                assert_eq!(grid.further_count, 2);
                assert_eq!(
                    grid.further[1].first_voxel,
                    grid.dims.element_product() + grid.further[0].dims.element_product()
                );
                let first = first.get_or_insert(grid);
                for (level, before) in [(finest, first.origin), (grid.further[0], first.further[0].origin)] {
                    let bricks = (level.origin - before) / (level.voxel_size * BRICK.min(edge / 4) as f32);
                    assert!(bricks.abs_diff_eq(bricks.round(), 1e-2), "{level:?} {bricks}");
                }
                assert_eq!((first.voxel_size, first.dims), (grid.voxel_size, grid.dims));
            }
        }
    }
}
