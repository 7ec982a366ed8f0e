//! Rigid groups of meshes with a voxel grid of their own: what each holds, which share a grid, where they stand.
//!
//! What a group holds are the rigid meshes below its root, as instances in its own space. Groups that hold the same have the same
//! grid; whether they do is asked every frame, by value, so that nothing that changes can be missed. A grid of which anything has
//! changed gets a new revision, and `avg` voxelises it anew.

use std::collections::BTreeSet;

use bevy::log::warn;
use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::renderer::RenderDevice;
use bevy_bounce_shaders::types::{Chunk, GROUP_EDGE, INSTANCE_FLIPPED, Instance, Material, VOXEL_GROUPS};

use super::bounds::Bounds;
use super::deform::rows;
use super::extract::spawn_order;
use super::instances::{Instances, chunks_of, is_sound};
use super::materials::Materials;
use super::meshes::Meshes;
use super::regions::Regions;
use super::table::buffer_limit;
use super::thumbnails::Thumbnails;
use crate::avg::has_room_for_groups;
use crate::settings::GiWorldSettings;

/// On the root of something rigid, such as a vehicle: the meshes on it and below it have a voxel grid of their own, which moves,
/// turns, stretches and mirrors with the root. They are voxelised once, and again only when what is below the root changes; without
/// it a mesh is voxelised every frame, together with the world.
///
/// Groups that hold the same meshes and materials at the same places below their roots share one grid, so that a fleet
/// costs one voxelisation; each is lit by itself. Up to 32 take part at a time, those spawned first; meshes of further
/// ones, skinned and morphed meshes are voxelised with the world as without it; all are where the world's own voxels
/// leave no room in a binding: beyond [`GiSettings::grid`](crate::GiSettings::grid) 128 with several grids, on devices
/// that bind 128 MiB. A group within a group is one of its own.
///
/// What a group emits belongs to it: it is voxelised anew where that changes, also by the camera's exposure, where
/// `StandardMaterial::emissive_exposure_weight` lets that count.
///
/// Every ray through the voxels asks whether it comes near each group, so a few large groups are worth more than many small ones.
/// Groups block and reflect the light of probes, which look for places in the world's grid alone: those that are within a group stay there.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct VoxelizedGroup {
    /// Voxels along the longest side of the group's grid, 8 to 32.
    #[reflect(@8..=32_u32)]
    pub resolution: u32,
}

impl Default for VoxelizedGroup {
    fn default() -> Self {
        Self { resolution: GROUP_EDGE }
    }
}

/// A group as it is in the main world.
#[derive(Clone, Debug)]
pub(super) struct ExtractedGroup {
    entity: Entity,
    resolution: u32,
    world_from_group: Affine3A,
    /// Its meshes, each with its place in the group.
    members: Vec<(Entity, Affine3A)>,
}

/// The groups of this frame, as they were spawned.
#[derive(Resource, Debug, Default)]
pub(super) struct ExtractedGroups(Vec<ExtractedGroup>);

/// Reads all groups.
pub(super) fn extract_groups(
    mut extracted: ResMut<ExtractedGroups>,
    roots: Extract<Query<(Entity, &VoxelizedGroup, &GlobalTransform)>>,
    nodes: Extract<Query<(Option<&Transform>, Has<Mesh3d>, Has<VoxelizedGroup>)>>,
    children: Extract<Query<&Children>>,
) {
    extracted.0.clear();
    for (entity, group, transform) in &roots {
        let mut members = Vec::new();
        let mut ahead = vec![(entity, Affine3A::IDENTITY)];
        while let Some((node, group_from_node)) = ahead.pop() {
            if nodes.get(node).is_ok_and(|(_, has_mesh, _)| has_mesh) {
                members.push((node, group_from_node));
            }
            for child in children.get(node).into_iter().flatten() {
                if let Ok((Some(transform), _, false)) = nodes.get(*child) {
                    ahead.push((*child, group_from_node * transform.compute_affine()));
                }
            }
        }
        extracted.0.push(ExtractedGroup {
            entity,
            resolution: group.resolution.clamp(8, GROUP_EDGE),
            world_from_group: transform.affine(),
            members,
        });
    }
    extracted.0.sort_by_key(|group| spawn_order(group.entity));
}

/// A mesh of a group.
#[derive(Clone, Debug, PartialEq)]
struct Part {
    mesh: AssetId<Mesh>,
    /// In the group's space.
    instance: Instance,
    material: Material,
    emits: bool,
}

/// What a grid is made from.
#[derive(Clone, Debug, PartialEq)]
struct Content {
    resolution: u32,
    parts: Vec<Part>,
    bounds: Bounds,
}

/// A grid that groups share.
#[derive(Clone, Debug)]
pub(crate) struct GroupGrid {
    content: Content,
    /// Another one where anything of it has changed.
    pub revision: u64,
}

impl GroupGrid {
    /// Voxels along its longest side.
    pub fn resolution(&self) -> u32 {
        self.content.resolution
    }

    /// Box of what it holds, in the group's space.
    pub fn bounds(&self) -> Bounds {
        self.content.bounds
    }

    /// Its meshes as instances in the group's space.
    pub fn instances(&self) -> Vec<Instance> {
        self.content.parts.iter().map(|part| part.instance).collect()
    }

    /// Chunks of those, or of what emits alone.
    pub fn chunks(&self, emissive_only: bool) -> Vec<Chunk> {
        let parts = (0u32..).zip(&self.content.parts).filter(|(_, part)| part.emits || !emissive_only);
        parts.flat_map(|(index, part)| chunks_of(index, part.instance.triangle_count)).collect()
    }

    /// Largest component of the radiance that any of it emits, cd/m^2.
    pub fn max_emission(&self) -> f32 {
        self.content.parts.iter().map(|part| part.material.emissive.max_element()).fold(0.0, f32::max)
    }
}

/// A group as it stands in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedGroup {
    /// Its grid.
    pub grid: usize,
    /// World from the group's space.
    pub world_from_group: Affine3A,
}

/// All groups with a grid of their own.
#[derive(Resource, Debug, Default)]
pub(crate) struct Groups {
    /// Up to [`VOXEL_GROUPS`]; those that no group has are kept until another one needs their place.
    pub grids: Vec<GroupGrid>,
    /// Up to [`VOXEL_GROUPS`], as they were spawned.
    pub placed: Vec<PlacedGroup>,
    revision: u64,
    warned: bool,
}

impl Groups {
    /// The grid of that content: one that there is, or one in the place of what no group in `used` has.
    fn grid_of(&mut self, content: Content, used: &BTreeSet<usize>) -> Option<usize> {
        if let Some(held) = self.grids.iter().position(|grid| grid.content == content) {
            return Some(held);
        }
        self.revision += 1;
        let grid = GroupGrid { content, revision: self.revision };
        match (0..self.grids.len()).find(|index| !used.contains(index)) {
            Some(free) => {
                self.grids[free] = grid;
                Some(free)
            }
            None if self.grids.len() < VOXEL_GROUPS => {
                self.grids.push(grid);
                Some(self.grids.len() - 1)
            }
            None => None,
        }
    }

    /// What has changed without its value: meshes and thumbnails that were written anew in their place.
    fn invalidate(&mut self, instances: &Instances, thumbnails: &Thumbnails) {
        let rewritten: BTreeSet<u32> = thumbnails.queue.iter().map(|queued| queued.at).collect();
        let meshes = instances.meshes_changed_now();
        if rewritten.is_empty() && meshes.is_empty() {
            return;
        }
        for grid in &mut self.grids {
            let changed = grid.content.parts.iter().any(|part| {
                meshes.contains(&part.mesh)
                    || rewritten.contains(&part.material.albedo_thumbnail)
                    || rewritten.contains(&part.material.emissive_thumbnail)
            });
            if changed {
                self.revision += 1;
                grid.revision = self.revision;
            }
        }
    }
}

/// What a group holds, and the slots of its instances; `None` where that is nothing.
fn content_of(
    group: &ExtractedGroup,
    instances: &Instances,
    meshes: &Meshes,
    materials: &Materials,
) -> Option<(Content, Vec<u32>)> {
    let mut content = Content { resolution: group.resolution, parts: Vec::new(), bounds: Bounds::EMPTY };
    let mut slots = Vec::new();
    // The side that is seen is the one that winds the right way in the world.
    let mirrored = if group.world_from_group.matrix3.determinant() < 0.0 { INSTANCE_FLIPPED } else { 0 };
    for (entity, group_from_local) in &group.members {
        let Some((slot, mesh, instance, emits)) = instances.rigid(*entity) else { continue };
        let (Some(entry), Some(material)) =
            (meshes.get(mesh), materials.table.values().get(instance.material as usize))
        else {
            continue;
        };
        if !is_sound(group_from_local) {
            continue;
        }
        let [x, y, z] = rows(group_from_local);
        let instance = Instance {
            world_from_local_x: x,
            world_from_local_y: y,
            world_from_local_z: z,
            flags: instance.flags ^ mirrored,
            ..*instance
        };
        content.parts.push(Part { mesh, instance, material: *material, emits });
        content.bounds = content.bounds.union(&entry.bounds.transformed(group_from_local));
        slots.push(slot);
    }
    let is_finite = content.bounds.min.is_finite() && content.bounds.max.is_finite();
    is_finite.then_some((content, slots))
}

/// Finds a grid for every group, and takes its meshes out of the world's.
pub(super) fn update_groups(
    mut groups: ResMut<Groups>,
    mut instances: ResMut<Instances>,
    extracted: Res<ExtractedGroups>,
    meshes: Res<Meshes>,
    materials: Res<Materials>,
    thumbnails: Res<Thumbnails>,
    regions: Res<Regions>,
    settings: Res<GiWorldSettings>,
    device: Res<RenderDevice>,
) {
    let groups = &mut *groups;
    groups.invalidate(&instances, &thumbnails);
    groups.placed.clear();
    let has_room = settings
        .0
        .is_none_or(|settings| has_room_for_groups(settings.grid, regions.boxes().len(), buffer_limit(&device).0));
    let found: Vec<_> = extracted
        .0
        .iter()
        .filter(|group| is_sound(&group.world_from_group))
        .filter_map(|group| Some((group, content_of(group, &instances, &meshes, &materials)?)))
        .collect();
    // What there is stays where it is, whatever comes before it.
    let held = |content: &Content| groups.grids.iter().position(|grid| grid.content == *content);
    let taking_part = found.len().min(if has_room { VOXEL_GROUPS } else { 0 });
    let mut used: BTreeSet<usize> = found[..taking_part].iter().filter_map(|(_, (content, _))| held(content)).collect();
    if taking_part < found.len() && !groups.warned {
        groups.warned = true;
        warn!(
            "{} groups have no voxel grid of their own, for beside the world's grid ({} voxels along an edge, {} times) there \
             is room for {}: they are voxelised with the world",
            found.len() - taking_part,
            settings.0.map_or(0, |settings| settings.grid),
            regions.boxes().len().max(1),
            taking_part,
        );
    }
    let mut grouped = BTreeSet::new();
    for (group, (content, slots)) in found.into_iter().take(taking_part) {
        let Some(grid) = groups.grid_of(content, &used) else { continue };
        used.insert(grid);
        grouped.extend(slots);
        groups.placed.push(PlacedGroup { grid, world_from_group: group.world_from_group });
    }
    instances.set_grouped(grouped);
}
