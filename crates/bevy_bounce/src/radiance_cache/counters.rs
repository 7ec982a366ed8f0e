//! What the GPU has counted, for measurements.

use std::sync::mpsc;

use bevy::prelude::*;
use bevy::render::render_resource::encase::StorageBuffer;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_bounce_shaders::types::CacheCounters;

use super::CacheBuffers;

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
    let (Some(device), Some(queue)) =
        (render_world.get_resource::<RenderDevice>(), render_world.get_resource::<RenderQueue>())
    else {
        return Vec::new();
    };
    buffers.iter().filter_map(|buffer| read(device, queue, buffer)).collect()
}

fn read(device: &RenderDevice, queue: &RenderQueue, buffer: &Buffer) -> Option<CacheCounts> {
    let staging = device.create_buffer(&BufferDescriptor {
        label: Some("bounce_cache_counts"),
        size: buffer.size(),
        usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
    queue.submit([encoder.finish()]);
    let slice = staging.slice(..);
    let (sender, receiver) = mpsc::channel();
    slice.map_async(MapMode::Read, move |result| drop(sender.send(result)));
    device.poll(PollType::wait_indefinitely()).ok()?;
    receiver.recv().ok()?.ok()?;
    let bytes = slice.get_mapped_range().to_vec();
    let counted: CacheCounters = StorageBuffer::new(bytes).create().ok()?;
    Some(CacheCounts {
        caches: counted.clusters,
        merged: counted.merged,
        pixels: counted.pixels,
        missing: counted.missing,
    })
}
