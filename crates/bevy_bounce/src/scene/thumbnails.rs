//! Textures as 16x16 means, so that a large textured wall is not one colour.
//!
//! A thumbnail is 256 words of one buffer, made on the GPU by `scene/thumbnail.wgsl` when the texture arrives or
//! changes: base colour, or the emissive texture. Of masked textures alpha is the share of the texels that are there.
//! Any two-dimensional texture that can be read as floats will do, whatever its compression. What is above 1 in an
//! emissive texture counts as 1. Beyond its edges a texture goes on as its sampler says; a border's colour counts as
//! that of the edge.

use std::collections::{BTreeMap, BTreeSet};

use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::render_asset::{ExtractedAssets, RenderAssets};
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, CommandEncoderDescriptor, PipelineCache, TextureDimension, TextureSampleType,
    TextureViewDimension,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use bevy_bounce_shaders::types::{THUMBNAIL_SIZE, ThumbnailJob, WRAP_BITS, WRAP_CLAMP, WRAP_MIRROR, WRAP_REPEAT};

use super::allocator::SlotAllocator;
use super::passes::ScenePipelines;
use super::table::{STORAGE_USAGES, buffer_limit};

/// Words of a thumbnail.
const WORDS: u32 = THUMBNAIL_SIZE * THUMBNAIL_SIZE;

/// What a thumbnail is made from.
#[derive(Clone, Copy, Debug, Hash, PartialEq, Eq)]
pub(super) struct ThumbnailKey {
    /// Its colours.
    pub image: AssetId<Image>,
    /// Alpha, in 255ths, from which a texel is there; 0 where all are.
    pub cutoff: u8,
}

/// What a material gets for a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Thumbnail {
    /// Its image is not loaded yet.
    Pending,
    /// The image has no two-dimensional colours, or there is no room: the material goes without.
    None,
    /// First word in the buffer, and how the texture goes on beyond its edges: as in
    /// [`Material::albedo_thumbnail`](bevy_bounce_shaders::types::Material::albedo_thumbnail).
    At(u32),
}

struct Entry {
    slot: u32,
    users: u32,
    state: Thumbnail,
}

/// A thumbnail that is made this frame.
pub(super) struct QueuedThumbnail {
    /// From these.
    pub key: ThumbnailKey,
    /// What materials get for it.
    pub at: u32,
    /// Like this.
    pub job: ThumbnailJob,
}

/// All thumbnails in use.
#[derive(Resource)]
pub(super) struct Thumbnails {
    /// It grows by being made anew.
    pub buffer: Buffer,
    /// For the pass.
    pub queue: Vec<QueuedThumbnail>,
    slots: SlotAllocator,
    entries: HashMap<ThumbnailKey, Entry>,
    by_slot: BTreeMap<u32, ThumbnailKey>,
    wanted: BTreeSet<u32>,
    settled: bool,
    limit: u32,
    limit_name: &'static str,
    overflowed: bool,
}

impl Thumbnails {
    /// An empty one.
    pub fn new(device: &RenderDevice) -> Self {
        let (bytes, limit_name) = buffer_limit(device);
        Self {
            buffer: thumbnail_buffer(device, 4),
            queue: Vec::new(),
            slots: SlotAllocator::default(),
            entries: HashMap::default(),
            by_slot: BTreeMap::new(),
            wanted: BTreeSet::new(),
            settled: false,
            limit: (bytes / (u64::from(WORDS) * 4)) as u32,
            limit_name,
            overflowed: false,
        }
    }

    /// One more user of a thumbnail.
    pub fn acquire(&mut self, key: ThumbnailKey) {
        if let Some(entry) = self.entries.get_mut(&key) {
            entry.users += 1;
            return;
        }
        let Some(slot) = self.slots.allocate(self.limit) else {
            if !self.overflowed {
                self.overflowed = true;
                warn!("more than the {} textures of {}: the rest counts as white", self.limit, self.limit_name);
            }
            return;
        };
        self.entries.insert(key, Entry { slot, users: 1, state: Thumbnail::Pending });
        self.by_slot.insert(slot, key);
        self.wanted.insert(slot);
    }

    /// One user less.
    pub fn release(&mut self, key: ThumbnailKey) {
        let Some(entry) = self.entries.get_mut(&key) else { return };
        entry.users -= 1;
        if entry.users == 0 {
            let slot = entry.slot;
            self.entries.remove(&key);
            self.by_slot.remove(&slot);
            self.wanted.remove(&slot);
            self.slots.free(slot);
        }
    }

    /// What there is for a key.
    pub fn get(&self, key: ThumbnailKey) -> Thumbnail {
        self.entries.get(&key).map_or(Thumbnail::None, |entry| entry.state)
    }

    /// Whether the answer of [`Thumbnails::get`] is another one for some key than at the last call.
    pub fn take_settled(&mut self) -> bool {
        std::mem::take(&mut self.settled)
    }

    fn grow(&mut self, slots: u32, device: &RenderDevice, queue: &RenderQueue) {
        let held = (self.buffer.size() / (u64::from(WORDS) * 4)) as u32;
        if slots <= held {
            return;
        }
        let buffer = thumbnail_buffer(device, slots.max(held + held / 2).min(self.limit));
        let mut encoder =
            device.create_command_encoder(&CommandEncoderDescriptor { label: Some("bounce_thumbnail_growth") });
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, self.buffer.size());
        queue.submit([encoder.finish()]);
        self.buffer = buffer;
    }
}

fn thumbnail_buffer(device: &RenderDevice, slots: u32) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some("bounce_thumbnails"),
        size: u64::from(slots) * u64::from(WORDS) * 4,
        usage: STORAGE_USAGES,
        mapped_at_creation: false,
    })
}

/// How textures go on beyond their edges. Outlives the device.
#[derive(Resource)]
pub(super) struct Wraps {
    /// Where the image does not say.
    default: u32,
    /// Of images that do not repeat.
    by_image: HashMap<AssetId<Image>, u32>,
}

impl Default for Wraps {
    fn default() -> Self {
        Self::new(&ImageSamplerDescriptor::default())
    }
}

impl Wraps {
    /// Of images without a sampler of their own that of the plugin counts.
    pub fn new(default: &ImageSamplerDescriptor) -> Self {
        Self { default: wrap(default), by_image: HashMap::default() }
    }

    fn get(&self, image: AssetId<Image>) -> u32 {
        self.by_image.get(&image).copied().unwrap_or(WRAP_REPEAT)
    }

    fn insert(&mut self, id: AssetId<Image>, image: &Image) {
        let wrap = match &image.sampler {
            ImageSampler::Default => self.default,
            ImageSampler::Descriptor(sampler) => wrap(sampler),
        };
        if wrap == WRAP_REPEAT {
            self.by_image.remove(&id);
        } else {
            self.by_image.insert(id, wrap);
        }
    }
}

/// Of both axes.
fn wrap(sampler: &ImageSamplerDescriptor) -> u32 {
    let axis = |mode| match mode {
        ImageAddressMode::ClampToEdge | ImageAddressMode::ClampToBorder => WRAP_CLAMP,
        ImageAddressMode::Repeat => WRAP_REPEAT,
        ImageAddressMode::MirrorRepeat => WRAP_MIRROR,
    };
    axis(sampler.address_mode_u) | axis(sampler.address_mode_v) << WRAP_BITS
}

/// Notes the images that arrive, change or go. Before `prepare_assets::<GpuImage>`, which forgets them.
pub(super) fn collect_images(
    mut thumbnails: ResMut<Thumbnails>,
    mut wraps: ResMut<Wraps>,
    extracted: Res<ExtractedAssets<GpuImage>>,
) {
    for id in &extracted.removed {
        wraps.by_image.remove(id);
    }
    for (id, image) in &extracted.extracted {
        wraps.insert(*id, image);
    }
    if extracted.added.is_empty() {
        return;
    }
    let thumbnails = &mut *thumbnails;
    for (slot, key) in &thumbnails.by_slot {
        if extracted.added.contains(&key.image) {
            thumbnails.wanted.insert(*slot);
        }
    }
}

/// Whether the shader can read it.
fn is_readable(image: &GpuImage) -> bool {
    let texture = &image.texture_descriptor;
    let view = image.texture_view_descriptor.as_ref();
    let flat = view.and_then(|view| view.dimension).is_none_or(|dimension| dimension == TextureViewDimension::D2);
    let format = view.and_then(|view| view.format).unwrap_or(texture.format);
    texture.dimension == TextureDimension::D2
        && texture.size.depth_or_array_layers == 1
        && texture.sample_count == 1
        && flat
        && !format.is_depth_stencil_format()
        && matches!(format.sample_type(None, None), Some(TextureSampleType::Float { .. }))
}

/// Queues the thumbnails whose image is there.
pub(super) fn update_thumbnails(
    mut thumbnails: ResMut<Thumbnails>,
    wraps: Res<Wraps>,
    images: Res<RenderAssets<GpuImage>>,
    pipelines: Res<ScenePipelines>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let thumbnails = &mut *thumbnails;
    thumbnails.queue.clear();
    if thumbnails.wanted.is_empty() || !pipelines.thumbnail.is_ready(&cache) {
        return;
    }
    let slots = thumbnails.wanted.last().map_or(0, |slot| slot + 1);
    thumbnails.grow(slots, &device, &queue);
    for slot in std::mem::take(&mut thumbnails.wanted) {
        let Some(&key) = thumbnails.by_slot.get(&slot) else { continue };
        let Some(entry) = thumbnails.entries.get_mut(&key) else { continue };
        let Some(image) = images.get(key.image) else {
            thumbnails.wanted.insert(slot);
            continue;
        };
        let readable = is_readable(image);
        let offset = slot * WORDS;
        let at = offset | wraps.get(key.image);
        let state = if readable { Thumbnail::At(at) } else { Thumbnail::None };
        thumbnails.settled |= entry.state != state;
        entry.state = state;
        if readable {
            let mip_levels = image.texture.mip_level_count();
            let job = ThumbnailJob { offset, cutoff: u32::from(key.cutoff), mip_levels, padding: 0 };
            thumbnails.queue.push(QueuedThumbnail { key, at, job });
        }
    }
}
