//! What can be chosen.

use bevy::prelude::*;

/// How light is gathered from baked objects.
#[derive(Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Default)]
pub struct CssmSettings {
    /// Steps of 1/255 of the display's brightness, after exposure and tone mapping, 0.05 to 128: texels are taken
    /// together where the light from all of them is less. Less is finer and calmer; cost is about its inverse. Of color
    /// grading, its exposure counts.
    #[reflect(@0.05..=128.0_f32)]
    pub error: f32,
    /// How visibility is looked up.
    pub filter: CssmFilter,
    /// The last bounce is glossy, too: metal and polish reflect the lit texels, as sharply as those are fine. Costs about as many
    /// more nodes as a reflection has steps of `error`, and 8 bytes a pixel.
    pub glossy: bool,
    /// Where the last bounce is gathered.
    pub receivers: CssmReceivers,
}

/// Where the last bounce from baked texels is gathered.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[reflect(Default)]
pub enum CssmReceivers {
    /// At each pixel: normal maps count, and glossy light.
    #[default]
    Pixels,
    /// At the texels, when something has changed: pixels show what those around them have, smoothly. Fast, as fine as
    /// the atlas, diffuse, without normal maps. What is not baked still gathers at each pixel.
    Texels,
}

/// How baked visibility is looked up.
#[derive(Reflect, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[reflect(Default)]
pub enum CssmFilter {
    /// By one pixel of a cube map.
    #[default]
    Nearest,
    /// Percentage-closer filtering of four: softer edges at up to four times the cost. Of cube maps alone: maps from
    /// outside, which hold the shadows of suns and of other objects, are looked up as ever.
    Pixels,
}

impl CssmSettings {
    /// Sixteen steps, unfiltered, diffuse, at pixels.
    pub const DEFAULT: Self =
        Self { error: 16.0, filter: CssmFilter::Nearest, glossy: false, receivers: CssmReceivers::Pixels };

    /// The same within the documented ranges.
    pub(crate) fn clamped(self) -> Self {
        let error = if self.error.is_finite() { self.error.clamp(0.05, 128.0) } else { Self::DEFAULT.error };
        Self { error, ..self }
    }
}

impl Default for CssmSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
