//! Radiance caches: which clusters of pixels there are, what caches hold, and whole frames.

mod clusters;
mod coverage;
mod light;
mod stage;
mod table;
