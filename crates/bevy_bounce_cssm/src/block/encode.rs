//! From intervals to words.

use super::{COUNT_BITS, KINDS, Kind, LANE_BITS, LANES, PALETTE_BITS, ROWS};
use crate::bits::{BitWriter, bits_for};
use crate::interval::Interval;
use crate::runs::{Run, fewest_codes, fewest_runs, middle};

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
            return Some(middle(all));
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
        let (mut slots, mut ends, mut planes): (Vec<u16>, Vec<u32>, _) =
            (Vec::new(), Vec::new(), [0; LANE_BITS as usize]);
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
