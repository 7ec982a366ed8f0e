//! Buffers and parameters of a view's caches.

use bevy::prelude::*;
use bevy::render::render_resource::ShaderType;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, Texture, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor, UniformBuffer,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::view::ExtractedView;
use bevy_bounce_shaders::types::{
    CACHE_HEIGHT, CACHE_WIDTH, CACHES_A_ROW, CLUSTER_FACING_BITS, CLUSTER_SLICE_BITS, CacheCounters, CacheGrid,
    RadianceCache,
};

use crate::sort::SortBuffers;
use crate::view::{GiView, ViewTextures};

/// The edge of a tile is a multiple of this, pixels.
const TILE_STEP: u32 = 4;
/// Most slices of depth in a doubling of the distance.
const MOST_SLICES: u32 = 32;
/// Pixels a workgroup of the prefix sum takes.
pub(super) const BLOCK_PIXELS: u32 = 1024;

/// What a view with radiance caches holds; kept from frame to frame, made anew when size or number of caches change.
#[derive(Component)]
pub(crate) struct CacheBuffers {
    /// How its pixels are put together.
    pub parameters: UniformBuffer<CacheGrid>,
    /// Axes of each tile.
    pub frames: Buffer,
    /// Key and pixel.
    pub order: SortBuffers,
    /// Pixels: one word.
    pub pair_count: Buffer,
    /// As [`CacheCounters`].
    pub counters: Buffer,
    /// Clusters of each block of the prefix sum.
    pub blocks: Buffer,
    /// First pixel of each cluster.
    pub starts: Buffer,
    /// Caches of each tile.
    pub ranges: Buffer,
    /// Where each cache is.
    pub caches: Buffer,
    /// Where each was in the last frame.
    pub last: Buffer,
    /// Of each pixel, which of those is kept.
    pub kept: Buffer,
    /// What each cache holds.
    pub atlas: TextureView,
    texture: Texture,
}

/// Size, tiles and slices of a view.
pub(super) fn layout(size: UVec2, capacity: u32, reach: f32, clip_from_view: Mat4) -> CacheGrid {
    let tiles = |tile: u32| size.map(|pixels| pixels.div_ceil(tile));
    let fits = |tile: &u32| tiles(*tile).element_product() <= capacity / 2;
    let tile = (1..).map(|step| step * TILE_STEP).find(fits).unwrap_or(TILE_STEP);
    let orthographic = clip_from_view.w_axis.w == 1.0;
    // Of a tile, over its distance; where the view is orthographic, in world units.
    let across = 2.0 / clip_from_view.y_axis.y.abs().max(1e-6) * tile as f32 / size.y.max(1) as f32;
    let slices = if orthographic {
        let range = 1.0 / clip_from_view.z_axis.z.abs().max(1e-9);
        (range / (2.0 * across)).clamp(1.0, (1 << CLUSTER_SLICE_BITS) as f32)
    } else {
        (std::f32::consts::LN_2 / (2.0 * across).ln_1p()).round().clamp(1.0, MOST_SLICES as f32)
    };
    CacheGrid {
        size,
        tiles: tiles(tile),
        tile,
        capacity,
        slices: slices as u32,
        orthographic: u32::from(orthographic),
        reach,
        ..default()
    }
}

impl CacheBuffers {
    fn new(device: &RenderDevice, parameters: CacheGrid) -> Self {
        let pixels = parameters.size.element_product();
        let tiles = u64::from(parameters.tiles.element_product());
        let capacity = u64::from(parameters.capacity);
        let buffer = |label, size| {
            device.create_buffer(&BufferDescriptor {
                label: Some(label),
                size,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            })
        };
        let texture = device.create_texture(&TextureDescriptor {
            label: Some("bounce_caches"),
            size: Extent3d {
                width: CACHES_A_ROW * CACHE_WIDTH,
                height: parameters.capacity.div_ceil(CACHES_A_ROW) * CACHE_HEIGHT,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: TextureDimension::D2,
            format: TextureFormat::Rgba16Float,
            usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        Self {
            parameters: UniformBuffer::from(parameters),
            frames: buffer("bounce_cache_frames", 4 * tiles),
            order: SortBuffers::new(device, pixels),
            pair_count: buffer("bounce_cache_pixels", 4),
            counters: buffer("bounce_cache_counters", CacheCounters::min_size().get()),
            blocks: buffer("bounce_cache_blocks", 4 * u64::from(pixels.div_ceil(BLOCK_PIXELS))),
            starts: buffer("bounce_cache_starts", 4 * (capacity + 1)),
            ranges: buffer("bounce_cache_ranges", 8 * tiles),
            caches: buffer("bounce_cache_places", capacity * RadianceCache::min_size().get()),
            last: buffer("bounce_cache_last_places", capacity * RadianceCache::min_size().get()),
            kept: buffer("bounce_caches_kept", 4 * u64::from(pixels)),
            atlas: texture.create_view(&TextureViewDescriptor::default()),
            texture,
        }
    }

    /// Bits of the keys that pixels are sorted by.
    pub fn key_bits(&self) -> u32 {
        let tiles = self.parameters.get().tiles.element_product();
        CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS + (u32::BITS - tiles.leading_zeros())
    }

    /// Names and sizes of what is held on the GPU, bytes.
    pub fn bytes(&self) -> [(&'static str, u64); 2] {
        let texels = u64::from(self.texture.width()) * u64::from(self.texture.height());
        let clusters = [&self.frames, &self.pair_count, &self.counters, &self.blocks, &self.starts, &self.ranges];
        let places = [&self.caches, &self.last, &self.kept];
        let bytes: u64 = clusters.iter().chain(&places).map(|buffer| buffer.size()).sum();
        [("radiance cache: clusters", bytes + self.order.bytes()), ("radiance cache: atlas", 8 * texels)]
    }
}

/// Gives every view that uses caches their buffers, and takes them from those that no longer do.
pub(super) fn prepare_caches(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<
        (Entity, Option<&GiView>, Option<&ExtractedView>, Option<&ViewTextures>, Option<&mut CacheBuffers>),
        Or<(With<GiView>, With<CacheBuffers>)>,
    >,
) {
    for (entity, gi, view, textures, held) in &mut views {
        let settings = gi.map(|gi| gi.settings.radiance_cache).filter(|settings| settings.glossy);
        let (Some(settings), Some(view), Some(textures)) = (settings, view, textures) else {
            if held.is_some() {
                commands.entity(entity).remove::<CacheBuffers>();
            }
            continue;
        };
        let capacity = settings.capacity(textures.size);
        let parameters = layout(textures.size, capacity, settings.reach, view.clip_from_view);
        match held {
            Some(mut held) if same_buffers(held.parameters.get(), &parameters) => {
                if *held.parameters.get() != parameters {
                    held.parameters.set(parameters);
                    held.parameters.write_buffer(&device, &queue);
                }
            }
            _ => {
                let mut buffers = CacheBuffers::new(&device, parameters);
                buffers.parameters.write_buffer(&device, &queue);
                commands.entity(entity).insert(buffers);
            }
        }
    }
}

fn same_buffers(a: &CacheGrid, b: &CacheGrid) -> bool {
    (a.size, a.tiles, a.capacity) == (b.size, b.tiles, b.capacity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tile_has_room_for_two_caches() {
        let lens = Mat4::perspective_infinite_reverse_rh(0.7, 1.6, 0.1);
        for size in [UVec2::new(1, 1), UVec2::new(64, 36), UVec2::new(320, 180), UVec2::new(1742, 1145)] {
            for capacity in [1024, 4096] {
                let grid = layout(size, capacity, 2.0, lens);
                assert!(grid.tiles.element_product() <= capacity / 2 && grid.orthographic == 0, "{grid:?}");
                assert!((grid.tiles * grid.tile).cmpge(size).all() && (1..=MOST_SLICES).contains(&grid.slices));
            }
        }
        assert_eq!(layout(UVec2::new(1742, 1145), 4096, 2.0, lens).tile, 32);
    }

    #[test]
    fn orthographic_views_are_sliced_evenly() {
        let lens = Mat4::orthographic_rh(-4.0, 4.0, -4.0, 4.0, 100.0, 0.0);
        let grid = layout(UVec2::new(320, 320), 4096, 2.0, lens);
        assert_eq!((grid.orthographic, grid.tile, grid.slices), (1, 8, 250));
    }
}
