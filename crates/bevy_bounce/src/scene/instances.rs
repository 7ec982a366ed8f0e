//! The instances on the GPU, the chunks that cover their triangles, and the box round them.
//!
//! An instance keeps its slot from spawn to despawn; one that does not take part has no triangles. It takes part where
//!
//! - its `InheritedVisibility` is true: what is hidden neither reflects nor blocks;
//! - the nearest camera with global illumination is within its `VisibilityRange`, so that one level of detail counts;
//! - it shares a `RenderLayers` layer with some camera with global illumination;
//! - it is not `VoxelizedMesh::OFF`;
//! - mesh and material are there, and light does not pass the material;
//! - it is lit, or casts shadows: what is `unlit` can only block, and `NotShadowCaster` says that it does not, as of skies and bulbs;
//! - its transform is finite and keeps a volume.
//!
//! Of materials of several kinds on one mesh, as while a game replaces one, the last kind to come counts, and with its end that before.

use std::any::TypeId;
use std::collections::BTreeSet;

use bevy::camera::visibility::RenderLayers;
use bevy::ecs::entity::EntityHashMap;
use bevy::log::warn;
use bevy::math::Affine3A;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy_bounce_shaders::types::{CHUNK_TRIANGLES, Chunk, INSTANCE_FLIPPED, INSTANCE_TWO_SIDED, Instance, NONE};

use super::allocator::SlotAllocator;
use super::bounds::Bounds;
use super::deform::{Shape, rows};
use super::extract::{ExtractedInstance, ExtractedInstances, SceneCameras, spawn_order};
use super::materials::Materials;
use super::meshes::{Geometry, Meshes};
use super::table::{GpuTable, buffer_limit};

struct Record {
    source: ExtractedInstance,
    shape: Shape,
    bounds: Bounds,
    emits: bool,
}

/// See the module.
#[derive(Resource)]
pub(crate) struct Instances {
    /// By slot.
    pub(super) table: GpuTable<Instance>,
    /// Of all instances, in the order of their slots; those of groups with a grid of their own last.
    pub(super) chunks: GpuTable<Chunk>,
    /// Of those whose material emits.
    pub(super) emissive_chunks: GpuTable<Chunk>,
    /// How many of both are voxelised with the world.
    pub(super) world_chunks: [u32; 2],
    /// Slots of those in groups with a grid of their own.
    grouped: BTreeSet<u32>,
    chunks_are_stale: bool,
    meshes_changed: HashSet<AssetId<Mesh>>,
    generation: u32,
    slots: SlotAllocator,
    by_entity: HashMap<Entity, u32>,
    records: Vec<Option<Record>>,
    /// What entities are by materials of further kinds, one of each.
    spare: EntityHashMap<Vec<ExtractedInstance>>,
    dirty: BTreeSet<u32>,
    layers: RenderLayers,
    bounds: Bounds,
    overflowed: bool,
    warned_transform: bool,
    warned_normals: bool,
}

impl Default for Instances {
    fn default() -> Self {
        Self {
            table: GpuTable::new("bounce_instances"),
            chunks: GpuTable::new("bounce_chunks"),
            emissive_chunks: GpuTable::new("bounce_emissive_chunks"),
            world_chunks: [0; 2],
            grouped: BTreeSet::new(),
            chunks_are_stale: false,
            meshes_changed: HashSet::default(),
            generation: 0,
            slots: SlotAllocator::default(),
            by_entity: HashMap::default(),
            records: Vec::new(),
            spare: EntityHashMap::default(),
            dirty: BTreeSet::new(),
            layers: RenderLayers::default(),
            bounds: Bounds::EMPTY,
            overflowed: false,
            warned_transform: false,
            warned_normals: false,
        }
    }
}

impl Instances {
    /// Box of all that takes part.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Counts the times that the triangles taking part were others than before.
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// Where an entity's instance is, its material and its first index.
    pub fn look(&self, entity: Entity) -> Option<[u32; 3]> {
        let slot = *self.by_entity.get(&entity)?;
        let instance = self.table.values().get(slot as usize)?;
        Some([slot, instance.material, instance.index_offset])
    }

    /// Slot, mesh and box of those that take part, by slot.
    pub fn present(&self) -> impl Iterator<Item = (u32, AssetId<Mesh>, Bounds)> {
        (0u32..)
            .zip(self.table.values())
            .zip(&self.records)
            .filter(|((_, instance), _)| instance.triangle_count > 0)
            .filter_map(|((slot, _), record)| record.as_ref().map(|record| (slot, record.source.mesh, record.bounds)))
    }

    /// The device the buffers were made on is gone.
    pub fn lose_buffers(&mut self) {
        self.table.lose_buffer();
        self.chunks.lose_buffer();
        self.emissive_chunks.lose_buffer();
        for record in self.records.iter_mut().flatten() {
            record.shape = Shape::of(&record.source);
        }
        self.mark_where(|_| true);
    }

    /// What is known of an entity that may bend: slot, shape, mesh and transform.
    pub(super) fn shape_mut(&mut self, entity: Entity) -> Option<(u32, &mut Shape, AssetId<Mesh>, Affine3A)> {
        let slot = *self.by_entity.get(&entity)?;
        let record = self.records.get_mut(slot as usize)?.as_mut()?;
        Some((slot, &mut record.shape, record.source.mesh, record.source.transform))
    }

    /// Writes an instance anew.
    pub fn mark(&mut self, slot: u32) {
        self.dirty.insert(slot);
    }

    fn insert(&mut self, source: ExtractedInstance, geometry: &mut Geometry, limit: u32) {
        let entity = source.entity;
        let slot = match self.by_entity.get(&entity) {
            Some(&slot) => slot,
            None => {
                let Some(slot) = self.slots.allocate(limit) else {
                    if !self.overflowed {
                        self.overflowed = true;
                        warn!("more than {limit} meshes: the rest takes no part in bounced light");
                    }
                    return;
                };
                self.by_entity.insert(entity, slot);
                if self.records.len() <= slot as usize {
                    self.records.resize_with(slot as usize + 1, || None);
                }
                slot
            }
        };
        let record = self.records[slot as usize].as_ref();
        if let Some(shown) = record.map(|record| &record.source).filter(|shown| shown.kind() != source.kind()) {
            let spare = self.spare.entry(entity).or_default();
            if let Some(known) = spare.iter_mut().find(|known| known.kind() == source.kind()) {
                *known = source;
                return;
            }
            spare.push(shown.clone());
        }
        self.dirty.insert(slot);
        let before = self.records[slot as usize].take();
        let (emits, bounds) = before.as_ref().map_or((false, Bounds::EMPTY), |record| (record.emits, record.bounds));
        let shape = match before {
            Some(record) if record.source.deforms == source.deforms && record.source.mesh == source.mesh => {
                record.shape
            }
            before => {
                if let Some(record) = before {
                    record.shape.free(geometry);
                }
                Shape::of(&source)
            }
        };
        self.records[slot as usize] = Some(Record { source, shape, bounds, emits });
    }

    /// Forgets what an entity is by a material of that kind.
    fn remove(&mut self, entity: Entity, kind: TypeId, geometry: &mut Geometry, limit: u32) {
        let Some(slot) = self.by_entity.get(&entity).copied() else { return };
        let Some(record) = self.records[slot as usize].take_if(|record| record.source.kind() == kind) else {
            if let Some(spare) = self.spare.get_mut(&entity) {
                spare.retain(|source| source.kind() != kind);
            }
            return;
        };
        record.shape.free(geometry);
        self.by_entity.remove(&entity);
        self.slots.free(slot);
        self.dirty.insert(slot);
        if let Some(mut spare) = self.spare.remove(&entity)
            && let Some(source) = spare.pop()
        {
            self.insert(source, geometry, limit);
            self.spare.insert(entity, spare);
        }
    }

    /// The mesh assets of these are others than before.
    fn meshes_changed(&mut self, changed: &HashSet<AssetId<Mesh>>, geometry: &mut Geometry) {
        for (slot, record) in (0u32..).zip(&mut self.records) {
            if let Some(record) = record.as_mut().filter(|record| changed.contains(&record.source.mesh)) {
                std::mem::replace(&mut record.shape, Shape::of(&record.source)).free(geometry);
                self.dirty.insert(slot);
            }
        }
    }

    fn mark_where(&mut self, changed: impl Fn(&ExtractedInstance) -> bool) {
        for (slot, record) in (0u32..).zip(&self.records) {
            if record.as_ref().is_some_and(|record| changed(&record.source)) {
                self.dirty.insert(slot);
            }
        }
    }

    /// What a group's grid needs to know of an entity that is rigid and takes part: slot, mesh, instance, and whether it emits.
    pub(super) fn rigid(&self, entity: Entity) -> Option<(u32, AssetId<Mesh>, &Instance, bool)> {
        let slot = *self.by_entity.get(&entity)?;
        let instance = self.table.values().get(slot as usize)?;
        let record = self.records.get(slot as usize)?.as_ref()?;
        let is_rigid = instance.triangle_count > 0 && instance.deformed_offset == NONE;
        is_rigid.then_some((slot, record.source.mesh, instance, record.emits))
    }

    /// Meshes that are others than in the last frame.
    pub(super) fn meshes_changed_now(&self) -> &HashSet<AssetId<Mesh>> {
        &self.meshes_changed
    }

    /// Says which instances are in groups with a grid of their own, and puts the chunks in order.
    pub(super) fn set_grouped(&mut self, grouped: BTreeSet<u32>) {
        if self.grouped != grouped {
            self.grouped = grouped;
            self.chunks_are_stale = true;
        }
        if std::mem::take(&mut self.chunks_are_stale) {
            self.rebuild_chunks();
        }
    }

    fn rebuild_chunks(&mut self) {
        let (table, records, grouped) = (self.table.values(), &self.records, &self.grouped);
        let chunks = |emissive_only: bool, in_group: bool| {
            (0u32..)
                .zip(table)
                .zip(records)
                .filter(move |(_, record)| !emissive_only || record.as_ref().is_some_and(|record| record.emits))
                .filter(move |((slot, _), _)| grouped.contains(slot) == in_group)
                .flat_map(|((slot, instance), _)| chunks_of(slot, instance.triangle_count))
        };
        self.world_chunks = [false, true].map(|emissive_only| chunks(emissive_only, false).count() as u32);
        self.chunks.replace(chunks(false, false).chain(chunks(false, true)));
        self.emissive_chunks.replace(chunks(true, false).chain(chunks(true, true)));
    }
}

pub(super) fn chunks_of(instance: u32, triangle_count: u32) -> impl Iterator<Item = Chunk> {
    (0..triangle_count).step_by(CHUNK_TRIANGLES as usize).map(move |first_triangle| Chunk { instance, first_triangle })
}

/// Whether a transform keeps what it moves in three dimensions, with numbers a GPU can take.
pub(super) fn is_sound(transform: &Affine3A) -> bool {
    let determinant = transform.matrix3.determinant();
    transform.is_finite() && determinant.is_finite() && determinant != 0.0
}

/// Follows what was extracted, and what instances refer to.
pub(super) fn update_instances(
    mut instances: ResMut<Instances>,
    mut extracted: ResMut<ExtractedInstances>,
    mut meshes: ResMut<Meshes>,
    mut materials: ResMut<Materials>,
    mut geometry: ResMut<Geometry>,
    cameras: Res<SceneCameras>,
    device: Res<RenderDevice>,
) {
    let instances = &mut *instances;
    let limit = (buffer_limit(&device).0 / GpuTable::<Instance>::stride()) as u32;
    for (entity, kind) in extracted.removed.drain(..) {
        instances.remove(entity, kind, &mut geometry, limit);
    }
    // Slots go to new instances in the order of their entities, whatever the order of the query; a material of a game's own comes after
    // a standard one.
    let (known, mut new): (Vec<_>, Vec<_>) =
        extracted.changed.drain(..).partition(|source| instances.by_entity.contains_key(&source.entity));
    let is_own = |source: &ExtractedInstance| source.kind() != TypeId::of::<StandardMaterial>();
    new.sort_by_key(|source| (spawn_order(source.entity), is_own(source)));
    for source in known.into_iter().chain(new) {
        instances.insert(source, &mut geometry, limit);
    }

    let (meshes, materials) = (meshes.take_changed(), materials.take_changed());
    if !meshes.is_empty() {
        instances.meshes_changed(&meshes, &mut geometry);
    }
    instances.meshes_changed = meshes;
    if !materials.is_empty() {
        instances.mark_where(|source| materials.contains(&source.material));
    }
    if instances.layers != cameras.layers {
        instances.layers = cameras.layers.clone();
        instances.mark_where(|_| true);
    }
}

/// An instance as it takes part.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Resolved {
    instance: Instance,
    bounds: Bounds,
    emits: bool,
}

/// Writes the instances that changed, and what is made from all of them.
pub(super) fn resolve_instances(mut instances: ResMut<Instances>, meshes: Res<Meshes>, materials: Res<Materials>) {
    let instances = &mut *instances;
    if instances.dirty.is_empty() {
        return;
    }
    let mut chunks_changed = false;
    for slot in std::mem::take(&mut instances.dirty) {
        let index = slot as usize;
        let shape = |instance: &Instance| (instance.triangle_count, instance.index_offset);
        let before = instances.table.values().get(index).map_or((0, 0), shape);
        let record = instances.records[index].as_ref();
        if record.is_some_and(|record| !record.source.transform.is_finite()) && !instances.warned_transform {
            instances.warned_transform = true;
            warn!("a mesh whose transform is not finite takes no part in bounced light");
        }
        if !instances.warned_normals && record.is_some_and(|record| lacks_normals(record, &meshes, &materials)) {
            instances.warned_normals = true;
            warn!(
                "a transparent mesh has no normals: light probes, Bevy's own as well, show it as values that are not finite; give it some, as by \
                 `Mesh::with_computed_flat_normals`, or an unlit material"
            );
        }
        let resolved =
            record.and_then(|record| resolve(record, &instances.layers, &meshes, &materials)).unwrap_or_default();
        chunks_changed |= before != shape(&resolved.instance);
        instances.table.set(index, resolved.instance);
        if let Some(record) = &mut instances.records[index] {
            chunks_changed |= record.emits != resolved.emits;
            record.emits = resolved.emits;
            record.bounds = resolved.bounds;
        }
    }
    if chunks_changed {
        instances.chunks_are_stale = true;
        instances.generation += 1;
    }
    instances.bounds =
        instances.records.iter().flatten().fold(Bounds::EMPTY, |bounds, record| bounds.union(&record.bounds));
}

/// Bevy's irradiance volumes normalise what a mesh has not.
fn lacks_normals(record: &Record, meshes: &Meshes, materials: &Materials) -> bool {
    meshes.get(record.source.mesh).is_some_and(|mesh| !mesh.has_normals)
        && materials.class(record.source.material).is_some_and(|material| material.transparent && !material.unlit)
}

/// `None` for an instance that takes no part; see the module.
fn resolve(record: &Record, layers: &RenderLayers, meshes: &Meshes, materials: &Materials) -> Option<Resolved> {
    let source = &record.source;
    if !source.enabled || !source.layers.intersects(layers) {
        return None;
    }
    let mesh = meshes.get(source.mesh)?;
    let material = materials.class(source.material).filter(|material| material.present)?;
    if material.unlit && !source.casts_shadows {
        return None;
    }
    let (deformed_offset, bounds) = match &record.shape {
        Shape::Rigid if is_sound(&source.transform) => (NONE, mesh.bounds.transformed(&source.transform)),
        Shape::Deformed(deformed) => (deformed.offset(), deformed.bounds),
        Shape::Rigid | Shape::Pending => return None,
    };
    if !(bounds.min.is_finite() && bounds.max.is_finite()) {
        return None;
    }
    let [x, y, z] = if deformed_offset == NONE { rows(&source.transform) } else { rows(&Affine3A::IDENTITY) };
    let flag = |set: bool, flag: u32| if set { flag } else { 0 };
    let instance = Instance {
        world_from_local_x: x,
        world_from_local_y: y,
        world_from_local_z: z,
        index_offset: mesh.index_offset,
        triangle_count: mesh.triangle_count,
        vertex_offset: mesh.vertex_offset,
        deformed_offset,
        material: material.slot,
        flags: flag(source.two_sided.unwrap_or(material.two_sided), INSTANCE_TWO_SIDED)
            | flag(material.flipped, INSTANCE_FLIPPED),
        albedo_override: source.albedo_override,
        color_offset: mesh.color_offset.unwrap_or(NONE),
    };
    Some(Resolved { instance, bounds, emits: material.emits })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_cover_every_triangle_once() {
        let starts =
            |count| chunks_of(3, count).map(|chunk| (chunk.instance, chunk.first_triangle)).collect::<Vec<_>>();
        assert_eq!(starts(0), []);
        assert_eq!(starts(64), [(3, 0)]);
        assert_eq!(starts(130), [(3, 0), (3, 64), (3, 128)]);
    }

    #[test]
    fn transforms_that_flatten_or_break_are_not_sound() {
        assert!(is_sound(&Affine3A::from_scale(Vec3::new(-1.0, 2.0, 1e-3))));
        for scale in [Vec3::ZERO, Vec3::new(1.0, 0.0, 1.0), Vec3::NAN, Vec3::splat(f32::INFINITY), Vec3::splat(1e30)] {
            assert!(!is_sound(&Affine3A::from_scale(scale)), "{scale}");
        }
        assert!(!is_sound(&Affine3A::from_translation(Vec3::new(0.0, f32::NAN, 0.0))));
    }
}
