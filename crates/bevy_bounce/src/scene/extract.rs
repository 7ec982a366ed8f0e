//! From the main world, by change: what took part, how it looks and how it is seen.
//!
//! Bevy's own tables of instances, skins and lights hold what some view sees; what a camera does not see lights the room
//! all the same.

use std::any::TypeId;

use bevy::asset::{AssetEvent, UntypedAssetId};
use bevy::camera::primitives::Aabb;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers, VisibilityRange};
use bevy::camera::{Camera, Exposure};
use bevy::ecs::entity::EntityHashSet;
use bevy::light::NotShadowCaster;
use bevy::math::{Affine3A, Vec3A};
use bevy::mesh::morph::MeshMorphWeights;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::sync_world::RenderEntity;

use super::VoxelizedMesh;
use super::materials::Surface;
use super::stand_in::GiMaterial;
use crate::{GlobalIllumination, Technique};

/// What the world stages need of the cameras with global illumination. Keeps its last state while none is active.
#[derive(Resource, Debug)]
pub(super) struct SceneCameras {
    /// Whether there is one.
    pub active: bool,
    /// Layers that any of them sees.
    pub layers: RenderLayers,
    /// Exposure of the first by order: display value of 1 cd/m^2.
    pub exposure: f32,
    /// The first by order, in the render world.
    pub first: Option<Entity>,
    /// Where they are.
    pub positions: Vec<Vec3A>,
}

impl Default for SceneCameras {
    fn default() -> Self {
        Self {
            active: false,
            layers: RenderLayers::default(),
            exposure: Exposure::default().exposure(),
            first: None,
            positions: Vec::new(),
        }
    }
}

/// Orders entities as they were spawned, as far as their places were not used before; `Entity`'s own order is another.
pub(super) fn spawn_order(entity: Entity) -> (u32, u64) {
    (entity.index_u32(), entity.to_bits())
}

/// Begins a frame's changes.
pub(super) fn forget_changes(mut instances: ResMut<ExtractedInstances>, mut materials: ResMut<ExtractedMaterials>) {
    instances.changed.clear();
    instances.removed.clear();
    materials.changed.clear();
}

type GiCamera = (
    Entity,
    Option<RenderEntity>,
    &'static Camera,
    &'static GlobalIllumination,
    &'static GlobalTransform,
    Option<&'static Exposure>,
    Option<&'static RenderLayers>,
);

/// Reads the cameras.
pub(super) fn extract_cameras(mut extracted: ResMut<SceneCameras>, cameras: Extract<Query<GiCamera>>) {
    let extracted = &mut *extracted;
    extracted.active = false;
    let mut first = None;
    for (entity, in_render_world, camera, settings, transform, exposure, layers) in &cameras {
        if !camera.is_active || settings.technique == Technique::None {
            continue;
        }
        let layers = layers.cloned().unwrap_or_default();
        if extracted.active {
            extracted.layers = extracted.layers.union(&layers);
        } else {
            extracted.active = true;
            extracted.layers = layers;
            extracted.positions.clear();
        }
        extracted.positions.push(transform.affine().translation);
        let key = (camera.order, spawn_order(entity));
        if first.is_none_or(|first| key < first) {
            first = Some(key);
            extracted.first = in_render_world;
            let exposure = exposure.copied().unwrap_or_default().exposure();
            if exposure.is_finite() && exposure > 0.0 {
                extracted.exposure = exposure;
            }
        }
    }
}

/// A mesh in the world, as its components say.
#[derive(Clone, Debug)]
pub(super) struct ExtractedInstance {
    /// In the main world.
    pub entity: Entity,
    /// Its shape.
    pub mesh: AssetId<Mesh>,
    /// Its look.
    pub material: UntypedAssetId,
    /// World from local.
    pub transform: Affine3A,
    /// Visible, in range and not [`VoxelizedMesh::OFF`].
    pub enabled: bool,
    /// Cameras that see it.
    pub layers: RenderLayers,
    /// RGBA8 as in the GPU's instance; 0 for none.
    pub albedo_override: u32,
    /// Replaces the material's answer.
    pub two_sided: Option<bool>,
    /// Has a skin or morph weights.
    pub deforms: bool,
    /// Without [`NotShadowCaster`].
    pub casts_shadows: bool,
}

impl ExtractedInstance {
    /// Of its material.
    pub fn kind(&self) -> TypeId {
        self.material.type_id()
    }
}

/// Changes since the last frame.
#[derive(Resource, Debug, Default)]
pub(super) struct ExtractedInstances {
    /// New and changed ones, each once for every kind of material that it has.
    pub changed: Vec<ExtractedInstance>,
    /// Those that are gone or lack what they need, and the kind of material that they had.
    pub removed: Vec<(Entity, TypeId)>,
}

type InstanceData<M> = (
    Entity,
    &'static Mesh3d,
    &'static MeshMaterial3d<M>,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static VoxelizedMesh>,
    Option<&'static RenderLayers>,
    Has<SkinnedMesh>,
    Has<MeshMorphWeights>,
    Has<NotShadowCaster>,
);

type InstanceChanged<M> = Or<(
    Changed<Mesh3d>,
    Changed<MeshMaterial3d<M>>,
    Changed<GlobalTransform>,
    Changed<InheritedVisibility>,
    Changed<VoxelizedMesh>,
    Changed<RenderLayers>,
    Added<SkinnedMesh>,
    Added<MeshMorphWeights>,
    Added<NotShadowCaster>,
)>;

type RemovedParts<M> = (
    RemovedComponents<'static, 'static, Mesh3d>,
    RemovedComponents<'static, 'static, MeshMaterial3d<M>>,
    RemovedComponents<'static, 'static, GlobalTransform>,
    RemovedComponents<'static, 'static, InheritedVisibility>,
    RemovedComponents<'static, 'static, VoxelizedMesh>,
    RemovedComponents<'static, 'static, RenderLayers>,
    RemovedComponents<'static, 'static, VisibilityRange>,
    RemovedComponents<'static, 'static, SkinnedMesh>,
    RemovedComponents<'static, 'static, MeshMorphWeights>,
    RemovedComponents<'static, 'static, NotShadowCaster>,
);

type Ranged<M> = (With<Mesh3d>, With<MeshMaterial3d<M>>);

/// Reads the meshes with that material that changed. `known` are those there were.
pub(super) fn extract_instances<M: GiMaterial>(
    mut extracted: ResMut<ExtractedInstances>,
    mut known: Local<EntityHashSet>,
    mut out_of_range: Local<EntityHashSet>,
    mut seen: Local<EntityHashSet>,
    cameras: Res<SceneCameras>,
    instances: Extract<Query<InstanceData<M>>>,
    changed: Extract<Query<InstanceData<M>, InstanceChanged<M>>>,
    ranged: Extract<Query<(Entity, &VisibilityRange, &GlobalTransform, Option<&Aabb>), Ranged<M>>>,
    mut removed: Extract<RemovedParts<M>>,
) {
    let extracted = &mut *extracted;
    seen.clear();

    let parts = &mut *removed;
    let lost: Vec<Entity> = (parts.0.read().chain(parts.1.read()).chain(parts.2.read()))
        .chain(parts.3.read())
        .chain(parts.4.read())
        .chain(parts.5.read())
        .chain(parts.6.read())
        .chain(parts.7.read())
        .chain(parts.8.read())
        .chain(parts.9.read())
        .collect();
    for entity in &lost {
        out_of_range.remove(entity);
    }

    let mut moved_in_range = Vec::new();
    if cameras.active {
        for (entity, range, transform, aabb) in &ranged {
            let inside = is_in_range(&cameras.positions, range, transform, aabb);
            let flipped = if inside { out_of_range.remove(&entity) } else { out_of_range.insert(entity) };
            if flipped {
                moved_in_range.push(entity);
            }
        }
    }

    for data in &changed {
        if seen.insert(data.0) {
            known.insert(data.0);
            extracted.changed.push(instance(data, &out_of_range));
        }
    }
    for entity in lost.into_iter().chain(moved_in_range) {
        if !seen.insert(entity) {
            continue;
        }
        match instances.get(entity) {
            Ok(data) => extracted.changed.push(instance(data, &out_of_range)),
            Err(_) if known.remove(&entity) => extracted.removed.push((entity, TypeId::of::<M>())),
            Err(_) => {}
        }
    }
}

/// Whether the nearest camera sees this level of detail. Levels cross-fade over their margins; the middle of the margin
/// decides, so that of levels that share their margins exactly one is in.
fn is_in_range(cameras: &[Vec3A], range: &VisibilityRange, transform: &GlobalTransform, aabb: Option<&Aabb>) -> bool {
    let affine = transform.affine();
    let position = match aabb {
        Some(aabb) if range.use_aabb => affine.transform_point3a(aabb.center),
        _ => affine.translation,
    };
    let distance = cameras.iter().map(|camera| camera.distance(position)).fold(f32::INFINITY, f32::min);
    let middle = |margin: &std::ops::Range<f32>| 0.5 * (margin.start + margin.end);
    middle(&range.start_margin) <= distance && distance < middle(&range.end_margin)
}

fn instance<M: GiMaterial>(
    (entity, mesh, material, transform, visibility, voxelized, layers, skinned, morphed, shadowless): (
        Entity,
        &Mesh3d,
        &MeshMaterial3d<M>,
        &GlobalTransform,
        &InheritedVisibility,
        Option<&VoxelizedMesh>,
        Option<&RenderLayers>,
        bool,
        bool,
        bool,
    ),
    out_of_range: &EntityHashSet,
) -> ExtractedInstance {
    let voxelized = voxelized.copied().unwrap_or_default();
    ExtractedInstance {
        entity,
        mesh: mesh.id(),
        material: material.id().untyped(),
        transform: transform.affine(),
        enabled: voxelized.enabled && visibility.get() && !out_of_range.contains(&entity),
        layers: layers.cloned().unwrap_or_default(),
        albedo_override: voxelized.albedo.map_or(0, |color| {
            let rgb = color.to_linear().to_f32_array_no_alpha().map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
            u32::from_le_bytes([rgb[0], rgb[1], rgb[2], 255])
        }),
        two_sided: voxelized.two_sided,
        deforms: skinned || morphed,
        casts_shadows: !shadowless,
    }
}

/// Materials that changed, and those that are gone.
#[derive(Resource, Debug, Default)]
pub(super) struct ExtractedMaterials {
    /// In the order of their events; `None` for one that is gone.
    pub changed: Vec<(UntypedAssetId, Option<Surface>)>,
}

/// Reads the materials of a kind that changed.
pub(super) fn extract_materials<M: GiMaterial>(
    mut extracted: ResMut<ExtractedMaterials>,
    mut events: Extract<MessageReader<AssetEvent<M>>>,
    materials: Extract<Res<Assets<M>>>,
) {
    for event in events.read() {
        match *event {
            AssetEvent::Added { id } | AssetEvent::Modified { id } => {
                if let Some(material) = materials.get(id) {
                    extracted.changed.push((id.untyped(), Some(Surface::of(&material.stand_in()))));
                }
            }
            AssetEvent::Unused { id } => extracted.changed.push((id.untyped(), None)),
            AssetEvent::Removed { .. } | AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_level_of_detail_at_any_distance() {
        let levels = [
            VisibilityRange { start_margin: 0.0..0.0, end_margin: 20.0..25.0, use_aabb: false },
            VisibilityRange { start_margin: 20.0..25.0, end_margin: 70.0..75.0, use_aabb: false },
            VisibilityRange { start_margin: 70.0..75.0, end_margin: f32::MAX..f32::MAX, use_aabb: false },
        ];
        let transform = GlobalTransform::from_translation(Vec3::X);
        for distance in [0.0, 19.0, 22.4, 22.6, 50.0, 72.5, 1e6] {
            let cameras = [Vec3A::new(1.0 + distance, 0.0, 0.0), Vec3A::splat(1e7)];
            let seen = levels.iter().filter(|level| is_in_range(&cameras, level, &transform, None)).count();
            assert_eq!(seen, 1, "at {distance}");
        }
    }
}
