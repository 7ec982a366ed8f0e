//! Maps from outside: parallel projections of the object from a grid of directions.

use bevy_bounce_cssm::block::{BlockEncoder, BlockRays, LANES, ROWS};
use bevy_bounce_cssm::{Maps, MapsBuilder, OpenEnd, Quantizer, csm};
use glam::Vec3;
use rayon::prelude::*;

use crate::BakeError;
use crate::rays::{Bvh, Layers, OrthoTile, PACKET, cast};

/// Directions a side of the grid: 1024 maps, about six degrees apart.
pub const GRID: u32 = 32;
/// Pixels a side of a map.
pub const SIDE: u32 = 64;

const GROUPS: usize = PACKET * PACKET / ROWS;

/// The sphere that the maps show.
#[derive(Clone, Copy, Debug)]
pub struct Sphere {
    /// World units.
    pub center: Vec3,
    /// World units.
    pub radius: f32,
}

/// Casts and encodes all maps; `done` is told the number of maps after each block.
pub fn encode_outside_maps(
    bvh: &Bvh,
    sphere: Sphere,
    quantizer: Quantizer,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Maps, BakeError> {
    let cells: Vec<[u32; 2]> = (0..GRID * GRID).map(|cell| [cell % GRID, cell / GRID]).collect();
    let mut blocks = vec![[[0; 2]; LANES]; cells.len() / LANES];
    for cell in cells {
        let (block, lane) = csm::slot(cell, GRID);
        blocks[block][lane] = cell;
    }
    let encode = |cells: &[[u32; 2]; LANES]| {
        let encoded = encode_block(bvh, cells, sphere, quantizer);
        done(cells.len());
        encoded
    };
    let encoded: Vec<_> = blocks.par_iter().map(encode).collect();
    let mut maps = MapsBuilder::default();
    for (codes, words) in encoded {
        maps.push(&codes, &words)?;
    }
    Ok(maps.finish())
}

fn encode_block(
    bvh: &Bvh,
    cells: &[[u32; 2]; LANES],
    sphere: Sphere,
    quantizer: Quantizer,
) -> (Vec<bevy_bounce_cssm::block::BlockCode>, Vec<u32>) {
    let (mut codes, mut words, mut stack) = (Vec::new(), Vec::new(), Vec::new());
    let mut encoder = BlockEncoder::default();
    let mut rays = [BlockRays::ANY; GROUPS];
    let side = SIDE as usize;
    for y in (0..side).step_by(PACKET) {
        for x in (0..side).step_by(PACKET) {
            for (lane, cell) in cells.iter().enumerate() {
                let frame = csm::frame(csm::direction(*cell, GRID)).map(Vec3::from);
                let back = sphere.center + frame[2] * sphere.radius;
                let tile = OrthoTile::new(frame, back, sphere.radius, [x, y], side);
                let mut layers = Layers::new((quantizer.quantum, 0.0), sphere.radius / SIDE as f32);
                cast(bvh, &tile, &mut layers, &mut stack);
                store(&layers, 2.0 * sphere.radius, quantizer, lane, &mut rays);
            }
            codes.extend(rays.iter().map(|rays| encoder.encode(rays, &mut words)));
        }
    }
    (codes, words)
}

/// The codes of a packet's rays into their lane. Nearness is counted from the back plane, `far` behind the front plane.
fn store(layers: &Layers, far: f32, quantizer: Quantizer, lane: usize, rays: &mut [BlockRays; GROUPS]) {
    let depth = |nearness: f32| if nearness > 0.0 { far - nearness } else { f32::INFINITY };
    for pixel in 0..PACKET * PACKET {
        let (x, y) = (pixel % PACKET, pixel / PACKET);
        let (first, second) = (layers.first[y][x], layers.second[y][x]);
        let first = [depth(first), depth(first - layers.first_reach[y][x])];
        let second = [depth(second), depth(second + layers.second_reach[y][x])];
        let codes = quantizer.guarded_interval(first, second, OpenEnd::Finite);
        rays[pixel / ROWS].set(pixel % ROWS, lane, codes);
    }
}
