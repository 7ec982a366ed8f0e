//! An array on the GPU with its copy on the CPU: only what changed is uploaded.

use std::ops::Range;

use bevy::log::warn;
use bevy::render::render_resource::encase::StorageBuffer;
use bevy::render::render_resource::encase::internal::WriteInto;
use bevy::render::render_resource::{Buffer, BufferDescriptor, BufferUsages, ShaderSize, ShaderType};
use bevy::render::renderer::{RenderDevice, RenderQueue};

/// Usage of every storage buffer of the scene.
pub(super) const STORAGE_USAGES: BufferUsages =
    BufferUsages::STORAGE.union(BufferUsages::COPY_DST).union(BufferUsages::COPY_SRC);

/// Bytes a storage buffer of the scene may have on this device, and the name of the limit.
pub(super) fn buffer_limit(device: &RenderDevice) -> (u64, &'static str) {
    let limits = device.limits();
    let binding = limits.max_storage_buffer_binding_size;
    if binding <= limits.max_buffer_size {
        (binding, "max_storage_buffer_binding_size")
    } else {
        (limits.max_buffer_size, "max_buffer_size")
    }
}

/// See the module.
pub(super) struct GpuTable<T> {
    label: &'static str,
    values: Vec<T>,
    dirty: Range<usize>,
    buffer: Option<Buffer>,
    spare: usize,
    overflowed: bool,
}

impl<T> GpuTable<T>
where
    T: ShaderType + ShaderSize + WriteInto + Copy + Default + PartialEq,
{
    /// An empty table; its buffer gets that label.
    pub fn new(label: &'static str) -> Self {
        Self { label, values: Vec::new(), dirty: 0..0, buffer: None, spare: 0, overflowed: false }
    }

    /// The values as they are or will be on the GPU.
    pub fn values(&self) -> &[T] {
        &self.values
    }

    /// Bytes of one element.
    pub fn stride() -> u64 {
        T::SHADER_SIZE.get()
    }

    /// Sets an element, growing the table to hold it.
    pub fn set(&mut self, index: usize, value: T) {
        if index >= self.values.len() {
            let first_new = self.values.len();
            self.values.resize(index + 1, T::default());
            self.mark(first_new);
            self.mark(index);
        }
        if self.values[index] != value {
            self.values[index] = value;
            self.mark(index);
        }
    }

    /// Makes the table those values.
    pub fn replace(&mut self, values: impl Iterator<Item = T>) {
        let mut count = 0;
        for value in values {
            self.set(count, value);
            count += 1;
        }
        self.values.truncate(count);
        self.dirty.end = self.dirty.end.min(count);
        self.dirty.start = self.dirty.start.min(self.dirty.end);
    }

    /// Keeps room behind the values for so many that the GPU itself writes. A buffer that grows for it loses those it held.
    pub fn reserve(&mut self, spare: usize) {
        self.spare = spare;
    }

    /// Whether something is to be uploaded.
    pub fn is_dirty(&self) -> bool {
        !self.dirty.is_empty()
    }

    fn mark(&mut self, index: usize) {
        if self.dirty.is_empty() {
            self.dirty = index..index + 1;
        } else {
            self.dirty = self.dirty.start.min(index)..self.dirty.end.max(index + 1);
        }
    }

    /// Uploads what changed. True where the buffer is a new one. What the device has no room for is cut off, with one
    /// warning.
    pub fn upload(&mut self, device: &RenderDevice, queue: &RenderQueue) -> bool {
        let (limit, limit_name) = buffer_limit(device);
        let limit = ((limit / Self::stride()) as usize).saturating_sub(self.spare);
        if self.values.len() > limit {
            if !self.overflowed {
                self.overflowed = true;
                warn!(
                    "{}: {} elements do not fit the {limit} of {limit_name}: the rest does not take part",
                    self.label,
                    self.values.len(),
                );
            }
            self.values.truncate(limit);
            self.dirty.end = self.dirty.end.min(limit);
        }
        let held = self.buffer.as_ref().map_or(0, |buffer| (buffer.size() / Self::stride()) as usize);
        let needed = self.values.len() + self.spare;
        let grown = held < needed.max(1);
        if grown {
            let capacity = needed.max(held + held / 2).max(16).min((limit + self.spare).max(1));
            self.buffer = Some(device.create_buffer(&BufferDescriptor {
                label: Some(self.label),
                size: capacity as u64 * Self::stride(),
                usage: STORAGE_USAGES,
                mapped_at_creation: false,
            }));
            self.dirty = 0..self.values.len();
        }
        let dirty = std::mem::take(&mut self.dirty);
        if let Some(buffer) = &self.buffer
            && let Some(changed) = self.values.get(dirty.clone())
            && !changed.is_empty()
        {
            let mut bytes = StorageBuffer::new(Vec::with_capacity(changed.len() * Self::stride() as usize));
            match bytes.write(changed) {
                Ok(()) => queue.write_buffer(buffer, dirty.start as u64 * Self::stride(), bytes.as_ref()),
                Err(error) => warn!("{}: {error}", self.label),
            }
        }
        grown
    }

    /// The buffer, once something was uploaded.
    pub fn buffer(&self) -> Option<&Buffer> {
        self.buffer.as_ref()
    }

    /// Forgets the buffer: the device it was made on is gone.
    pub fn lose_buffer(&mut self) {
        self.buffer = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changes_are_dirty() {
        let mut table = GpuTable::<u32>::new("test");
        table.set(3, 7);
        assert_eq!(table.values(), [0, 0, 0, 7]);
        table.dirty = 0..0;
        table.set(2, 0);
        assert!(table.dirty.is_empty());
        table.set(1, 5);
        table.set(2, 6);
        assert_eq!(table.dirty, 1..3);
        table.replace([0, 5].into_iter());
        assert_eq!((table.values(), table.dirty.clone()), (&[0, 5][..], 1..2));
    }
}
