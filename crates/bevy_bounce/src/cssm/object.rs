//! From the main world: the baked object, where it stands, which of its meshes are which part of the bake, and what cameras
//! ask for.

use bevy::asset::AssetPath;
use bevy::camera::{Camera, Exposure};
use bevy::core_pipeline::tonemapping::{Tonemapping, TonemappingLuts};
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::math::Affine3A;
use bevy::platform::collections::HashMap;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::RenderEntity;
use bevy_bounce_cssm::{CssmAsset, CssmFile};
use bevy_bounce_shaders::types::CssmGather;

use super::display::light_of_steps;
use super::prepare::Baked;
use super::{CssmFilter, CssmObject, CssmPart};
use crate::{GiSettings, GlobalIllumination, Technique};

/// How much edges of a baked object may change in length by its transform.
const RIGID: f32 = 1.0e-3;

/// Of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedCssm {
    /// World from the object's space; `None` without an object that is loaded and stands rigidly, or without a camera that asks.
    pub placed: Option<Affine3A>,
    /// The mesh of each part of the bake.
    pub parts: Vec<Option<Entity>>,
    /// Gathers between texels; the last one is that of pixels.
    pub bounces: u32,
    /// How texels gather.
    pub gather: CssmGather,
    warned: Warned,
}

#[derive(Default)]
struct Warned {
    several: bool,
    bent: bool,
    size: Option<AssetId<CssmAsset>>,
}

/// How the pixels of a view gather.
#[derive(Component, Clone, Copy)]
pub(super) struct CssmView(pub CssmGather);

/// Tone mapping as the display has it.
#[derive(SystemParam)]
pub(super) struct Displays<'w> {
    luts: Option<Res<'w, TonemappingLuts>>,
    images: Res<'w, Assets<Image>>,
}

impl Displays<'_> {
    fn gather(&self, settings: &GiSettings, exposure: f32, tonemapping: Tonemapping) -> CssmGather {
        let luts = self.luts.as_deref().map(|luts| (luts, &*self.images));
        CssmGather {
            threshold: light_of_steps(tonemapping, luts, settings.cssm.error) / exposure,
            filtered: u32::from(settings.cssm.filter == CssmFilter::Pixels),
            ..default()
        }
    }
}

/// Reads the cameras. Texels are lit for the first of them by order, and as often as the one with the most bounces asks.
pub(super) fn extract_cameras(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedCssm>,
    cameras: Extract<
        Query<(Entity, RenderEntity, &Camera, &GlobalIllumination, Option<&Exposure>, Option<&Tonemapping>)>,
    >,
    displays: Extract<Displays>,
) {
    extracted.bounces = 0;
    let mut first = None;
    for (entity, render_entity, camera, gi, exposure, tonemapping) in &cameras {
        if !camera.is_active || gi.technique != Technique::SurfaceRadiosity {
            continue;
        }
        let settings = gi.quality.settings();
        let exposure = exposure.copied().unwrap_or_default().exposure();
        let gather = displays.gather(&settings, exposure, tonemapping.copied().unwrap_or(Tonemapping::None));
        commands.entity(render_entity).insert(CssmView(gather));
        extracted.bounces = extracted.bounces.max(settings.bounces);
        let key = (camera.order, entity);
        if first.is_none_or(|first| key < first) {
            first = Some(key);
            extracted.gather = gather;
        }
    }
}

#[derive(SystemParam)]
pub(super) struct Objects<'w, 's> {
    objects: Query<'w, 's, (Entity, &'static CssmObject, &'static GlobalTransform)>,
    children: Query<'w, 's, &'static Children>,
    meshes: Query<'w, 's, (&'static Mesh3d, Option<&'static CssmPart>)>,
    assets: Res<'w, Assets<CssmAsset>>,
    server: Res<'w, AssetServer>,
}

/// Reads the object, and puts its bake on the GPU when it is another one than before.
pub(super) fn extract_object(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedCssm>,
    baked: Option<Res<Baked>>,
    device: Res<RenderDevice>,
    objects: Extract<Objects>,
    mut events: Extract<MessageReader<AssetEvent<CssmAsset>>>,
) {
    let extracted = &mut *extracted;
    extracted.placed = None;
    let held = baked.map(|baked| baked.asset);
    let changed = events.read().any(|event| match event {
        AssetEvent::Modified { id } => Some(*id) == held,
        _ => false,
    });
    if extracted.bounces == 0 {
        return;
    }
    let mut loaded: Vec<_> = objects
        .objects
        .iter()
        .filter_map(|(entity, object, transform)| {
            Some((entity, object.bake.id(), transform, &objects.assets.get(&object.bake)?.file))
        })
        .collect();
    loaded.sort_by_key(|(entity, ..)| (entity.index_u32(), entity.to_bits()));
    if loaded.len() > 1 && !std::mem::replace(&mut extracted.warned.several, true) {
        warn!("{} baked objects: one at a time is lit, the one that was spawned first", loaded.len());
    }
    let Some((entity, asset, transform, file)) = loaded.first() else { return };
    let affine = transform.affine();
    if !is_rigid(affine) {
        if !std::mem::replace(&mut extracted.warned.bent, true) {
            warn!("a baked object is stretched or bent by its transform: it is not lit");
        }
        return;
    }
    if held != Some(*asset) || changed {
        match Baked::new(&device, *asset, file) {
            Ok(baked) => commands.insert_resource(baked),
            Err(error) => {
                if extracted.warned.size.replace(*asset) != Some(*asset) {
                    warn!(
                        "a bake's {} have {} words and {} fit the GPU: it is not lit",
                        error.section, error.words, error.limit
                    );
                }
                return;
            }
        }
    }
    extracted.placed = Some(affine);
    objects.parts(*entity, file, &mut extracted.parts);
}

impl Objects<'_, '_> {
    /// The mesh of each part: as [`CssmPart`] says, or by the numbers in the mesh's asset label.
    fn parts(&self, root: Entity, file: &CssmFile, parts: &mut Vec<Option<Entity>>) {
        let mut by_part: HashMap<u32, Entity> = HashMap::default();
        let mut by_label: HashMap<[u32; 2], Entity> = HashMap::default();
        for entity in std::iter::once(root).chain(self.children.iter_descendants(root)) {
            let Ok((mesh, part)) = self.meshes.get(entity) else { continue };
            match part {
                Some(part) => {
                    by_part.entry(part.0).or_insert(entity);
                }
                None => {
                    let label = self.server.get_path(mesh.0.id()).as_ref().and_then(numbers);
                    if let Some(numbers) = label {
                        by_label.entry(numbers).or_insert(entity);
                    }
                }
            }
        }
        parts.clear();
        parts.extend((0..).zip(file.parts.iter()).map(|(number, part)| {
            by_part.get(&number).or_else(|| by_label.get(&[part.mesh, part.primitive])).copied()
        }));
    }
}

/// Mesh and primitive of a label such as `Mesh3/Primitive0`.
fn numbers(path: &AssetPath) -> Option<[u32; 2]> {
    let (mesh, primitive) = path.label()?.split_once('/')?;
    Some([mesh.strip_prefix("Mesh")?.parse().ok()?, primitive.strip_prefix("Primitive")?.parse().ok()?])
}

/// Whether lengths and angles stay as they are, but for one scale.
fn is_rigid(affine: Affine3A) -> bool {
    let [x, y, z] = [affine.matrix3.x_axis, affine.matrix3.y_axis, affine.matrix3.z_axis];
    let scale = x.length();
    let square = scale * scale * RIGID;
    let equal = (y.length() - scale).abs() <= scale * RIGID && (z.length() - scale).abs() <= scale * RIGID;
    let upright = x.dot(y).abs() <= square && y.dot(z).abs() <= square && z.dot(x).abs() <= square;
    affine.is_finite() && scale > 0.0 && affine.matrix3.determinant() > 0.0 && equal && upright
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_understood() {
        let label = |text: &str| numbers(&AssetPath::from(text.to_owned()));
        assert_eq!(label("room.glb#Mesh3/Primitive12"), Some([3, 12]));
        assert_eq!(label("room.glb#Mesh3"), None);
        assert_eq!(label("room.glb"), None);
    }

    #[test]
    fn what_is_rigid() {
        let turn = Quat::from_rotation_y(0.7);
        let affine = |scale: Vec3| Affine3A::from_scale_rotation_translation(scale, turn, Vec3::new(1.0, 2.0, 3.0));
        assert!(is_rigid(affine(Vec3::ONE)) && is_rigid(affine(Vec3::splat(0.25))));
        assert!(!is_rigid(affine(Vec3::new(1.0, 1.1, 1.0))) && !is_rigid(affine(Vec3::new(-1.0, 1.0, 1.0))));
        let bent = Affine3A::from_mat3(Mat3::from_cols(Vec3::X, Vec3::new(0.3, 0.954, 0.0), Vec3::Z));
        assert!(!is_rigid(bent));
    }
}
