//! Radiance caches: which clusters of pixels there are, what caches hold, and whole frames.

mod clusters;
mod light;
mod stage;
