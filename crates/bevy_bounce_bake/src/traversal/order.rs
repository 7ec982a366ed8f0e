//! The orders themselves.

use std::collections::HashMap;

use glam::Vec3;

use crate::atlas::Atlas;

/// Side of a tile in texels: a full tile is a block.
const TILE: u32 = 8;

fn cell(atlas: &Atlas, index: u32) -> [u32; 2] {
    atlas.texels[index as usize].texel.cell
}

fn corner(atlas: &Atlas, chart: &[u32]) -> [u32; 2] {
    let cells = chart.iter().map(|&index| cell(atlas, index));
    cells.fold([u32::MAX; 2], |[x, y], [column, row]| [x.min(column), y.min(row)])
}

/// Tiles row by row, there and back, counted from the chart's corner; within a tile along a Hilbert curve.
pub fn tiles(atlas: &Atlas, chart: &[u32]) -> Vec<Vec<u32>> {
    let [left, top] = corner(atlas, chart);
    let key = |&index: &u32| {
        let [x, y] = cell(atlas, index);
        let (x, y) = (x - left, y - top);
        let (column, row) = (x / TILE, y / TILE);
        let column = if row.is_multiple_of(2) { column } else { u32::MAX - column };
        (row, column, hilbert(x % TILE, y % TILE))
    };
    let mut sorted = chart.to_vec();
    sorted.sort_unstable_by_key(key);
    sorted.chunk_by(|a, b| key(a).0 == key(b).0 && key(a).1 == key(b).1).map(<[u32]>::to_vec).collect()
}

/// How far along the Hilbert curve of a tile a texel lies.
fn hilbert(mut x: u32, mut y: u32) -> u32 {
    let mut along = 0;
    let mut side = TILE / 2;
    while side > 0 {
        let (right, up) = (u32::from(x & side > 0), u32::from(y & side > 0));
        along += side * side * ((3 * right) ^ up);
        if up == 0 {
            if right == 1 {
                (x, y) = (TILE - 1 - x, TILE - 1 - y);
            }
            (x, y) = (y, x);
        }
        side /= 2;
    }
    along
}

/// Row by row, there and back.
pub fn zigzag(atlas: &Atlas, chart: &[u32]) -> Vec<u32> {
    let [_, top] = corner(atlas, chart);
    let mut sorted = chart.to_vec();
    sorted.sort_unstable_by_key(|&index| {
        let [x, y] = cell(atlas, index);
        (y, if (y - top).is_multiple_of(2) { x } else { u32::MAX - x })
    });
    sorted
}

/// Along the border of what is left with the border on the left hand; back to the last texel with a free neighbour where
/// there is none.
pub fn spiral(atlas: &Atlas, chart: &[u32]) -> Vec<u32> {
    const AROUND: [[i32; 2]; 8] = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]];
    let signed = |index: u32| cell(atlas, index).map(|value| value as i32);
    let mut free: HashMap<[i32; 2], u32> = chart.iter().map(|&index| (signed(index), index)).collect();
    let mut order = Vec::with_capacity(chart.len());
    // Charts may fall into several pieces of texels.
    for &start in chart {
        if free.remove(&signed(start)).is_none() {
            continue;
        }
        order.push(start);
        let mut path = vec![(signed(start), 0)];
        while let Some(&(at, heading)) = path.last() {
            // From sharp left to sharp right, the way back last.
            let turns = (0..8).map(|turn| (heading + 5 + turn) % 8);
            let next = turns.into_iter().find_map(|turn| {
                let [dx, dy] = AROUND[turn];
                let to = [at[0] + dx, at[1] + dy];
                free.remove(&to).map(|index| (to, turn, index))
            });
            match next {
                Some((to, turn, index)) => {
                    order.push(index);
                    path.push((to, turn));
                }
                None => {
                    path.pop();
                }
            }
        }
    }
    order
}

/// Always to the nearest texel that is left; facing another way counts as being apart.
pub fn greedy(atlas: &Atlas) -> Vec<u32> {
    let at = |index: u32| Vec3::from(atlas.texels[index as usize].texel.position);
    let normal = |index: u32| Vec3::from(atlas.texels[index as usize].texel.normal);
    let area: f32 = atlas.texels.iter().map(|texel| texel.texel.area).sum();
    // About four texels a cell of the grid.
    let side = (4.0 * area / atlas.texels.len() as f32).sqrt().max(f32::MIN_POSITIVE);
    let place = |index: u32| (at(index) / side).floor().as_ivec3();
    let mut grid: HashMap<glam::IVec3, Vec<u32>> = HashMap::new();
    (0..atlas.texels.len() as u32).for_each(|index| grid.entry(place(index)).or_default().push(index));
    let mut first_left = 0;
    let mut taken = vec![false; atlas.texels.len()];
    let mut order = Vec::with_capacity(taken.len());
    let mut here = 0;
    loop {
        taken[here as usize] = true;
        order.push(here);
        if let Some(bucket) = grid.get_mut(&place(here)) {
            bucket.retain(|&index| index != here);
        }
        let apart = |index: u32| at(here).distance(at(index)) + side * (1.0 - normal(here).dot(normal(index)));
        let near = (1..4).find_map(|reach| {
            let mut best: Option<(f32, u32)> = None;
            let middle = place(here);
            for z in -reach..=reach {
                for y in -reach..=reach {
                    for x in -reach..=reach {
                        for &index in grid.get(&(middle + glam::IVec3::new(x, y, z))).into_iter().flatten() {
                            let candidate = (apart(index), index);
                            best = Some(best.map_or(candidate, |best| if candidate < best { candidate } else { best }));
                        }
                    }
                }
            }
            best
        });
        here = match near {
            Some((_, index)) => index,
            None => {
                while taken.get(first_left) == Some(&true) {
                    first_left += 1;
                }
                // Nothing near: go on with the first one left.
                match taken.get(first_left) {
                    Some(_) => first_left as u32,
                    None => return order,
                }
            }
        };
    }
}
