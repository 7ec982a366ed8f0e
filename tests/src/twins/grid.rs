//! Twin of `shared/grid.wgsl`.

use bevy::math::Vec3;

/// Fixed point: one voxel face of area.
pub const AREA_ONE: f32 = 65536.0;
/// Words of a cell's sums.
pub const SUM_WORDS: usize = 21;
/// Bits of a voxel's word that hold its first cell.
pub const CELL_BITS: u32 = 22;

/// Facings that have a cell, a bit each.
pub fn voxel_facings(word: u32) -> u32 {
    word >> CELL_BITS & 0x3f
}

/// Chebyshev distance, in blocks of 2^3 voxels, to the nearest block that has any, at most 15.
pub fn voxel_distance(word: u32) -> u32 {
    word >> 28
}

/// Cell of a facing.
pub fn cell_index(word: u32, facing: u32) -> u32 {
    (word & ((1 << CELL_BITS) - 1)) + (voxel_facings(word) & ((1 << facing) - 1)).count_ones()
}

/// +x, -x, +y, -y, +z, -z by the longest component.
pub fn facing_of(normal: Vec3) -> u32 {
    let a = normal.abs();
    if a.x >= a.y && a.x >= a.z {
        return u32::from(normal.x < 0.0);
    }
    if a.y >= a.z {
        return 2 + u32::from(normal.y < 0.0);
    }
    4 + u32::from(normal.z < 0.0)
}
