//! What the file holds of each texel.

use half::f16;

use crate::octahedral;

/// Words of a texel's record.
pub const TEXEL_WORDS: usize = 10;

/// A place of the surface.
///
/// ```text
/// word 0..3  position, three floats
///      3     normal, octahedral in two signed 16-bit numbers
///      4     area, float
///      5     diffuse red and green, half floats
///      6     diffuse blue, half float, in the low half
///      7     chart
///      8     cell: column in the low half, row in the high half
///      9     slot: block * 64 + lane
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Texel {
    /// On the surface, in world units of the object's own space.
    pub position: [f32; 3],
    /// Unit normal on the front.
    pub normal: [f32; 3],
    /// Of the surface under the texel, in square world units.
    pub area: f32,
    /// Linear diffuse colour, 0 to 1.
    pub diffuse: [f32; 3],
    /// Which connected piece of the atlas.
    pub chart: u32,
    /// Column and row in the atlas.
    pub cell: [u32; 2],
    /// Where its cube map is: block times [`LANES`](crate::block::LANES) plus lane.
    pub slot: u32,
}

impl Texel {
    /// The record in the file.
    pub fn to_words(&self) -> [u32; TEXEL_WORDS] {
        let [x, y, z] = self.position.map(f32::to_bits);
        let [r, g, b] = self.diffuse.map(|value| u32::from(f16::from_f32(value).to_bits()));
        let [column, row] = self.cell;
        let (normal, area) = (octahedral::encode(self.normal), self.area.to_bits());
        [x, y, z, normal, area, r | g << 16, b, self.chart, column | row << 16, self.slot]
    }

    /// The texel of a record.
    pub fn from_words(words: &[u32; TEXEL_WORDS]) -> Self {
        let [x, y, z, normal, area, rg, b, chart, cell, slot] = *words;
        let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
        Self {
            position: [x, y, z].map(f32::from_bits),
            normal: octahedral::decode(normal),
            area: f32::from_bits(area),
            diffuse: [half(rg), half(rg >> 16), half(b)],
            chart,
            cell: [cell & 0xffff, cell >> 16],
            slot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let texel = Texel {
            position: [1.5, -2.25, 1.0e-7],
            normal: [0.0, 0.0, -1.0],
            area: 0.125,
            diffuse: [0.5, 0.25, 1.0],
            chart: 70_000,
            cell: [511, 65_535],
            slot: 1 << 24,
        };
        assert_eq!(Texel::from_words(&texel.to_words()), texel);
    }
}
