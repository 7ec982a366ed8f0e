//! Clusters of pixels, as `radiance_cache/normals.wgsl`, `frame.wgsl`, `keys.wgsl` and `clusters.wgsl` find them.

use bevy::math::{IVec3, UVec2};
use bevy_bounce_shaders::types::{CLUSTER_FACING_BITS, CLUSTER_SLICE_BITS, CacheGrid};

/// Edge of the histogram of normals, bins.
const EDGE: i32 = 8;
/// Largest octahedral coordinate.
const MOST: i32 = 32767;

/// What clustering finds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Clusters {
    /// Of each tile, three bins.
    pub frames: Vec<u32>,
    /// Of each pixel, its key.
    pub keys: Vec<u32>,
    /// Pixels with a surface, sorted by key.
    pub order: Vec<u32>,
    /// First pixel in the order of each cluster, then the number of pixels.
    pub starts: Vec<u32>,
    /// First cluster of each tile, and the one after its last.
    pub ranges: Vec<[u32; 2]>,
    /// Bits of the keys that were left out.
    pub coarseness: u32,
    /// Clusters that were merged into others.
    pub merged: u32,
}

fn fold(x: i32, y: i32, sum: i32) -> IVec3 {
    let z = sum - x.abs() - y.abs();
    let sign = |x: i32| if x >= 0 { 1 } else { -1 };
    if z >= 0 { IVec3::new(x, y, z) } else { IVec3::new((sum - y.abs()) * sign(x), (sum - x.abs()) * sign(y), z) }
}

fn coordinates(normal: u32) -> [i32; 2] {
    [normal as u16, (normal >> 16) as u16].map(|half| i32::from(half as i16).max(-MOST))
}

fn bin_of(normal: u32) -> usize {
    let [x, y] = coordinates(normal).map(|x| ((x + MOST) * EDGE / (2 * MOST)).min(EDGE - 1));
    (y * EDGE + x) as usize
}

fn bin_vector(bin: u32) -> IVec3 {
    let bin = bin as i32;
    fold(2 * (bin % EDGE) - (EDGE - 1), 2 * (bin / EDGE) - (EDGE - 1), EDGE)
}

fn apart(a: u32, b: u32) -> u32 {
    let (u, v) = (bin_vector(a), bin_vector(b));
    let both = u.dot(v).unsigned_abs();
    let square = both * both * 4096 / (u.dot(u) * v.dot(v)) as u32;
    let fourth = (square * square) >> 12;
    4096 - ((fourth * fourth) >> 12).min(4096)
}

fn neighbour(bin: usize, dx: i32, dy: i32) -> usize {
    let (mut x, mut y) = (bin as i32 % EDGE + dx, bin as i32 / EDGE + dy);
    if !(0..EDGE).contains(&x) {
        x = x.clamp(0, EDGE - 1);
        y = EDGE - 1 - y;
    }
    if !(0..EDGE).contains(&y) {
        y = y.clamp(0, EDGE - 1);
        x = EDGE - 1 - x;
    }
    (y * EDGE + x) as usize
}

/// Three axes for the normals of a tile.
fn frame(normals: impl Iterator<Item = u32>) -> u32 {
    let mut histogram = [0_u32; 64];
    normals.for_each(|normal| histogram[bin_of(normal)] += 1);
    let mut weights = [0_u32; 64];
    for (bin, weight) in weights.iter_mut().enumerate() {
        for (dx, dy) in (-1..=1).flat_map(|y| (-1..=1).map(move |x: i32| (x, y))) {
            *weight += ((2 - dx.abs()) * (2 - i32::abs(dy))) as u32 * histogram[neighbour(bin, dx, dy)];
        }
    }
    let mut frame = 0;
    for i in 0..3 {
        let best = (0..64).rev().max_by_key(|&bin| weights[bin as usize]).unwrap_or(0);
        frame |= best << (6 * i);
        for (bin, weight) in (0..).zip(&mut weights) {
            *weight = ((*weight + 16) * apart(bin, best)) >> 12;
        }
    }
    frame
}

fn facing_in(frame: u32, normal: u32) -> u32 {
    let [x, y] = coordinates(normal);
    let n = fold(x, y, MOST) / 32;
    let (mut best, mut best_square, mut best_length) = (0, 0, 1);
    for i in 0..3 {
        let axis = bin_vector((frame >> (6 * i)) & 63);
        let along = n.dot(axis);
        let (square, length) = ((along * along) as u64, axis.dot(axis) as u64);
        if square * best_length > best_square * length {
            (best, best_square, best_length) = (2 * i + u32::from(along < 0), square, length);
        }
    }
    best
}

fn slice_of(grid: &CacheGrid, depth: u32) -> u32 {
    let last = (1 << CLUSTER_SLICE_BITS) - 1;
    if grid.orthographic != 0 {
        return (((1.0 - f32::from_bits(depth).min(1.0)) * grid.slices as f32) as u32).min(last);
    }
    let near = 1.0_f32.to_bits();
    ((((near - depth.min(near)) >> 8) * grid.slices) >> 15).min(last)
}

/// Clusters of the pixels whose depth bits and normals those are.
pub fn cluster(grid: &CacheGrid, surface: &[[u32; 2]]) -> Clusters {
    let pixels = || (0..grid.size.y).flat_map(|y| (0..grid.size.x).map(move |x| UVec2::new(x, y)));
    let tile_of = |pixel: UVec2| (pixel / grid.tile).y * grid.tiles.x + (pixel / grid.tile).x;
    let tiles = grid.tiles.element_product();
    let mut normals = vec![Vec::new(); tiles as usize];
    for (pixel, [depth, normal]) in pixels().zip(surface) {
        if *depth != 0 {
            normals[tile_of(pixel) as usize].push(*normal);
        }
    }
    let frames: Vec<u32> = normals.into_iter().map(|normals| frame(normals.into_iter())).collect();
    let key = |(pixel, [depth, normal]): (UVec2, &[u32; 2])| {
        if *depth == 0 {
            return tiles << (CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS);
        }
        let tile = tile_of(pixel);
        let facing = facing_in(frames[tile as usize], *normal);
        (((tile << CLUSTER_FACING_BITS) | facing) << CLUSTER_SLICE_BITS) | slice_of(grid, *depth)
    };
    let keys: Vec<u32> = pixels().zip(surface).map(key).collect();
    let mut order: Vec<u32> = (0..keys.len() as u32).filter(|i| surface[*i as usize][0] != 0).collect();
    order.sort_by_key(|i| keys[*i as usize]);
    let at = |i: &u32| keys[*i as usize];
    let count = |bits: u32| order.chunk_by(|a, b| at(a) >> bits == at(b) >> bits).count() as u32;
    let coarseness = (0..32).find(|bits| count(*bits) <= grid.capacity).unwrap_or(31);
    let mut clusters = Clusters { coarseness: if order.is_empty() { 0 } else { coarseness }, ..Default::default() };
    clusters.merged = count(0) - count(coarseness);
    clusters.ranges = vec![[0; 2]; tiles as usize];
    let mut start = 0;
    for (index, members) in (0..).zip(order.chunk_by(|a, b| at(a) >> coarseness == at(b) >> coarseness)) {
        clusters.starts.push(start);
        start += members.len() as u32;
        for member in members {
            let tile = (at(member) >> (CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS)) as usize;
            let range = &mut clusters.ranges[tile];
            *range = if range[1] == 0 { [index, index + 1] } else { [range[0], index + 1] };
        }
    }
    clusters.starts.push(start);
    Clusters { frames, keys, order, ..clusters }
}
