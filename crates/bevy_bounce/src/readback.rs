//! What the GPU has counted, for measurements.

use std::sync::mpsc;

use bevy::prelude::*;
use bevy::render::render_resource::encase::StorageBuffer;
use bevy::render::render_resource::encase::internal::{CreateFrom, ReadFrom};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, CommandEncoderDescriptor, MapMode, PollType, ShaderType,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// The struct that a buffer holds, which can be copied from. Waits for the GPU: for measurements, between frames.
pub(crate) fn read<T: ShaderType + ReadFrom + CreateFrom>(render_world: &World, buffer: &Buffer) -> Option<T> {
    let device = render_world.get_resource::<RenderDevice>()?;
    let queue = render_world.get_resource::<RenderQueue>()?;
    let staging = device.create_buffer(&BufferDescriptor {
        label: Some("bounce_readback"),
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
    StorageBuffer::new(bytes).create().ok()
}
