//! What is told while the work goes on.

use std::fmt;

/// A part of the work that takes its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Charts are flattened; counts triangles.
    Unwrapping,
    /// Charts are given places in the atlas; counts tries, of which nobody knows how many it takes.
    Packing,
    /// Cube maps are cast and encoded; counts them.
    Casting,
    /// Maps from outside are cast and encoded; counts them.
    Outside,
    /// Texels of a lightmap find what lights them; counts them.
    Linking,
    /// Light goes from texel to texel; counts bounces, of which nobody knows how many it takes.
    Bouncing,
    /// Texels of a lightmap are lit; counts them.
    Gathering,
    /// Probes of an irradiance volume are lit; counts them.
    Probing,
}

impl fmt::Display for Step {
    /// What is counted, in the plural.
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(match self {
            Self::Unwrapping => "triangles unwrapped",
            Self::Packing => "packings tried",
            Self::Casting => "depth maps",
            Self::Outside => "maps from outside",
            Self::Linking => "texels linked",
            Self::Bouncing => "bounces",
            Self::Gathering => "texels lit",
            Self::Probing => "probes lit",
        })
    }
}

/// Whom to tell how far the work is.
pub trait Progress: Sync {
    /// `done` of `total` are done in this step. Called on any thread, also from several at once; steps follow each other.
    fn report(&self, step: Step, done: usize, total: Option<usize>);
}

/// Tells nobody.
impl Progress for () {
    fn report(&self, _: Step, _: usize, _: Option<usize>) {}
}
