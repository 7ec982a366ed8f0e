//! The geometry buffer, and where each mesh asset lies in it.
//!
//! Meshes are taken when Bevy extracts them, before `prepare_assets` consumes them: the one moment when the data of meshes
//! that live in the render world alone can be read too. Every mesh asset is kept, used or not, for the same reason.

use std::ops::Range;

use bevy::log::warn;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::mesh::RenderMesh;
use bevy::render::render_asset::ExtractedAssets;
use bevy::render::render_resource::{Buffer, BufferDescriptor, CommandEncoderDescriptor};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::allocator::RangeAllocator;
use super::bounds::Bounds;
use super::lods::Lod;
use super::pack::{PackedMesh, Unusable, pack};
use super::table::{STORAGE_USAGES, buffer_limit};

/// Words the geometry buffer starts with: 1 MiB.
const FIRST_CAPACITY: u32 = 1 << 18;

/// One buffer for all vertices and indices, deformed vertices included.
#[derive(Resource)]
pub(super) struct Geometry {
    /// It grows by being made anew.
    pub buffer: Buffer,
    ranges: RangeAllocator,
    /// Words there may be.
    limit: u32,
    limit_name: &'static str,
    overflowed: bool,
}

impl Geometry {
    /// An empty one.
    pub fn new(device: &RenderDevice) -> Self {
        let (bytes, limit_name) = buffer_limit(device);
        let limit = (bytes / 4).min(u64::from(u32::MAX) - 1) as u32;
        let capacity = FIRST_CAPACITY.min(limit);
        let mut ranges = RangeAllocator::default();
        ranges.grow(capacity);
        Self { buffer: geometry_buffer(device, capacity), ranges, limit, limit_name, overflowed: false }
    }

    /// Bytes in use.
    pub fn used_bytes(&self) -> u64 {
        u64::from(self.ranges.used()) * 4
    }

    /// Room for that many words; grows the buffer where there is none. Beyond the device's limit `None`, with one warning.
    pub fn allocate(&mut self, words: u64, device: &RenderDevice, queue: &RenderQueue) -> Option<Range<u32>> {
        let length = u32::try_from(words).ok();
        let found = length.and_then(|length| {
            self.ranges.allocate(length).or_else(|| {
                self.grow(length, device, queue);
                self.ranges.allocate(length)
            })
        });
        let Some((start, length)) = found.zip(length) else {
            if !self.overflowed {
                self.overflowed = true;
                warn!(
                    "{} more bytes of meshes do not fit the {} of {}, of which {} are in use: what does not fit takes no \
                     part in bounced light",
                    words * 4,
                    u64::from(self.limit) * 4,
                    self.limit_name,
                    self.used_bytes(),
                );
            }
            return None;
        };
        Some(start..start + length)
    }

    /// Gives room back.
    pub fn free(&mut self, range: Range<u32>) {
        self.ranges.free(range);
    }

    /// Uploads words.
    pub fn write(&self, queue: &RenderQueue, offset: u32, words: &[u32]) {
        queue.write_buffer(&self.buffer, u64::from(offset) * 4, bytemuck::cast_slice(words));
    }

    fn grow(&mut self, needed: u32, device: &RenderDevice, queue: &RenderQueue) {
        let held = self.ranges.capacity();
        let wanted = (u64::from(held) * 3 / 2).max(u64::from(held) + u64::from(needed));
        let capacity = wanted.min(u64::from(self.limit)) as u32;
        if u64::from(held) + u64::from(needed) > u64::from(self.limit) {
            return;
        }
        let buffer = geometry_buffer(device, capacity);
        let mut encoder =
            device.create_command_encoder(&CommandEncoderDescriptor { label: Some("bounce_geometry_growth") });
        encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, self.buffer.size());
        queue.submit([encoder.finish()]);
        self.buffer = buffer;
        self.ranges.grow(capacity);
    }
}

fn geometry_buffer(device: &RenderDevice, words: u32) -> Buffer {
    device.create_buffer(&BufferDescriptor {
        label: Some("bounce_geometry"),
        size: u64::from(words) * 4,
        usage: STORAGE_USAGES,
        mapped_at_creation: false,
    })
}

/// A mesh in the geometry buffer; offsets in words from the start of the buffer.
#[derive(Debug)]
pub(super) struct MeshEntry {
    range: Range<u32>,
    /// First vertex.
    pub vertex_offset: u32,
    /// Number of vertices.
    pub vertex_count: u32,
    /// First index.
    pub index_offset: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// The whole mesh, then coarser ones.
    pub lods: Vec<Lod>,
    /// Running sum of the triangles' areas, square local units.
    pub areas: Vec<f32>,
    /// First word of the skin, where there is one.
    pub skin_offset: Option<u32>,
    /// First word of the morph deltas.
    pub morph_offset: u32,
    /// First word of the colours, where there are any.
    pub color_offset: Option<u32>,
    /// Box of the positions, local.
    pub bounds: Bounds,
    /// Whether Bevy's shaders have normals of it.
    pub has_normals: bool,
    /// Box of the vertices that follow a joint, by joint.
    pub joint_bounds: Vec<(u16, Bounds)>,
    /// Box of the deltas, by morph target.
    pub morph_bounds: Vec<Bounds>,
}

impl MeshEntry {
    fn new(range: Range<u32>, packed: PackedMesh) -> Self {
        let start = range.start;
        Self {
            range,
            vertex_offset: start,
            vertex_count: packed.vertex_count,
            index_offset: start + packed.index_offset,
            triangle_count: packed.triangle_count,
            lods: packed.lods.iter().map(|lod| Lod { index_offset: start + lod.index_offset, ..*lod }).collect(),
            areas: packed.areas,
            skin_offset: packed.skin_offset.map(|offset| start + offset),
            morph_offset: start + packed.morph_offset,
            color_offset: packed.color_offset.map(|offset| start + offset),
            bounds: packed.bounds,
            has_normals: packed.has_normals,
            joint_bounds: packed.joint_bounds,
            morph_bounds: packed.morph_bounds,
        }
    }
}

/// All mesh assets with triangles.
#[derive(Resource, Default)]
pub(super) struct Meshes {
    entries: HashMap<AssetId<Mesh>, MeshEntry>,
    changed: HashSet<AssetId<Mesh>>,
}

impl Meshes {
    /// Where a mesh lies.
    pub fn get(&self, id: AssetId<Mesh>) -> Option<&MeshEntry> {
        self.entries.get(&id)
    }

    /// Those that came, changed or went since the last call.
    pub fn take_changed(&mut self) -> HashSet<AssetId<Mesh>> {
        std::mem::take(&mut self.changed)
    }
}

/// Takes the meshes that Bevy extracted this frame. Before `prepare_assets::<RenderMesh>`, which consumes them.
pub(super) fn collect_meshes(
    mut meshes: ResMut<Meshes>,
    mut geometry: ResMut<Geometry>,
    extracted: Res<ExtractedAssets<RenderMesh>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
) {
    let meshes = &mut *meshes;
    for id in &extracted.removed {
        if let Some(entry) = meshes.entries.remove(id) {
            geometry.free(entry.range);
            meshes.changed.insert(*id);
        }
    }
    let mut arrived: Vec<_> = extracted.extracted.iter().collect();
    arrived.sort_by_key(|(id, _)| *id);
    for (id, mesh) in arrived {
        meshes.changed.insert(*id);
        if let Some(entry) = meshes.entries.remove(id) {
            geometry.free(entry.range);
        }
        match pack(mesh) {
            Ok(packed) => {
                if let Some(range) = geometry.allocate(packed.words.len() as u64, &device, &queue) {
                    geometry.write(&queue, range.start, &packed.words);
                    meshes.entries.insert(*id, MeshEntry::new(range, packed));
                }
            }
            Err(Unusable::NoTriangles) => {}
            Err(Unusable::NoPositions) => warn!(
                "{id:?} takes no part in bounced light: its positions are missing or not three 32-bit floats a vertex"
            ),
        }
    }
}
