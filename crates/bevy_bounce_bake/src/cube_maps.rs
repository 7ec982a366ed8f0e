//! Depth cube maps of all texels, cast and encoded block by block.

use bevy_bounce_cssm::block::{BlockCode, BlockEncoder, BlockRays, LANES, ROWS};
use bevy_bounce_cssm::{Interval, Maps, MapsBuilder, OpenEnd, Quantizer};
use glam::Vec3;
use rayon::prelude::*;

use crate::BakeError;
use crate::rays::{Bvh, CubeTile, Layers, PACKET, cast};

/// Blocks of texels that are cast before their words are put together. Bounds the memory besides the result.
const BATCH: usize = 64;
/// Surfaces closer than this many quanta are one. No code lies between them for certain.
const MERGE: f32 = 1.0;
/// Values keep clear of the surfaces in this much of their pixel, so that what lies on a slanted surface off the pixel's
/// centre is not taken to lie behind it.
const GUARD: f32 = 1.0;
/// Groups of rows a packet.
const GROUPS: usize = PACKET * PACKET / ROWS;

/// One cube map: its centre and the normal on whose side its rays leave.
#[derive(Clone, Copy, Debug)]
pub struct CubeMap {
    /// World units.
    pub center: Vec3,
    /// Unit length.
    pub normal: Vec3,
}

/// What was cast and stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CastStats {
    /// Rays on the front side.
    pub rays: u64,
    /// Rays on which two surfaces are closer than a quantum.
    pub close: u64,
    /// Constant pieces that were stored.
    pub runs: u64,
}

/// Casts and encodes the cube maps of all blocks; `done` is told the number of maps after each block.
pub fn encode_cube_maps(
    bvh: &Bvh,
    blocks: &[Vec<CubeMap>],
    side: usize,
    quantizer: Quantizer,
    done: &(dyn Fn(usize) + Sync),
) -> Result<(Maps, CastStats), BakeError> {
    let mut maps = MapsBuilder::default();
    let mut stats = CastStats::default();
    for batch in blocks.chunks(BATCH) {
        let encoded: Vec<EncodedBlock> = batch
            .par_iter()
            .map_init(Worker::default, |worker, block| {
                let encoded = worker.block(bvh, block, side, quantizer);
                done(block.len());
                encoded
            })
            .collect();
        for block in encoded {
            maps.push(&block.codes, &block.words)?;
            stats.rays += block.stats.rays;
            stats.close += block.stats.close;
            stats.runs += block.stats.runs;
        }
    }
    Ok((maps.finish(), stats))
}

struct EncodedBlock {
    codes: Vec<BlockCode>,
    words: Vec<u32>,
    stats: CastStats,
}

/// What a thread keeps from block to block.
#[derive(Default)]
struct Worker {
    stack: Vec<(u32, f32)>,
    encoder: BlockEncoder,
}

impl Worker {
    fn block(&mut self, bvh: &Bvh, block: &[CubeMap], side: usize, quantizer: Quantizer) -> EncodedBlock {
        let (mut codes, mut words) = (Vec::new(), Vec::new());
        let mut stats = CastStats::default();
        let mut rays = [BlockRays::ANY; GROUPS];
        self.encoder.stored_runs = 0;
        for face in 0..6 {
            for y in (0..side).step_by(PACKET) {
                for x in (0..side).step_by(PACKET) {
                    rays.fill(BlockRays::ANY);
                    for (lane, map) in block.iter().enumerate().take(LANES) {
                        let mut tile = CubeTile::new(face, x, y, side);
                        tile.origin = map.center;
                        if tile.leaves(map.normal) {
                            let mut layers = Layers::new((0.0, MERGE * quantizer.quantum), GUARD / side as f32);
                            cast(bvh, &tile, &mut layers, &mut self.stack);
                            stats.rays += store(&tile, &layers, map.normal, quantizer, lane, &mut rays);
                            stats.close += u64::from(layers.close);
                        }
                    }
                    for rays in &rays {
                        codes.push(self.encoder.encode(rays, &mut words));
                    }
                }
            }
        }
        stats.runs = self.encoder.stored_runs;
        EncodedBlock { codes, words, stats }
    }
}

/// The codes of a packet's rays into their lane; the rays behind the surface stay open. Returns how many are in front.
fn store(
    tile: &CubeTile,
    layers: &Layers,
    normal: Vec3,
    quantizer: Quantizer,
    lane: usize,
    rays: &mut [BlockRays; GROUPS],
) -> u64 {
    let front = tile.plane(normal);
    let (us, vs) = tile.centers();
    let mut count = 0;
    for (y, v) in vs.iter().enumerate() {
        for (x, u) in us.iter().enumerate() {
            let (first, second) = (layers.first[y][x], layers.second[y][x]);
            let farther = (first - layers.first_reach[y][x]).max(0.0);
            let nearer = second + layers.second_reach[y][x];
            let codes = quantizer.guarded_interval(
                [1.0 / first, 1.0 / farther],
                [1.0 / second, 1.0 / nearer],
                OpenEnd::Unbounded,
            );
            let ahead = front.at(*u, *v) > 0.0;
            let codes = if ahead { codes } else { Interval::ANY };
            count += u64::from(ahead);
            let pixel = y * PACKET + x;
            rays[pixel / ROWS].set(pixel % ROWS, lane, codes);
        }
    }
    count
}
