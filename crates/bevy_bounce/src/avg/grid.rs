//! Where the grid lies, and its buffers.

use bevy::math::bounding::Aabb3d;
use bevy::prelude::*;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderType, UniformBuffer};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::{Cell, Grid};

use crate::compute::MAX_WORKGROUPS;
use crate::scene::SceneBuffers;
use crate::settings::GiWorldSettings;

/// Words of a cell's sums. See `SUM_WORDS` in `shared/grid.wgsl`.
pub(crate) const SUM_WORDS: u64 = 16;
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

/// The voxel grid on the GPU.
#[derive(Resource)]
pub(crate) struct VoxelGrid {
    /// Where it lies.
    pub grid: Grid,
    /// The same as a uniform.
    pub uniform: UniformBuffer<Grid>,
    /// One word a voxel. See `shared/grid.wgsl`.
    pub voxels: Buffer,
    /// Marked facings of each block, then of those before it.
    pub blocks: Buffer,
    /// Cells in use, cells there was no room for, area.
    pub counters: Buffer,
    /// Fixed-point sums of the cells.
    pub sums: Buffer,
    /// What the sums come to.
    pub cells: Buffer,
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
    edge: u32,
}

impl VoxelGrid {
    fn new(device: &RenderDevice, edge: u32) -> Self {
        let voxels = u64::from(edge).pow(3);
        let limit = device.limits().max_storage_buffer_binding_size;
        let cells = (voxels / 2).min(MAX_CELLS).min(limit / (SUM_WORDS * 4));
        // Blocks round up on every axis: of a grid one voxel thin there are as many as half the voxels.
        let leaps = voxels / 2 + 1;
        let with_usage = |label, size: u64, usage| {
            let usage = usage | BufferUsages::STORAGE;
            device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
        };
        let buffer = |label, size| with_usage(label, size, BufferUsages::COPY_DST | BufferUsages::COPY_SRC);
        Self {
            grid: Grid { cell_capacity: cells as u32, ..default() },
            uniform: UniformBuffer::default(),
            voxels: buffer("bounce_voxels", voxels * 4),
            blocks: buffer("bounce_voxel_blocks", voxels.div_ceil(u64::from(BLOCK_VOXELS)) * 4),
            counters: buffer("bounce_voxel_counters", 16),
            sums: buffer("bounce_voxel_sums", cells * SUM_WORDS * 4),
            cells: buffer("bounce_voxel_cells", cells * u64::from(Cell::min_size())),
            occupied: buffer("bounce_voxel_occupied", leaps * 4),
            along_x: buffer("bounce_voxel_distance_x", leaps * 4),
            along_y: buffer("bounce_voxel_distance_y", leaps * 4),
            queue: buffer("bounce_voxel_queue", 4 + QUEUE_ENTRIES * 12),
            brick_workgroups: with_usage("bounce_brick_workgroups", 12, BufferUsages::INDIRECT),
            edge,
        }
    }

    /// Blocks of 2^3 voxels. See `leap_dims` in `shared/grid.wgsl`.
    pub fn leap_count(&self) -> u32 {
        self.grid.dims.map(|voxels| voxels.div_ceil(LEAP_BLOCK)).element_product()
    }

    /// Bricks of 8^3 voxels. See `brick_index` in `shared/grid.wgsl`.
    pub fn brick_count(&self) -> u64 {
        self.grid.dims.map(|voxels| voxels.div_ceil(BRICK)).as_u64vec3().element_product()
    }

    /// Blocks of the prefix sum.
    pub fn block_count(&self) -> u32 {
        self.edge.pow(3).div_ceil(BLOCK_VOXELS)
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> Vec<(&'static str, u64)> {
        vec![
            ("grid: voxels", self.voxels.size() + self.blocks.size() + self.counters.size()),
            ("grid: cells", self.cells.size()),
            ("grid: sums", self.sums.size()),
            ("grid: distances", self.occupied.size() + self.along_x.size() + self.along_y.size()),
            ("grid: queue", self.queue.size() + self.brick_workgroups.size()),
        ]
    }
}

/// Places the grid and keeps its buffers.
pub(crate) fn prepare_grid(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    settings: Res<GiWorldSettings>,
    scene: Option<Res<SceneBuffers>>,
    grid: Option<ResMut<VoxelGrid>>,
) {
    let (Some(settings), Some(scene)) = (settings.0, scene) else { return };
    let place = |grid: &mut VoxelGrid| {
        let placed = fit(scene.bounds(), settings.grid);
        let placed = Grid { cell_capacity: grid.grid.cell_capacity, ..placed };
        if placed != grid.grid || grid.uniform.buffer().is_none() {
            grid.grid = placed;
            grid.uniform.set(placed);
            grid.uniform.write_buffer(&device, &queue);
        }
    };
    match grid {
        Some(mut grid) if grid.edge == settings.grid => place(&mut grid),
        _ => {
            let mut grid = VoxelGrid::new(&device, settings.grid);
            place(&mut grid);
            commands.insert_resource(grid);
        }
    }
}

/// Cubic voxels over the bounds, `edge`^3 at most, with an empty one all round. A function of its arguments alone, so that
/// a frame does not depend on those before it; origin and size go in steps, so that a moving object does not make the grid
/// swim.
pub(crate) fn fit(bounds: Option<Aabb3d>, edge: u32) -> Grid {
    let (min, max) = match bounds {
        Some(bounds) => (Vec3::from(bounds.min), Vec3::from(bounds.max)),
        None => (Vec3::ZERO, Vec3::ZERO),
    };
    let extent = (max - min).max_element().max(1e-4 * max.abs().max(min.abs()).max_element()).max(1e-6);
    let budget = u64::from(edge).pow(3);
    // Even a line of voxels cannot be longer than four edges: start below the smallest size possible.
    let mut step = (SIZE_STEPS * (extent / (4.0 * edge as f32)).log2()).floor();
    loop {
        let size = (step / SIZE_STEPS).exp2();
        let low = (min / size - 1.0 - PHASE).floor() + PHASE;
        let dims = ((max / size - low).ceil() + 1.0).as_uvec3();
        let count = dims.as_u64vec3().element_product();
        if dims.max_element() <= 4 * edge && count <= budget {
            return Grid { origin: low * size, voxel_size: size, dims, cell_capacity: 0 };
        }
        step += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(min: Vec3, max: Vec3) -> Option<Aabb3d> {
        Some(Aabb3d::new((min + max) * 0.5, (max - min) * 0.5))
    }

    #[test]
    fn grid_holds_the_bounds_with_a_border() {
        for (min, max) in [
            (Vec3::splat(-2.8), Vec3::splat(2.8)),
            (Vec3::new(-18.0, -0.1, -11.0), Vec3::new(19.0, 15.0, 12.0)),
            (Vec3::new(1000.0, 5.0, 3.0), Vec3::new(1000.0, 5.0, 3.0)),
            (Vec3::ZERO, Vec3::new(1e4, 0.0, 1e4)),
        ] {
            let grid = fit(bounds(min, max), 64);
            let low = (min - grid.origin) / grid.voxel_size;
            let high = (max - grid.origin) / grid.voxel_size;
            assert!(low.cmpge(Vec3::splat(0.9)).all(), "{grid:?} {low}");
            assert!(high.cmple(grid.dims.as_vec3() - 0.9).all(), "{grid:?} {high}");
            assert!(grid.dims.element_product() <= 64 * 64 * 64);
        }
    }

    #[test]
    fn grid_stays_while_the_bounds_move_a_little() {
        let a = fit(bounds(Vec3::splat(-2.8), Vec3::new(2.8, 2.8, 2.80)), 64);
        let b = fit(bounds(Vec3::splat(-2.8), Vec3::new(2.8, 2.8, 2.81)), 64);
        assert_eq!(a.voxel_size, b.voxel_size);
        assert_eq!(a.origin, b.origin);
    }

    #[test]
    fn grid_uses_its_budget() {
        let grid = fit(bounds(Vec3::ZERO, Vec3::new(37.0, 15.0, 23.0)), 64);
        assert!(grid.dims.element_product() > 64 * 64 * 64 * 3 / 4, "{grid:?}");
    }
}
