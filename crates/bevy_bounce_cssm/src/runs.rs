//! The fewest constant pieces of a sequence, and the fewest values for a set of pieces.

use crate::interval::Interval;

/// A constant piece: consecutive places of a sequence that one code serves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The place after the last one.
    pub end: u32,
    /// The codes that are right at every place of the piece.
    pub codes: Interval,
}

/// Cuts a sequence into the fewest runs. Each goes on for as long as some code is right for all of it; no cut of the
/// sequence can have fewer, since no run that starts here ends later and a later start never needs more.
pub fn fewest_runs(sequence: &[Interval], runs: &mut Vec<Run>) {
    runs.clear();
    let mut codes = Interval::ANY;
    for (place, &interval) in sequence.iter().enumerate() {
        codes = match codes.and(interval) {
            Some(both) => both,
            None => {
                runs.push(Run { end: place as u32, codes });
                interval
            }
        };
    }
    if !sequence.is_empty() {
        runs.push(Run { end: sequence.len() as u32, codes });
    }
}

/// The fewest codes such that each interval holds one of them, ascending. Of the codes that would do, each is the one in
/// the middle, away from the surfaces on both sides; [`UNBOUNDED`](crate::UNBOUNDED) where that is among them.
pub fn fewest_codes(intervals: &mut [Interval], codes: &mut Vec<u16>) {
    codes.clear();
    intervals.sort_unstable_by_key(|interval| (interval.hi, interval.lo));
    let mut shared: Option<Interval> = None;
    for &interval in intervals.iter() {
        shared = match shared {
            None => Some(interval),
            // Sorted by `hi`: the code to serve the whole group is at most the first one's `hi`.
            Some(group) if interval.lo <= group.hi => Some(Interval { lo: group.lo.max(interval.lo), hi: group.hi }),
            Some(group) => {
                codes.push(middle(group));
                Some(interval)
            }
        };
    }
    codes.extend(shared.map(middle));
}

/// A code of the interval, away from the surfaces at both of its ends.
pub fn middle(interval: Interval) -> u16 {
    if interval.hi == crate::UNBOUNDED { interval.hi } else { interval.lo + (interval.hi - interval.lo) / 2 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random_intervals(rng: &mut fastrand::Rng, count: usize, range: u16) -> Vec<Interval> {
        (0..count)
            .map(|_| {
                let (a, b) = (rng.u16(0..range), rng.u16(0..range));
                match rng.u8(0..8) {
                    0 => Interval::ANY,
                    1 => Interval::EMPTY_RAY,
                    2 => Interval { lo: a, hi: u16::MAX },
                    _ => Interval { lo: a.min(b), hi: a.max(b) },
                }
            })
            .collect()
    }

    /// Fewest runs by dynamic programming over all cuts: `best[i]` pieces for the first `i` places.
    fn optimum(sequence: &[Interval]) -> usize {
        let mut best = vec![0];
        for end in 1..=sequence.len() {
            let pieces = (0..end).filter(|&start| {
                let piece = &sequence[start..end];
                piece.iter().map(|i| i.lo).max() <= piece.iter().map(|i| i.hi).min()
            });
            best.push(pieces.map(|start| best[start] + 1).min().expect("a single place is a piece"));
        }
        best[sequence.len()]
    }

    #[test]
    fn runs_are_the_optimum() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut runs = Vec::new();
        for case in 0..2000 {
            let sequence = random_intervals(&mut rng, case % 70, 4 + (case % 40) as u16);
            fewest_runs(&sequence, &mut runs);
            assert_eq!(runs.len(), optimum(&sequence));
            let mut start = 0;
            for run in &runs {
                for place in &sequence[start..run.end as usize] {
                    assert!(place.contains(run.codes.lo) && place.contains(run.codes.hi));
                }
                start = run.end as usize;
            }
            assert_eq!(start, sequence.len());
        }
    }

    #[test]
    fn codes_are_the_fewest() {
        let mut rng = fastrand::Rng::with_seed(2);
        let mut codes = Vec::new();
        for _ in 0..500 {
            let intervals = random_intervals(&mut rng, 6, 9);
            fewest_codes(&mut intervals.clone(), &mut codes);
            let serves = |codes: &[u16]| intervals.iter().all(|i| codes.iter().any(|&c| i.contains(c)));
            assert!(serves(&codes), "{intervals:?} {codes:?}");
            // Every choice of one code fewer, among the ends of the intervals.
            let ends: Vec<u16> = intervals.iter().map(|i| i.hi).collect();
            for choice in 0..1 << ends.len() {
                let chosen: Vec<u16> = (0..ends.len()).filter(|i| choice >> i & 1 == 1).map(|i| ends[i]).collect();
                assert!(chosen.len() >= codes.len() || !serves(&chosen), "{intervals:?} {codes:?} {chosen:?}");
            }
        }
    }
}
