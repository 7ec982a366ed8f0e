//! What can be chosen.

use bevy::prelude::*;

/// How light is cached; part of [`GiSettings`](crate::GiSettings).
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Default)]
pub struct RadianceCacheSettings {
    /// Glossy light beside virtual point lights: what they light is seen in metal and polish. Costs the light of the voxels and the
    /// caches. With [`Technique::RadianceCache`](crate::Technique::RadianceCache) it is always there.
    pub glossy: bool,
    /// Caches at two million pixels, 256 to 32768; in proportion to the number of pixels, and never less than 1024. More show finer
    /// detail in reflections; memory (4 KiB each) and the cost of filling them are proportional.
    #[reflect(@256..=32768_u32)]
    pub caches: u32,
    /// Radius within which a pixel gathers from caches, in tiles of the screen, 1.5 to 8. More is smoother and blurs what should
    /// differ; cost grows with its square.
    #[reflect(@1.5..=8.0_f32)]
    pub reach: f32,
    /// Surfaces that are seen in the caches are lit by virtual point lights besides Bevy's lights: all further bounces, and the
    /// light of emissive surfaces. Costs a sixteenth of the virtual lights for each cell of the grid.
    pub further_bounces: bool,
}

/// Fewest caches of a view: what is mirrored does not become coarser with the picture.
const FEWEST: u32 = 1024;
/// Most caches of a view: those that the largest texture of the smallest device holds.
const MOST: u32 = 32768;
/// Pixels at which the number of caches is as the settings say.
const REFERENCE_PIXELS: u64 = 2_000_000;

impl RadianceCacheSettings {
    /// No glossy light beside virtual point lights; 4096 caches, two tiles, all bounces.
    pub const DEFAULT: Self = Self { glossy: false, caches: 4096, reach: 2.0, further_bounces: true };

    /// The same within the documented ranges.
    pub(crate) fn clamped(self) -> Self {
        let reach = if self.reach.is_finite() { self.reach.clamp(1.5, 8.0) } else { Self::DEFAULT.reach };
        Self { caches: self.caches.clamp(256, MOST), reach, ..self }
    }

    /// Of every value the more demanding one.
    pub(crate) fn more(self, other: Self) -> Self {
        Self {
            glossy: self.glossy || other.glossy,
            caches: self.caches.max(other.caches),
            reach: self.reach.max(other.reach),
            further_bounces: self.further_bounces || other.further_bounces,
        }
    }

    /// Caches of a view of that many pixels.
    pub(crate) fn capacity(&self, size: UVec2) -> u32 {
        let pixels = size.as_u64vec2().element_product();
        let scaled = u64::from(self.caches) * pixels / REFERENCE_PIXELS;
        scaled.clamp(u64::from(FEWEST), u64::from(MOST)) as u32
    }
}

impl Default for RadianceCacheSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caches_follow_the_pixels() {
        let settings = RadianceCacheSettings::DEFAULT;
        assert_eq!(settings.capacity(UVec2::new(2000, 1000)), 4096);
        assert_eq!(settings.capacity(UVec2::new(320, 180)), 1024);
        assert_eq!(settings.capacity(UVec2::new(4000, 2000)), 16384);
        assert_eq!(settings.capacity(UVec2::new(16384, 16384)), 32768);
    }

    #[test]
    fn settings_are_clamped() {
        let wild = RadianceCacheSettings { caches: 0, reach: f32::NAN, ..default() };
        assert_eq!(wild.clamped(), RadianceCacheSettings { caches: 256, ..default() });
    }
}
