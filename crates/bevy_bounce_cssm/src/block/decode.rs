//! From words to codes.

use super::{COUNT_BITS, KINDS, Kind, LANE_BITS, LANES, MORE_KINDS, PALETTE_BITS, ROWS};
use crate::bits::{bits_for, read_bits};

/// Where the parts of a block lie.
#[derive(Clone, Copy)]
struct Layout {
    palette: u32,
    counts: [u32; KINDS.len()],
    index_bits: u32,
    entry_bits: u32,
    /// First bit of the entries, of the palette and of the records.
    entries_at: usize,
    palette_at: usize,
    records_at: usize,
}

impl Layout {
    fn read(words: &[u32]) -> Option<Self> {
        let head = *words.first()?;
        let more = if head & MORE_KINDS != 0 { *words.get(1)? } else { 0 };
        let palette = (head & ((1 << PALETTE_BITS) - 1)) + 1;
        let count = |kind: u32| match kind {
            0..3 => head >> (PALETTE_BITS + kind * COUNT_BITS) & 0x3f,
            _ => more >> ((kind - 3) * COUNT_BITS) & 0x3f,
        };
        let counts: [u32; KINDS.len()] = std::array::from_fn(|kind| count(kind as u32));
        let index_bits = bits_for(palette as usize);
        let entry_bits = bits_for((palette + counts.iter().sum::<u32>()) as usize);
        let entries_at = if head & MORE_KINDS != 0 { 64 } else { 32 };
        let palette_at = entries_at + ROWS * entry_bits as usize;
        let records_at = palette_at + 16 * palette as usize;
        Some(Self { palette, counts, index_bits, entry_bits, entries_at, palette_at, records_at })
    }

    /// Kind and first bit of a record.
    fn record(&self, mut number: u32) -> Option<(Kind, usize)> {
        let mut at = self.records_at;
        for (kind, &count) in KINDS.iter().zip(&self.counts) {
            let bits = kind.bits(self.index_bits);
            if number < count {
                return Some((*kind, at + number as usize * bits));
            }
            number -= count;
            at += count as usize * bits;
        }
        None
    }

    fn end(&self) -> usize {
        let sizes = KINDS.iter().zip(&self.counts).map(|(kind, &count)| count as usize * kind.bits(self.index_bits));
        self.records_at + sizes.sum::<usize>()
    }
}

/// The code of a row and lane in a block that starts at the first of `words`; nothing if the block is damaged.
pub fn decode(words: &[u32], row: usize, lane: usize) -> Option<u16> {
    let layout = Layout::read(words)?;
    let entry = read_bits(words, layout.entries_at + row * layout.entry_bits as usize, layout.entry_bits)?;
    let index = if entry < layout.palette {
        entry
    } else {
        let (kind, at) = layout.record(entry - layout.palette)?;
        let slot = decode_slot(words, kind, at + (kind.slots() * layout.index_bits) as usize, lane)?;
        read_bits(words, at + (slot * layout.index_bits) as usize, layout.index_bits)?
    };
    if index >= layout.palette {
        return None;
    }
    read_bits(words, layout.palette_at + 16 * index as usize, 16).map(|code| code as u16)
}

/// Which palette index of a record is that of a lane. Ends of runs and planes begin at bit `at`.
fn decode_slot(words: &[u32], kind: Kind, at: usize, lane: usize) -> Option<u32> {
    if kind.runs == 0 {
        let bit = |plane: u32| read_bits(words, at + LANES * plane as usize + lane, 1);
        return (0..kind.planes).try_fold(0, |slot, plane| Some(slot | bit(plane)? << plane));
    }
    let mut passed = 0;
    for run in 0..kind.runs {
        let end = read_bits(words, at + (run * LANE_BITS) as usize, LANE_BITS)?;
        passed += u32::from((end as usize) < lane);
    }
    Some(passed.min(kind.runs - 1))
}

/// How many words the block takes that starts at the first of `words`, once everything in it is known to point into it.
pub fn check(words: &[u32]) -> Option<usize> {
    let layout = Layout::read(words)?;
    let size = layout.end().div_ceil(32);
    let words = words.get(..size)?;
    let records: u32 = layout.counts.iter().sum();
    for row in 0..ROWS {
        let entry = read_bits(words, layout.entries_at + row * layout.entry_bits as usize, layout.entry_bits)?;
        if entry >= layout.palette + records {
            return None;
        }
    }
    for number in 0..records {
        let (kind, at) = layout.record(number)?;
        for slot in 0..kind.slots() {
            if read_bits(words, at + (slot * layout.index_bits) as usize, layout.index_bits)? >= layout.palette {
                return None;
            }
        }
    }
    Some(size)
}
