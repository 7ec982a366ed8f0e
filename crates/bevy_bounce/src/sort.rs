//! Stable sort of (key, value) pairs on the GPU: `sort/radix.wgsl`. The same order from run to run.

use bevy::prelude::*;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer_sized,
};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferInitDescriptor, BufferUsages, CommandEncoder, PipelineCache,
};
use bevy::render::renderer::RenderDevice;
use bevy_bounce_shaders::types::SORT_BLOCK;

use crate::compute::{GiShaders, Kernel, KernelDescriptor, are_ready, whole};

/// Bits a pass sorts by.
const DIGIT_BITS: u32 = 8;

/// Bytes of a pair.
const PAIR: u64 = 8;

/// Kernels in the order they run.
#[derive(Resource)]
pub(crate) struct SortPipelines {
    count: Kernel,
    scan: Kernel,
    scatter: Kernel,
    /// One [`bevy_bounce_shaders::types::Digit`] a pass.
    digits: [Buffer; 4],
}

pub(crate) fn init_sort_pipelines(mut commands: Commands, device: Res<RenderDevice>, shaders: Res<GiShaders>) {
    let read = storage_buffer_read_only_sized(false, None);
    let write = storage_buffer_sized(false, None);
    // Digit; pair count, unsorted; sorted, counts.
    let bindings = [uniform_buffer_sized(false, None), read, read, write, write];
    let kernel = |entry| {
        let path = "sort/radix.wgsl";
        let descriptor = KernelDescriptor { path, entry, bindings: &bindings, groups: &[], defs: vec![] };
        Kernel::new(&shaders, descriptor)
    };
    let digit = |pass: usize| {
        device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bounce_sort_digit"),
            contents: &(pass as u32 * DIGIT_BITS).to_ne_bytes(),
            usage: BufferUsages::UNIFORM,
        })
    };
    commands.insert_resource(SortPipelines {
        count: kernel("count_digits"),
        scan: kernel("scan_digits"),
        scatter: kernel("scatter"),
        digits: std::array::from_fn(digit),
    });
}

impl SortPipelines {
    /// Whether all are compiled.
    pub fn are_ready(&self, cache: &PipelineCache) -> bool {
        are_ready([&self.count, &self.scan, &self.scatter], cache)
    }
}

/// Pairs of two words, key and value.
pub(crate) struct SortBuffers {
    pairs: [Buffer; 2],
    counts: Buffer,
    capacity: u32,
}

impl SortBuffers {
    /// Room for that many pairs.
    pub fn new(device: &RenderDevice, capacity: u32) -> Self {
        let storage = |label, size| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let pairs = || storage("bounce_sort_pairs", u64::from(capacity.max(1)) * PAIR);
        let blocks = u64::from(capacity.div_ceil(SORT_BLOCK).max(1));
        Self { pairs: [pairs(), pairs()], counts: storage("bounce_sort_counts", (blocks * 4) << DIGIT_BITS), capacity }
    }

    /// What is to be sorted.
    pub fn pairs(&self) -> &Buffer {
        &self.pairs[0]
    }

    /// Where the pairs are after a sort by that many bits.
    pub fn sorted(&self, bits: u32) -> &Buffer {
        &self.pairs[(bits.div_ceil(DIGIT_BITS) % 2) as usize]
    }

    /// Bytes held on the GPU.
    pub fn bytes(&self) -> u64 {
        self.pairs.iter().chain([&self.counts]).map(|buffer| buffer.size()).sum()
    }
}

impl SortPipelines {
    /// Sorts by the lowest `bits` of the key, at most 32. `count`: pairs, in its first word.
    pub fn sort(
        &self,
        device: &RenderDevice,
        encoder: &mut CommandEncoder,
        cache: &PipelineCache,
        buffers: &SortBuffers,
        count: &Buffer,
        bits: u32,
    ) {
        let blocks = UVec3::new(buffers.capacity.div_ceil(SORT_BLOCK), 1, 1);
        for (pass, digit) in self.digits.iter().take(bits.div_ceil(DIGIT_BITS) as usize).enumerate() {
            let [unsorted, sorted] = [pass % 2, (pass + 1) % 2].map(|i| &buffers.pairs[i]);
            let group = self.count.bind(
                device,
                cache,
                &[whole(digit), whole(count), whole(unsorted), whole(sorted), whole(&buffers.counts)],
            );
            self.count.dispatch(encoder, cache, &[&group], blocks);
            self.scan.dispatch(encoder, cache, &[&group], UVec3::ONE);
            self.scatter.dispatch(encoder, cache, &[&group], blocks);
        }
    }
}
