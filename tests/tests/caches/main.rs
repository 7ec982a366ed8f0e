//! Radiance caches, and light averaged over frames.

mod history;
mod radiance_cache;
