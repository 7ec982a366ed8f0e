//! Fields of a few bits in a stream of 32-bit words, least significant bit first.

/// Writes fields one after the other.
#[derive(Debug, Default)]
pub struct BitWriter {
    words: Vec<u32>,
    bits: usize,
}

impl BitWriter {
    /// Appends the low `count` bits of `value`; at most 32.
    pub fn push(&mut self, value: u32, count: u32) {
        if count == 0 {
            return;
        }
        let shift = (self.bits % 32) as u32;
        if shift == 0 {
            self.words.push(0);
        }
        let value = if count == 32 { value } else { value & ((1 << count) - 1) };
        if let Some(last) = self.words.last_mut() {
            *last |= value << shift;
        }
        if shift + count > 32 {
            self.words.push(value >> (32 - shift));
        }
        self.bits += count as usize;
    }

    /// Fills up the last word with zeros.
    pub fn align(&mut self) {
        self.bits = self.words.len() * 32;
    }

    /// The words written so far; the last one is filled up with zeros.
    pub fn words(&self) -> &[u32] {
        &self.words
    }

    /// Forgets everything and keeps the memory.
    pub fn clear(&mut self) {
        self.words.clear();
        self.bits = 0;
    }
}

/// The `count` bits from bit `start` of `words`, at most 32; nothing if they lie outside.
#[inline]
pub fn read_bits(words: &[u32], start: usize, count: u32) -> Option<u32> {
    if count == 0 {
        return Some(0);
    }
    let (word, shift) = (start / 32, (start % 32) as u32);
    let mut value = u64::from(*words.get(word)?);
    if shift + count > 32 {
        value |= u64::from(*words.get(word + 1)?) << 32;
    }
    Some(((value >> shift) & ((1 << count) - 1)) as u32)
}

/// Bits needed to tell `count` things apart; none for a single one.
pub fn bits_for(count: usize) -> u32 {
    usize::BITS - count.saturating_sub(1).leading_zeros()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let fields = [(5, 3), (0xffff_ffff, 32), (0, 0), (1, 1), (0x1234, 16), (77, 7), (0xdead_beef, 32), (3, 2)];
        let mut writer = BitWriter::default();
        for (value, count) in fields {
            writer.push(value, count);
        }
        let mut start = 0;
        for (value, count) in fields {
            assert_eq!(read_bits(writer.words(), start, count), Some(value));
            start += count as usize;
        }
        assert_eq!(read_bits(writer.words(), start, 32), None);
    }

    #[test]
    fn widths() {
        assert_eq!([1, 2, 3, 4, 5, 256, 257].map(bits_for), [0, 1, 2, 2, 3, 8, 9]);
    }
}
