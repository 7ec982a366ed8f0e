// Lists of the triangles in each voxel, by which paths find what they meet near by (`settle.wgsl`). They are filled anew each frame
// (`fill_lists.wgsl`).
//
// The buffer: entries wanted, which may be more than there is room for; for each voxel of all grids, the word of its first entry, 0 for
// none; then per entry the triangle, and the word of the next. Lists are in no order.

#define_import_path bevy_bounce::vpl::triangle_lists

#import bevy_bounce::shared::grid::{Grid, GridLevel, voxel_count, voxel_index}

const LIST_HEADER: u32 = 1u;
const LIST_ENTRY_WORDS: u32 = 2u;

fn first_entry(grid: Grid) -> u32 {
    return LIST_HEADER + voxel_count(grid);
}

/// The word that holds a voxel's first entry.
fn list_of(level: GridLevel, voxel: vec3<i32>) -> u32 {
    return LIST_HEADER + voxel_index(level, voxel);
}
