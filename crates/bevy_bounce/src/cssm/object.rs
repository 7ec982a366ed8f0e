//! From the main world: the baked objects, where they stand, which of their meshes are which part of a bake, and what cameras
//! ask for.

use bevy::asset::AssetPath;
use bevy::camera::{Camera, Exposure};
use bevy::core_pipeline::tonemapping::{Tonemapping, TonemappingLuts};
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::math::Affine3A;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::Extract;
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::RenderEntity;
use bevy::render::view::ColorGrading;
use bevy_bounce_cssm::{CssmAsset, CssmFile};
use bevy_bounce_shaders::types::{CSSM_OBJECTS, CssmGather};

use super::display::light_of_steps;
use super::hull::Overlaps;
use super::prepare::{Baked, PreparedBakes};
use super::{CssmFilter, CssmObject, CssmPart, CssmReceivers};
use crate::{GiBudget, GiSettings, GlobalIllumination, Technique, VplVisibility};

/// How much edges of a baked object may change in length by its transform.
const RIGID: f32 = 1.0e-3;

/// A part of a baked object.
pub(super) struct Part {
    pub mesh: Option<Entity>,
    /// The object's place in [`ExtractedCssm::placed`].
    pub object: u32,
}

/// Of this frame.
#[derive(Resource, Default)]
pub(super) struct ExtractedCssm {
    /// World from the space of each object, in the order of [`Baked`]; none without objects that are loaded and stand rigidly, or
    /// without a camera that asks.
    pub placed: Vec<Affine3A>,
    /// Of their bakes, one object after the other.
    pub parts: Vec<Part>,
    /// Gathers between texels; the last one is that of pixels.
    pub bounces: u32,
    /// How texels gather.
    pub gather: CssmGather,
    /// Whether bounces between texels follow each other from frame to frame: all cameras that ask for them have a budget.
    pub spread: bool,
    /// Whether texels gather the last bounce, too, for pixels that show them.
    pub at_texels: bool,
    /// Whether virtual lights see by bakes.
    pub are_eyes: bool,
    overlaps: Overlaps,
    warned: Warned,
}

#[derive(Default)]
struct Warned {
    many: bool,
    bent: bool,
    size: HashSet<AssetId<CssmAsset>>,
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

type Cameras<'w, 's> = Query<
    'w,
    's,
    (
        Entity,
        RenderEntity,
        &'static Camera,
        &'static GlobalIllumination,
        Option<&'static GiBudget>,
        Option<&'static Exposure>,
        Option<&'static ColorGrading>,
        Option<&'static Tonemapping>,
    ),
>;

/// Reads the cameras. Texels are lit for the first of them by order, and as often as the one with the most bounces asks.
pub(super) fn extract_cameras(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedCssm>,
    cameras: Extract<Cameras>,
    displays: Extract<Displays>,
) {
    extracted.bounces = 0;
    extracted.are_eyes = false;
    extracted.spread = true;
    extracted.at_texels = false;
    let mut first = None;
    for (entity, render_entity, camera, gi, budget, exposure, grading, tonemapping) in &cameras {
        let settings = gi.settings();
        let is_lit_by_points = camera.is_active && gi.technique == Technique::InstantRadiosity;
        extracted.are_eyes |= is_lit_by_points && settings.visibility == VplVisibility::Baked;
        if !camera.is_active || gi.technique != Technique::SurfaceRadiosity {
            continue;
        }
        let stops = grading.map_or(0.0, |grading| grading.global.exposure);
        let exposure = exposure.copied().unwrap_or_default().exposure() * stops.exp2();
        let tonemapping = tonemapping.copied().unwrap_or(Tonemapping::None);
        let of_pixels = displays.gather(&gi.given(budget), exposure, tonemapping);
        commands.entity(render_entity).insert(CssmView(of_pixels));
        extracted.bounces = extracted.bounces.max(settings.bounces);
        extracted.spread &= gi.budget.is_some();
        extracted.at_texels |= settings.cssm.receivers == CssmReceivers::Texels;
        let key = (camera.order, entity);
        if first.is_none_or(|first| key < first) {
            first = Some(key);
            // Texels are lit once and kept, whatever a budget leaves.
            extracted.gather = displays.gather(&settings, exposure, tonemapping);
        }
    }
}

#[derive(SystemParam)]
pub(super) struct Objects<'w, 's> {
    objects: Query<'w, 's, (Entity, &'static CssmObject, &'static GlobalTransform)>,
    names: Query<'w, 's, NameOrEntity>,
    children: Query<'w, 's, &'static Children>,
    meshes: Query<'w, 's, (&'static Mesh3d, Option<&'static CssmPart>)>,
    assets: Res<'w, Assets<CssmAsset>>,
    server: Res<'w, AssetServer>,
}

/// An object whose bake is loaded and that stands rigidly.
#[derive(Clone, Copy)]
struct Loaded<'a> {
    entity: Entity,
    asset: AssetId<CssmAsset>,
    file: &'a CssmFile,
    place: Affine3A,
}

/// Reads the objects, and puts their bakes on the GPU when they are others than before.
pub(super) fn extract_objects(
    mut commands: Commands,
    mut extracted: ResMut<ExtractedCssm>,
    mut prepared: ResMut<PreparedBakes>,
    baked: Option<Res<Baked>>,
    device: Res<RenderDevice>,
    objects: Extract<Objects>,
    mut events: Extract<MessageReader<AssetEvent<CssmAsset>>>,
) {
    let extracted = &mut *extracted;
    extracted.placed.clear();
    extracted.parts.clear();
    let mut is_stale = false;
    for event in events.read() {
        if let AssetEvent::Modified { id } | AssetEvent::Removed { id } = event {
            is_stale |= prepared.0.remove(id).is_some();
        }
    }
    if extracted.bounces == 0 && !extracted.are_eyes {
        if baked.is_some() {
            commands.remove_resource::<Baked>();
        }
        return;
    }
    let loaded = objects.loaded(&mut extracted.warned);
    prepared.hold(loaded.iter().map(|object| (object.asset, object.file)));
    let assets: Vec<_> = loaded.iter().map(|object| object.asset).collect();
    let held = baked.as_deref().filter(|baked| baked.assets == assets && !is_stale);
    let times_lit = baked.as_deref().map_or(0, |baked| baked.times_lit);
    let fresh = held.is_none().then(|| {
        let (baked, too_large) =
            Baked::new(&device, loaded.iter().map(|object| (object.asset, object.file)), &prepared);
        for (asset, error) in too_large {
            if extracted.warned.size.insert(asset) {
                warn!(
                    "a bake's {} have {} words and {} fit the GPU: it is not lit",
                    error.section, error.words, error.limit
                );
            }
        }
        Baked { times_lit, ..baked }
    });
    let Some(baked) = held.or(fresh.as_ref()) else { return };
    let lit: Vec<_> = loaded.iter().zip(&baked.fits).filter(|(_, fits)| **fits).map(|(object, _)| object).collect();
    for (number, object) in (0..).zip(&lit) {
        extracted.placed.push(object.place);
        let meshes = objects.meshes(object.entity, object.file);
        extracted.parts.extend(meshes.into_iter().map(|mesh| Part { mesh, object: number }));
    }
    let hulls: Vec<_> = lit
        .iter()
        .filter_map(|object| Some((object.entity, object.place, &prepared.0.get(&object.asset)?.hull)))
        .collect();
    for warning in extracted.overlaps.new_warnings(&hulls, |entity| objects.name(entity)) {
        warn!("{warning}");
    }
    if let Some(fresh) = fresh {
        commands.insert_resource(fresh);
    }
}

impl Objects<'_, '_> {
    /// The objects that can be lit, those spawned first before others.
    fn loaded(&self, warned: &mut Warned) -> Vec<Loaded<'_>> {
        let object = |(entity, object, transform): (Entity, &CssmObject, &GlobalTransform)| {
            let (asset, place) = (object.bake.id(), transform.affine());
            Some(Loaded { entity, asset, file: &self.assets.get(asset)?.file, place })
        };
        let mut loaded: Vec<_> = self.objects.iter().filter_map(object).collect();
        let all = loaded.len();
        loaded.retain(|object| is_rigid(object.place));
        if loaded.len() < all && !std::mem::replace(&mut warned.bent, true) {
            warn!("a baked object is stretched or bent by its transform: it is not lit");
        }
        if loaded.len() > CSSM_OBJECTS && !std::mem::replace(&mut warned.many, true) {
            warn!("{} baked objects: {CSSM_OBJECTS} at a time are lit, those that were spawned first", loaded.len());
        }
        loaded.sort_by_key(|object| (object.entity.index_u32(), object.entity.to_bits()));
        loaded.truncate(CSSM_OBJECTS);
        loaded
    }

    /// What a message calls an entity.
    fn name(&self, entity: Entity) -> String {
        self.names.get(entity).map_or_else(|_| entity.to_string(), |name| name.to_string())
    }

    /// The mesh of each part: as [`CssmPart`] says, or by the numbers in the mesh's asset label.
    fn meshes(&self, root: Entity, file: &CssmFile) -> Vec<Option<Entity>> {
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
        let parts = (0..).zip(file.parts.iter());
        let meshes = parts
            .map(|(number, part)| by_part.get(&number).or_else(|| by_label.get(&[part.mesh, part.primitive])).copied());
        meshes.collect()
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
