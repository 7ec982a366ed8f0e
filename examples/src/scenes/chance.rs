//! Numbers that look random and are the same every time.

/// Small repeatable numbers, after Marsaglia 2003 (xorshift). The seed is not 0.
pub struct Chance(pub u32);

impl Chance {
    /// In 0..1.
    pub fn next(&mut self) -> f32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    /// In `from..to`.
    pub fn between(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * self.next()
    }
}
