//! Cells without light of their own take that of their neighbours, so that filtering blends nothing black into a
//! surface.

use glam::{UVec3, Vec3};

/// `passes` rings of cells take the mean of those beside them that have a value; a texture of depth 1 is flat. Cells
/// that get none stay without.
pub fn fill(cells: &mut [Option<Vec3>], size: UVec3, passes: u32) {
    for _ in 0..passes {
        let empty: Vec<usize> = (0..cells.len()).filter(|&cell| cells[cell].is_none()).collect();
        let filled: Vec<(usize, Vec3)> =
            empty.into_iter().filter_map(|cell| Some((cell, mean_around(cells, size, cell)?))).collect();
        if filled.is_empty() {
            break;
        }
        filled.into_iter().for_each(|(cell, value)| cells[cell] = Some(value));
    }
}

/// The mean of the nearest neighbours that have a value: those that share a side, else an edge, else a corner.
fn mean_around(cells: &[Option<Vec3>], size: UVec3, cell: usize) -> Option<Vec3> {
    let at =
        UVec3::new(cell as u32 % size.x, cell as u32 / size.x % size.y, cell as u32 / (size.x * size.y)).as_ivec3();
    let mut sums = [(Vec3::ZERO, 0); 4];
    for step in 0..27 {
        let offset = glam::IVec3::new(step % 3, step / 3 % 3, step / 9) - 1;
        let near = at + offset;
        if near.min_element() < 0 || near.as_uvec3().cmpge(size).any() {
            continue;
        }
        let near = near.as_uvec3();
        if let Some(value) = cells[((near.z * size.y + near.y) * size.x + near.x) as usize] {
            let (sum, count) = &mut sums[offset.abs().element_sum() as usize];
            *sum += value;
            *count += 1;
        }
    }
    sums.into_iter().find(|(_, count)| *count > 0).map(|(sum, count)| sum / count as f32)
}
