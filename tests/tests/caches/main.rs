//! What a frame leaves to the next: radiance caches, and light averaged over frames.

mod history;
mod radiance_cache;
