//! The codec of a block: 32 rows (cube pixels) by 64 lanes (texels).
//!
//! A row is cut into the fewest runs, then all runs of the block share the fewest codes that serve them: its palette.
//! What is stored depends on how much varies:
//!
//! - One code for the whole block: 16 bits in the directory, nothing else.
//! - One code for a row: the index of that code.
//! - Several: a *record* of one of six kinds, whichever is smallest. Up to 4, 8 or 16 runs are stored as the last lane and
//!   the code of each. Up to 2, 8 or 64 codes are stored as such, and 1, 3 or 6 bit planes say which one each lane has.
//!   Rows that are alike share a record.
//!
//! ```text
//! word 0   bits 0..11   palette size, less one
//!               11..29  number of records with 4 runs, 8 runs and 1 plane, six bits each
//!               29      word 1 is there
//!     [1] bits  0..18   number of records with 16 runs, 3 planes and 6 planes, six bits each
//! from the next word on, without gaps:
//!     32 entries    `e` bits each: a palette index, or palette size plus number of a record
//!     palette       16 bits each, ascending
//!     records       in the order of their numbers; a palette index of `b` bits for each run or code, then
//!                   the last lane of each run, six bits each, or planes of 64 bits, lane 0 first
//! ```
//!
//! `b` is the width of a palette index, `e` the width of an entry. All places follow from the first two words, so that a
//! code is found in a few reads: head, entry, ends of runs or one bit of each plane, index, palette.

mod decode;
mod encode;

pub use decode::{check, decode};
pub use encode::{BlockCode, BlockEncoder, BlockRays};

#[cfg(test)]
mod tests;

/// Texels a block.
pub const LANES: usize = 64;
/// Cube pixels a block.
pub const ROWS: usize = 32;
/// Bits of a lane's number.
const LANE_BITS: u32 = 6;

/// How a row with several codes is stored: so many runs, or so many planes.
#[derive(Clone, Copy)]
struct Kind {
    runs: u32,
    planes: u32,
}

impl Kind {
    /// Palette indices in a record.
    const fn slots(self) -> u32 {
        if self.runs > 0 { self.runs } else { 1 << self.planes }
    }

    /// Bits of a record whose palette indices have so many bits.
    const fn bits(self, index_bits: u32) -> usize {
        (self.slots() * index_bits + self.runs * LANE_BITS) as usize + LANES * self.planes as usize
    }
}

/// In the order of their records. The last one holds any row.
const KINDS: [Kind; 6] = [
    Kind { runs: 4, planes: 0 },
    Kind { runs: 8, planes: 0 },
    Kind { runs: 0, planes: 1 },
    Kind { runs: 16, planes: 0 },
    Kind { runs: 0, planes: 3 },
    Kind { runs: 0, planes: 6 },
];
const PALETTE_BITS: u32 = 11;
const COUNT_BITS: u32 = 6;
const MORE_KINDS: u32 = 1 << 29;
