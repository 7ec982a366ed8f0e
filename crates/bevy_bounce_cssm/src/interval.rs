//! Depth codes, and the codes that a ray allows.

/// The code of a ray that meets nothing: every depth is in front of it.
pub const UNBOUNDED: u16 = u16::MAX;

/// The largest code of a finite depth.
pub const MAX_FINITE: u16 = u16::MAX - 1;

/// Keeps both ends strict whatever the rounding of a depth and of `depth / quantum`, in quanta. Two to the minus eight is one
/// unit in the last place of the largest code.
const GUARD: f32 = 1.0 / 8.0;

/// The codes that are right for one ray, both ends included.
///
/// A code is right if its depth lies strictly between the first and the second surface along the ray: what stands on the
/// first surface is then in front of it, what stands on the second is behind it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interval {
    /// The smallest code.
    pub lo: u16,
    /// The largest code.
    pub hi: u16,
}

impl Interval {
    /// A ray that nobody asks about: any code will do.
    pub const ANY: Self = Self { lo: 0, hi: u16::MAX };

    /// A ray that meets nothing.
    pub const EMPTY_RAY: Self = Self { lo: UNBOUNDED, hi: UNBOUNDED };

    /// Whether `code` is right for the ray.
    pub fn contains(self, code: u16) -> bool {
        self.lo <= code && code <= self.hi
    }

    /// The codes that are right for both, or nothing.
    pub fn and(self, other: Self) -> Option<Self> {
        let both = Self { lo: self.lo.max(other.lo), hi: self.hi.min(other.hi) };
        (both.lo <= both.hi).then_some(both)
    }
}

/// What the open end of a ray with a single surface means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpenEnd {
    /// Nothing of the object lies behind the only surface, so [`UNBOUNDED`] is right too. For maps that are asked about
    /// points of the object itself.
    Unbounded,
    /// The surface must show: only finite codes are right. For maps that are asked whether the object blocks a ray.
    Finite,
}

/// Linear depth in 16 bits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantizer {
    /// Depth of one step, in world units.
    pub quantum: f32,
    inverse: f32,
}

impl Quantizer {
    /// Steps of `quantum` world units.
    pub fn new(quantum: f32) -> Self {
        Self { quantum, inverse: 1.0 / quantum }
    }

    /// Steps such that depths up to `far` world units have a finite code.
    pub fn with_far(far: f32) -> Self {
        // Two codes are left for what lies behind the farthest surface.
        Self::new(far / (f32::from(MAX_FINITE) - 2.0))
    }

    /// Depth of a code in world units; infinite for [`UNBOUNDED`].
    pub fn depth(self, code: u16) -> f32 {
        if code == UNBOUNDED { f32::INFINITY } else { f32::from(code) * self.quantum }
    }

    /// The codes strictly between two depths, in world units; infinity stands for no surface. Where no code fits between
    /// them, the code right behind the first: the two are then one surface to whoever asks.
    #[inline]
    pub fn interval(self, first: f32, second: f32, open: OpenEnd) -> Interval {
        if first == f32::INFINITY {
            return Interval::EMPTY_RAY;
        }
        let lo = self.behind(first);
        let hi = match (second == f32::INFINITY, open) {
            (true, OpenEnd::Unbounded) => UNBOUNDED,
            (true, OpenEnd::Finite) => MAX_FINITE,
            (false, _) => self.before(second),
        };
        Interval { lo, hi: hi.max(lo) }
    }

    /// The part of [`interval`](Self::interval) that is also behind `first_far` and before `second_near`: the surfaces'
    /// depths elsewhere in the ray's pixel. As far as that leaves a third of the interval at least.
    #[inline]
    pub fn guarded_interval(self, first: [f32; 2], second: [f32; 2], open: OpenEnd) -> Interval {
        let Interval { lo, hi } = self.interval(first[0], second[0], open);
        let third = (hi - lo) / 3;
        // Comparisons with what is not a number are false and leave that end as it is.
        let lo = if first[1] < f32::INFINITY { self.behind(first[1]).clamp(lo, lo + third) } else { lo + third };
        let hi = if second[1] < f32::INFINITY { self.before(second[1]).clamp(hi - third, hi) } else { hi };
        Interval { lo, hi }
    }

    /// The first code behind a depth.
    #[inline]
    fn behind(self, depth: f32) -> u16 {
        round((depth * self.inverse + (0.5 + GUARD)).min(f32::from(MAX_FINITE))) as u16
    }

    /// The last code before a depth.
    #[inline]
    fn before(self, depth: f32) -> u16 {
        round((depth * self.inverse - (0.5 + GUARD)).clamp(0.0, f32::from(MAX_FINITE))) as u16
    }
}

/// Rounds `0 <= x < 2^22` to the nearest integer. Compiles to one addition, where `as` would check the range.
#[inline]
fn round(x: f32) -> u32 {
    (x + 8_388_608.0).to_bits() & 0x007f_ffff
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_lie_strictly_between() {
        let quantizer = Quantizer::with_far(10.0);
        let mut first = 1.0e-5;
        while first < 9.9 {
            for gap in [2.3, 2.5, 7.0, 1000.0] {
                let second = first + gap * quantizer.quantum;
                let interval = quantizer.interval(first, second, OpenEnd::Unbounded);
                for code in [interval.lo, interval.hi] {
                    let depth = quantizer.depth(code);
                    assert!(first < depth && depth < second, "{first} {depth} {second}");
                }
            }
            first *= 1.003;
        }
    }

    #[test]
    fn open_ends() {
        let quantizer = Quantizer::with_far(1.0);
        let inf = f32::INFINITY;
        assert_eq!(quantizer.interval(inf, inf, OpenEnd::Unbounded), Interval::EMPTY_RAY);
        assert_eq!(quantizer.interval(0.5, inf, OpenEnd::Unbounded).hi, UNBOUNDED);
        assert_eq!(quantizer.interval(0.5, inf, OpenEnd::Finite).hi, MAX_FINITE);
        assert!(quantizer.interval(1.0, inf, OpenEnd::Finite).lo <= MAX_FINITE);
    }

    #[test]
    fn surfaces_within_a_quantum_are_one() {
        let quantizer = Quantizer::with_far(1.0);
        let first = 100.25 * quantizer.quantum;
        let interval = quantizer.interval(first, first + 0.1 * quantizer.quantum, OpenEnd::Unbounded);
        assert_eq!(interval.lo, interval.hi);
        assert!(quantizer.depth(interval.lo) > first);
    }
}
