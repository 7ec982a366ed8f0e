//! Radiance caches: what they hold, and whole frames.

mod coverage;
mod light;
mod references;
mod stage;
mod table;
