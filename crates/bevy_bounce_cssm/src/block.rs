//! The codec of a block: 32 rows (cube pixels) by 64 lanes (texels).
//!
//! A row is cut into the fewest runs, then all runs of the block share the fewest codes that serve them: its palette.
//! What is stored depends on how much varies:
//!
//! - One code for the whole block: 16 bits in the directory, nothing else.
//! - One code for a row: the index of that code.
//! - Several: a *record* with the codes of the row and bit planes that say which code each lane has. A row with `n` codes
//!   has the class `c = ceil(log2 n)` and as many planes of 64 bits. Rows that are alike share a record.
//!
//! ```text
//! word 0   bits 0..11   palette size, less one
//!               11..29  number of records of class 1, 2 and 3, six bits each
//!               29..32  zero
//!      [1] bits 0..18   number of records of class 4, 5 and 6; there if bit 29 of word 0 is set
//! from the next word on, without gaps:
//!     32 entries    `e` bits each: a palette index, or palette size plus number of a record
//!     palette       16 bits each, ascending
//!     records       by class: 2^c palette indices of `b` bits, then c planes of 64 bits, lane 0 first
//! ```
//!
//! `b` is the width of a palette index, `e` the width of an entry. All places follow from the first word, so that a code
//! is found in five to eight reads: first word, entry, one bit of each plane, index, palette.

use crate::{
    bits::{BitWriter, bits_for, read_bits},
    interval::Interval,
    runs::{Run, fewest_codes, fewest_runs},
};

/// Texels a block.
pub const LANES: usize = 64;
/// Cube pixels a block.
pub const ROWS: usize = 32;
/// Codes a row may need take up to six planes.
const CLASSES: usize = 6;
const PALETTE_BITS: u32 = 11;
const COUNT_BITS: u32 = 6;
const MORE_CLASSES: u32 = 1 << 29;

/// The codes that are right, for every row and lane of a block.
#[derive(Clone)]
pub struct BlockRays {
    /// The smallest right code of each row and lane.
    pub lo: [[u16; LANES]; ROWS],
    /// The largest.
    pub hi: [[u16; LANES]; ROWS],
}

impl BlockRays {
    /// A block nobody asks about.
    pub const ANY: Self = Self { lo: [[0; LANES]; ROWS], hi: [[u16::MAX; LANES]; ROWS] };

    /// The codes of one ray.
    pub fn get(&self, row: usize, lane: usize) -> Interval {
        Interval { lo: self.lo[row][lane], hi: self.hi[row][lane] }
    }

    /// Sets the codes of one ray.
    #[inline]
    pub fn set(&mut self, row: usize, lane: usize, interval: Interval) {
        self.lo[row][lane] = interval.lo;
        self.hi[row][lane] = interval.hi;
    }

    /// The codes that are right in all lanes of a row.
    fn row(&self, row: usize) -> Option<Interval> {
        let lo = self.lo[row].iter().fold(0, |a, &b| a.max(b));
        let hi = self.hi[row].iter().fold(u16::MAX, |a, &b| a.min(b));
        (lo <= hi).then_some(Interval { lo, hi })
    }
}

/// What became of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockCode {
    /// One code for all.
    Constant(u16),
    /// As many words were appended.
    Words(usize),
}

/// Encodes blocks; keeps its memory from block to block.
#[derive(Default)]
pub struct BlockEncoder {
    runs: Vec<Run>,
    row_runs: Vec<Run>,
    row_ends: Vec<usize>,
    intervals: Vec<Interval>,
    palette: Vec<u16>,
    row_codes: Vec<u16>,
    records: Vec<Record>,
    writer: BitWriter,
    /// Runs in what was encoded so far: constant blocks, constant rows and pieces of rows with several codes.
    pub stored_runs: u64,
}

/// A row with several codes.
#[derive(Clone, PartialEq, Eq)]
struct Record {
    /// Palette indices, ascending.
    codes: Vec<u16>,
    /// Which of them each lane has, one bit a plane.
    planes: [u64; CLASSES],
    class: usize,
}

impl BlockEncoder {
    /// Appends the words of a block to `words`, or finds the one code that serves it all.
    pub fn encode(&mut self, rays: &BlockRays, words: &mut Vec<u32>) -> BlockCode {
        if let Some(code) = self.cut(rays) {
            self.stored_runs += 1;
            return BlockCode::Constant(code);
        }
        self.intervals.clear();
        self.intervals.extend(self.runs.iter().map(|run| run.codes));
        fewest_codes(&mut self.intervals, &mut self.palette);
        let entries = self.index_rows();
        self.write(&entries);
        words.extend_from_slice(self.writer.words());
        BlockCode::Words(self.writer.words().len())
    }

    /// Cuts every row into runs; or the code of the whole block.
    fn cut(&mut self, rays: &BlockRays) -> Option<u16> {
        let constant: [Option<Interval>; ROWS] = std::array::from_fn(|row| rays.row(row));
        let all = constant.iter().try_fold(Interval::ANY, |all, row| all.and((*row)?));
        if let Some(all) = all {
            return Some(crate::runs::middle(all));
        }
        self.runs.clear();
        self.row_ends.clear();
        for (row, constant) in constant.into_iter().enumerate() {
            match constant {
                Some(codes) => self.runs.push(Run { end: LANES as u32, codes }),
                None => {
                    let sequence: [Interval; LANES] = std::array::from_fn(|lane| rays.get(row, lane));
                    fewest_runs(&sequence, &mut self.row_runs);
                    self.runs.append(&mut self.row_runs);
                }
            }
            self.row_ends.push(self.runs.len());
        }
        None
    }

    /// Gives each run a code of the palette, each row as few as its runs allow. Returns the entries: a palette index, or
    /// palette size plus number of a record.
    fn index_rows(&mut self) -> [u32; ROWS] {
        self.records.clear();
        let mut rows: [RowCode; ROWS] = [RowCode::Constant(0); ROWS];
        let mut start = 0;
        for (row, &end) in self.row_ends.iter().enumerate() {
            let runs = &self.runs[start..end];
            start = end;
            // The codes that serve a run are neighbours in the palette.
            let indices = |run: &Run| Interval {
                lo: self.palette.partition_point(|&code| code < run.codes.lo) as u16,
                hi: self.palette.partition_point(|&code| code <= run.codes.hi) as u16 - 1,
            };
            self.intervals.clear();
            self.intervals.extend(runs.iter().map(indices));
            fewest_codes(&mut self.intervals, &mut self.row_codes);
            if let [only] = self.row_codes[..] {
                rows[row] = RowCode::Constant(only);
                self.stored_runs += 1;
                continue;
            }
            let record = Record::new(&self.row_codes, runs, indices);
            let known = self.records.iter().position(|other| *other == record);
            rows[row] = RowCode::Record(known.unwrap_or(self.records.len()));
            if known.is_none() {
                self.stored_runs += runs.len() as u64;
                self.records.push(record);
            }
        }
        // Records are stored by class.
        let mut order: Vec<usize> = (0..self.records.len()).collect();
        order.sort_by_key(|&record| self.records[record].class);
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
        self.records.sort_by_key(|record| record.class);
        rows.map(|row| match row {
            RowCode::Constant(index) => u32::from(index),
            RowCode::Record(record) => (self.palette.len() + place[record]) as u32,
        })
    }

    fn write(&mut self, entries: &[u32; ROWS]) {
        let writer = &mut self.writer;
        writer.clear();
        let mut counts = [0; CLASSES];
        self.records.iter().for_each(|record| counts[record.class - 1] += 1);
        let more = counts[3..].iter().any(|&count| count > 0);
        writer.push(self.palette.len() as u32 - 1, PALETTE_BITS);
        counts[..3].iter().for_each(|&count| writer.push(count, COUNT_BITS));
        writer.push(u32::from(more), 1);
        writer.align();
        if more {
            counts[3..].iter().for_each(|&count| writer.push(count, COUNT_BITS));
            writer.align();
        }
        let index_bits = bits_for(self.palette.len());
        let entry_bits = bits_for(self.palette.len() + self.records.len());
        entries.iter().for_each(|&entry| writer.push(entry, entry_bits));
        self.palette.iter().for_each(|&code| writer.push(u32::from(code), 16));
        for record in &self.records {
            for slot in 0..1 << record.class {
                let code = record.codes.get(slot).copied().unwrap_or(0);
                writer.push(u32::from(code), index_bits);
            }
            for plane in &record.planes[..record.class] {
                writer.push(*plane as u32, 32);
                writer.push((*plane >> 32) as u32, 32);
            }
        }
    }
}

#[derive(Clone, Copy)]
enum RowCode {
    Constant(u16),
    Record(usize),
}

impl Record {
    /// `indices` are the palette indices that serve a run; `codes` holds one of them for each.
    fn new(codes: &[u16], runs: &[Run], indices: impl Fn(&Run) -> Interval) -> Self {
        let class = bits_for(codes.len()) as usize;
        let mut planes = [0; CLASSES];
        let mut start = 0;
        for run in runs {
            let serving = indices(run);
            let code = codes.partition_point(|&code| code < serving.lo);
            let lanes = ones(run.end) & !ones(start);
            for (bit, plane) in planes.iter_mut().enumerate() {
                *plane |= if code >> bit & 1 == 1 { lanes } else { 0 };
            }
            start = run.end;
        }
        Self { codes: codes.to_vec(), planes, class }
    }
}

/// The low `count` bits.
fn ones(count: u32) -> u64 {
    if count >= 64 { u64::MAX } else { (1 << count) - 1 }
}

/// Where the parts of a block lie.
#[derive(Clone, Copy)]
struct Layout {
    palette: u32,
    counts: [u32; CLASSES],
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
        let more = if head & MORE_CLASSES != 0 { *words.get(1)? } else { 0 };
        let palette = (head & ((1 << PALETTE_BITS) - 1)) + 1;
        let count = |class: u32| match class {
            0..3 => head >> (PALETTE_BITS + class * COUNT_BITS) & 0x3f,
            _ => more >> ((class - 3) * COUNT_BITS) & 0x3f,
        };
        let counts: [u32; CLASSES] = std::array::from_fn(|class| count(class as u32));
        let index_bits = bits_for(palette as usize);
        let entry_bits = bits_for((palette + counts.iter().sum::<u32>()) as usize);
        let entries_at = if head & MORE_CLASSES != 0 { 64 } else { 32 };
        let palette_at = entries_at + ROWS * entry_bits as usize;
        let records_at = palette_at + 16 * palette as usize;
        Some(Self { palette, counts, index_bits, entry_bits, entries_at, palette_at, records_at })
    }

    fn record_bits(&self, class: u32) -> usize {
        (self.index_bits as usize) << class
    }

    /// Class and first bit of a record.
    fn record(&self, mut number: u32) -> Option<(u32, usize)> {
        let mut at = self.records_at;
        for (class, &count) in (1..).zip(&self.counts) {
            let bits = self.record_bits(class) + 64 * class as usize;
            if number < count {
                return Some((class, at + number as usize * bits));
            }
            number -= count;
            at += count as usize * bits;
        }
        None
    }

    fn end(&self) -> usize {
        (1..).zip(&self.counts).fold(self.records_at, |at, (class, &count)| {
            at + count as usize * (self.record_bits(class) + 64 * class as usize)
        })
    }
}

/// The code of a row and lane in a block that starts at the first of `words`; nothing if the block is damaged.
pub fn decode(words: &[u32], row: usize, lane: usize) -> Option<u16> {
    let layout = Layout::read(words)?;
    let entry = read_bits(words, layout.entries_at + row * layout.entry_bits as usize, layout.entry_bits)?;
    let index = if entry < layout.palette {
        entry
    } else {
        let (class, at) = layout.record(entry - layout.palette)?;
        let planes_at = at + layout.record_bits(class);
        let mut slot = 0;
        for plane in 0..class as usize {
            slot |= read_bits(words, planes_at + 64 * plane + lane, 1)? << plane;
        }
        read_bits(words, at + slot as usize * layout.index_bits as usize, layout.index_bits)?
    };
    if index >= layout.palette {
        return None;
    }
    read_bits(words, layout.palette_at + 16 * index as usize, 16).map(|code| code as u16)
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
        let (class, at) = layout.record(number)?;
        for slot in 0..1 << class {
            if read_bits(words, at + slot * layout.index_bits as usize, layout.index_bits)? >= layout.palette {
                return None;
            }
        }
    }
    Some(size)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays such that a lane's codes depend on where it lies: few codes, many codes, and nothing in common.
    fn random_rays(rng: &mut fastrand::Rng, values: u16) -> BlockRays {
        let mut rays = BlockRays::ANY;
        let edges: [usize; ROWS] = std::array::from_fn(|_| rng.usize(0..2 * LANES));
        for row in 0..ROWS {
            for lane in 0..LANES {
                let base = if lane < edges[row] { 7 } else { rng.u16(0..values) * 100 };
                let interval = match rng.u8(0..10) {
                    0 => Interval::ANY,
                    1 if values > 20 => Interval::EMPTY_RAY,
                    _ => Interval { lo: base, hi: base + rng.u16(0..90) },
                };
                rays.set(row, lane, interval);
            }
        }
        rays
    }

    #[test]
    fn every_code_is_right() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut encoder = BlockEncoder::default();
        for case in 0..300 {
            let rays = random_rays(&mut rng, 1 + case % 60);
            let mut words = vec![0xdead_beef];
            let code = encoder.encode(&rays, &mut words);
            if let BlockCode::Words(size) = code {
                assert_eq!(check(&words[1..]), Some(size));
                assert_eq!(words.len(), size + 1);
            }
            for row in 0..ROWS {
                for lane in 0..LANES {
                    let code = match code {
                        BlockCode::Constant(code) => code,
                        BlockCode::Words(_) => decode(&words[1..], row, lane).expect("in the block"),
                    };
                    assert!(rays.get(row, lane).contains(code), "case {case} row {row} lane {lane}");
                }
            }
        }
    }

    #[test]
    fn the_widest_block_fits() {
        let mut rays = BlockRays::ANY;
        for row in 0..ROWS {
            for lane in 0..LANES {
                let code = ((row * LANES + lane) * 31 % 65536) as u16;
                rays.set(row, lane, Interval { lo: code, hi: code });
            }
        }
        let mut words = Vec::new();
        let code = BlockEncoder::default().encode(&rays, &mut words);
        assert_eq!(code, BlockCode::Words(check(&words).expect("valid")));
        for (row, lane) in [(0, 0), (31, 63), (7, 40)] {
            assert_eq!(decode(&words, row, lane), Some(rays.lo[row][lane]));
        }
    }

    #[test]
    fn damage_is_noticed() {
        let mut rng = fastrand::Rng::with_seed(4);
        let rays = random_rays(&mut rng, 30);
        let mut words = Vec::new();
        BlockEncoder::default().encode(&rays, &mut words);
        for length in 0..words.len() {
            assert_eq!(check(&words[..length]), None);
        }
        for word in 0..words.len() {
            for bit in 0..32 {
                let mut damaged = words.clone();
                damaged[word] ^= 1 << bit;
                if check(&damaged).is_some() {
                    for (row, lane) in [(0, 0), (13, 21), (31, 63)] {
                        assert!(decode(&damaged, row, lane).is_some());
                    }
                }
            }
        }
    }
}
