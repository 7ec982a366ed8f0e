//! What the GPU has counted, for measurements.

use bevy::prelude::*;
use bevy::render::render_resource::Buffer;
use bevy_bounce_shaders::types::CacheCounters;

use super::CacheBuffers;
use crate::readback::read;

/// What a view's caches came to in the last frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CacheCounts {
    /// Caches.
    pub caches: u32,
    /// Clusters of pixels that share another one's cache, for want of room.
    pub merged: u32,
    /// Pixels with a surface.
    pub pixels: u32,
    /// Those of them that no cache lights.
    pub missing: u32,
}

/// Counts of every view with radiance caches. Waits for the GPU: for measurements, between frames.
pub fn cache_counts(render_world: &mut World) -> Vec<CacheCounts> {
    let mut views = render_world.query::<&CacheBuffers>();
    let buffers: Vec<Buffer> = views.iter(render_world).map(|held| held.counters.clone()).collect();
    let counted = buffers.iter().filter_map(|buffer| read::<CacheCounters>(render_world, buffer));
    let counts = counted.map(|counted| CacheCounts {
        caches: counted.clusters,
        merged: counted.merged,
        pixels: counted.pixels,
        missing: counted.missing,
    });
    counts.collect()
}
