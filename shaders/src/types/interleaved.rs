//! Interleaved shading.

/// Texels of bounded light from the middle of the tent that joins its subsets to where it ends.
pub const TENT_REACH: u32 = 4;
