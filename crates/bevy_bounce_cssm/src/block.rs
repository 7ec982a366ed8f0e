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

use crate::{
    bits::{BitWriter, bits_for, read_bits},
    interval::Interval,
    runs::{Run, fewest_codes, fewest_runs},
};

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
    /// Which of [`KINDS`].
    kind: usize,
    /// Palette indices: of each run, or of each value that the planes give.
    slots: Vec<u16>,
    /// Last lane of each run.
    ends: Vec<u32>,
    planes: [u64; LANE_BITS as usize],
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
            let index_bits = bits_for(self.palette.len());
            let record = Record::new(&self.row_codes, runs, indices, index_bits);
            let known = self.records.iter().position(|other| *other == record);
            rows[row] = RowCode::Record(known.unwrap_or(self.records.len()));
            if known.is_none() {
                self.stored_runs += runs.len() as u64;
                self.records.push(record);
            }
        }
        // Records are stored by kind.
        let mut order: Vec<usize> = (0..self.records.len()).collect();
        order.sort_by_key(|&record| self.records[record].kind);
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(to, &from)| place[from] = to);
        self.records.sort_by_key(|record| record.kind);
        rows.map(|row| match row {
            RowCode::Constant(index) => u32::from(index),
            RowCode::Record(record) => (self.palette.len() + place[record]) as u32,
        })
    }

    fn write(&mut self, entries: &[u32; ROWS]) {
        let writer = &mut self.writer;
        writer.clear();
        let mut counts = [0; KINDS.len()];
        self.records.iter().for_each(|record| counts[record.kind] += 1);
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
            record.slots.iter().for_each(|&code| writer.push(u32::from(code), index_bits));
            record.ends.iter().for_each(|&end| writer.push(end, LANE_BITS));
            for plane in &record.planes[..KINDS[record.kind].planes as usize] {
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
    /// `indices` are the palette indices that serve a run; `codes` holds one of them for each, ascending.
    fn new(codes: &[u16], runs: &[Run], indices: impl Fn(&Run) -> Interval, index_bits: u32) -> Self {
        let fits = |kind: &usize| match KINDS[*kind] {
            Kind { runs: 0, planes } => codes.len() <= 1 << planes,
            Kind { runs: most, .. } => runs.len() <= most as usize,
        };
        let smallest = (0..KINDS.len()).filter(fits).min_by_key(|&kind| KINDS[kind].bits(index_bits));
        let kind = smallest.unwrap_or(KINDS.len() - 1);
        let code = |run: &Run| codes.partition_point(|&code| code < indices(run).lo);
        let (mut slots, mut ends, mut planes): (Vec<u16>, Vec<u32>, _) = (Vec::new(), Vec::new(), [0; LANE_BITS as usize]);
        if KINDS[kind].runs > 0 {
            slots.extend(runs.iter().map(|run| codes[code(run)]));
            ends.extend(runs.iter().map(|run| run.end - 1));
            ends.resize(KINDS[kind].runs as usize, LANES as u32 - 1);
        } else {
            slots.extend(codes);
            let mut start = 0;
            for run in runs {
                let lanes = ones(run.end) & !ones(start);
                let slot = code(run);
                (0..).zip(&mut planes).filter(|(bit, _)| slot >> bit & 1 == 1).for_each(|(_, plane)| *plane |= lanes);
                start = run.end;
            }
        }
        slots.resize(KINDS[kind].slots() as usize, 0);
        Self { kind, slots, ends, planes }
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
