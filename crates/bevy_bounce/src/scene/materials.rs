//! What bounced light needs to know of a `StandardMaterial`.
//!
//! - Albedo is base colour times 1 - diffuse transmission, as in Bevy's lighting, and as well for metals: they send on what they
//!   reflect, which is nearly their base colour at every roughness, and it counts as if they did so evenly to all sides. So does
//!   what dielectrics reflect before light comes to their colour: two to eight percent.
//! - Blended, additive, multiplied and premultiplied surfaces, and those that transmit specularly (glass), are not there:
//!   light passes them.
//! - Masked surfaces let through the share of light that their holes do. A texel of their thumbnail has the share of
//!   the texture's texels whose alpha, times that of the base colour, reaches the cutoff; alpha to coverage cuts at
//!   0.5. Vertices whose alpha, times that of the base colour, is below it take away all around them. Shadow maps of
//!   virtual lights know the share of each sixteenth of a triangle, cells of the voxel grid that of their surfaces;
//!   which texels and which places of a voxel are holes is drawn, the same every frame.
//! - Unlit surfaces are as bright as their base colour whatever shines on them: they neither reflect nor emit, and block where
//!   they cast shadows.
//! - Emission is what is seen: Bevy shows it without exposure but for `emissive_exposure_weight`, so that its radiance is
//!   `emissive * mix(1 / exposure, 1, weight)` cd/m^2, by the exposure of the first camera with global illumination.
//! - Both sides reflect where `double_sided` is set or nothing is culled; `Face::Front` culled turns the surface round.
//! - Textures count as thumbnails of 16x16 means, beyond their edges as their samplers say; until they are loaded the
//!   surface is not there, as in Bevy.
//! - Vertex colours multiply base colour and its alpha, as in Bevy's lighting. Second UV sets are not looked at.

use bevy::asset::UntypedAssetId;
use bevy::math::{Affine2, Vec2, Vec3, Vec4};
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::prelude::*;
use bevy::render::render_resource::Face;
use bevy::render::renderer::RenderDevice;
use bevy_bounce_shaders::types::{Material, NONE};

use super::allocator::SlotAllocator;
use super::extract::{ExtractedMaterials, SceneCameras};
use super::table::{GpuTable, buffer_limit};
use super::thumbnails::{Thumbnail, ThumbnailKey, Thumbnails};

/// Mean over the hemisphere, weighted by its cosine, of what GGX reflects at the perceptual roughness 0, 1/4, 1/2, 3/4 and 1: factor
/// of the reflectance of the surface as seen from above, and what is added to it. Schlick's Fresnel, Smith's shadowing, one bounce.
const GGX_ALBEDO: [Vec2; 5] = [
    Vec2::new(0.952, 0.0476),
    Vec2::new(0.946, 0.0390),
    Vec2::new(0.862, 0.0190),
    Vec2::new(0.653, 0.0072),
    Vec2::new(0.406, 0.0027),
];

/// Share of light that a dielectric reflects at its surface.
fn dielectric_albedo(material: &StandardMaterial) -> f32 {
    let unit = |x: f32| if x.is_finite() { x.clamp(0.0, 1.0) } else { 0.0 };
    let f_zero = 0.16 * unit(material.reflectance).powi(2);
    let at = 4.0 * unit(material.perceptual_roughness);
    let below = (at as usize).min(3);
    let ggx = GGX_ALBEDO[below].lerp(GGX_ALBEDO[below + 1], at - below as f32);
    // As in Bevy's lighting: less than two percent is to reflect nothing.
    (f_zero * ggx.x + ggx.y) * (50.0 * f_zero).min(1.0)
}

/// Alpha of a texture, in 255ths, from which a masked surface is there: times that of the base colour, it reaches the cutoff.
fn texture_cutoff(cutoff: f32, base_alpha: f32) -> u8 {
    (cutoff / base_alpha.max(cutoff) * 255.0).ceil().max(1.0) as u8
}

/// The part of a `StandardMaterial` that counts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface {
    /// Linear; alpha as in the material. Multiplies the thumbnail.
    albedo: Vec4,
    albedo_thumbnail: Option<ThumbnailKey>,
    specular: f32,
    /// As in the material. Multiplies the thumbnail.
    emissive: Vec3,
    emissive_thumbnail: Option<ThumbnailKey>,
    emissive_exposure_weight: f32,
    uv_transform: Affine2,
    alpha_cutoff: f32,
    /// Light passes it.
    transparent: bool,
    two_sided: bool,
    /// Its front is where the winding is clockwise.
    flipped: bool,
    /// Does nothing but block.
    unlit: bool,
}

impl Surface {
    /// See the module.
    pub fn of(material: &StandardMaterial) -> Self {
        let finite = |x: f32| if x.is_finite() { x } else { 0.0 };
        let unit = |x: f32| finite(x).clamp(0.0, 1.0);
        let base_color = material.base_color.to_linear().to_f32_array().map(unit);
        let alpha_cutoff = match material.alpha_mode {
            AlphaMode::Mask(cutoff) => unit(cutoff),
            AlphaMode::AlphaToCoverage => 0.5,
            _ => 0.0,
        };
        let transparent = material.specular_transmission > 0.0
            || !matches!(material.alpha_mode, AlphaMode::Opaque | AlphaMode::Mask(_) | AlphaMode::AlphaToCoverage);
        let albedo_scale = if material.unlit { 0.0 } else { 1.0 - unit(material.diffuse_transmission) };
        let masked = alpha_cutoff > 0.0;
        let color = material.base_color_texture.as_ref().filter(|_| masked || !material.unlit);
        let cutoff = if masked { texture_cutoff(alpha_cutoff, base_color[3]) } else { 0 };
        let albedo_thumbnail = color.map(|image| ThumbnailKey { image: image.id(), cutoff });
        let emissive = Vec3::from(material.emissive.to_f32_array_no_alpha().map(|x| finite(x).max(0.0)));
        let emissive = if material.unlit { Vec3::ZERO } else { emissive };
        let emissive_thumbnail = material
            .emissive_texture
            .as_ref()
            .filter(|_| emissive != Vec3::ZERO)
            .map(|image| ThumbnailKey { image: image.id(), cutoff: 0 });
        Self {
            albedo: Vec4::from_array(base_color) * Vec3::splat(albedo_scale).extend(1.0),
            albedo_thumbnail,
            specular: if material.unlit { 0.0 } else { (1.0 - unit(material.metallic)) * dielectric_albedo(material) },
            emissive,
            emissive_thumbnail,
            emissive_exposure_weight: unit(material.emissive_exposure_weight),
            uv_transform: if material.uv_transform.is_finite() { material.uv_transform } else { Affine2::IDENTITY },
            alpha_cutoff,
            transparent,
            two_sided: material.double_sided || material.cull_mode.is_none(),
            flipped: material.cull_mode == Some(Face::Front),
            unlit: material.unlit,
        }
    }

    fn thumbnails(&self) -> impl Iterator<Item = ThumbnailKey> {
        self.albedo_thumbnail.into_iter().chain(self.emissive_thumbnail)
    }

    fn to_gpu(&self, exposure: f32, thumbnails: impl Fn(ThumbnailKey) -> Thumbnail) -> Material {
        let offset = |key: Option<ThumbnailKey>| match key.map(&thumbnails) {
            Some(Thumbnail::At(offset)) => offset,
            Some(Thumbnail::Pending | Thumbnail::None) | None => NONE,
        };
        let weight = self.emissive_exposure_weight;
        let row = |x: f32, y: f32, offset: f32| Vec4::new(x, y, offset, 0.0);
        let uv = self.uv_transform;
        Material {
            albedo: self.albedo,
            emissive: (self.emissive * ((1.0 - weight) / exposure + weight)).min(Vec3::splat(f32::MAX)),
            alpha_cutoff: self.alpha_cutoff,
            uv_x: row(uv.matrix2.x_axis.x, uv.matrix2.y_axis.x, uv.translation.x),
            uv_y: row(uv.matrix2.x_axis.y, uv.matrix2.y_axis.y, uv.translation.y),
            albedo_thumbnail: offset(self.albedo_thumbnail),
            emissive_thumbnail: offset(self.emissive_thumbnail),
            specular: self.specular,
            padding: 0,
        }
    }
}

/// What an instance takes from its material.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct MaterialClass {
    /// Index into the materials.
    pub slot: u32,
    /// Stops light, and has all its images.
    pub present: bool,
    /// Reflects on both sides.
    pub two_sided: bool,
    /// Its front is where the winding is clockwise.
    pub flipped: bool,
    /// Shines by itself.
    pub emits: bool,
    /// Does nothing but block.
    pub unlit: bool,
    /// Light passes it.
    pub transparent: bool,
}

struct Record {
    surface: Surface,
    class: MaterialClass,
}

/// All materials, used or not.
#[derive(Resource)]
pub(super) struct Materials {
    /// By slot.
    pub table: GpuTable<Material>,
    slots: SlotAllocator,
    records: HashMap<UntypedAssetId, Record>,
    exposure: f32,
    /// To be written.
    stale: HashSet<UntypedAssetId>,
    changed: HashSet<UntypedAssetId>,
}

impl Default for Materials {
    fn default() -> Self {
        Self {
            table: GpuTable::new("bounce_materials"),
            slots: SlotAllocator::default(),
            records: HashMap::default(),
            exposure: 1.0,
            stale: HashSet::default(),
            changed: HashSet::default(),
        }
    }
}

impl Materials {
    /// What an instance needs to know; `None` for a material that is not loaded.
    pub fn class(&self, id: UntypedAssetId) -> Option<MaterialClass> {
        self.records.get(&id).map(|record| record.class)
    }

    /// Largest component of the radiance that any emits, cd/m^2.
    pub fn max_emission(&self) -> f32 {
        self.table.values().iter().map(|material| material.emissive.max_element()).fold(0.0, f32::max)
    }

    /// Those whose class is another than at the last call.
    pub fn take_changed(&mut self) -> HashSet<UntypedAssetId> {
        std::mem::take(&mut self.changed)
    }

    fn insert(&mut self, id: UntypedAssetId, surface: Surface, thumbnails: &mut Thumbnails, limit: u32) {
        let slot = match self.records.get(&id) {
            Some(record) => Some(record.class.slot),
            None => self.slots.allocate(limit),
        };
        let Some(slot) = slot else { return };
        surface.thumbnails().for_each(|key| thumbnails.acquire(key));
        let class = MaterialClass { slot, ..default() };
        if let Some(before) = self.records.get_mut(&id) {
            before.surface.thumbnails().for_each(|key| thumbnails.release(key));
            before.surface = surface;
        } else {
            self.records.insert(id, Record { surface, class });
        }
        self.stale.insert(id);
    }

    fn remove(&mut self, id: UntypedAssetId, thumbnails: &mut Thumbnails) {
        if let Some(record) = self.records.remove(&id) {
            record.surface.thumbnails().for_each(|key| thumbnails.release(key));
            self.slots.free(record.class.slot);
            self.changed.insert(id);
        }
    }

    /// All must be written anew.
    pub fn mark_all(&mut self) {
        self.stale.extend(self.records.keys().copied());
    }

    /// Asks for all thumbnails again: those there were are lost.
    pub fn reacquire(&mut self, thumbnails: &mut Thumbnails) {
        self.records.values().flat_map(|record| record.surface.thumbnails()).for_each(|key| thumbnails.acquire(key));
        self.mark_all();
    }
}

/// Follows the materials and the exposure.
pub(super) fn update_materials(
    mut materials: ResMut<Materials>,
    mut extracted: ResMut<ExtractedMaterials>,
    mut thumbnails: ResMut<Thumbnails>,
    cameras: Res<SceneCameras>,
    device: Res<RenderDevice>,
) {
    let limit = (buffer_limit(&device).0 / GpuTable::<Material>::stride()) as u32;
    if materials.exposure != cameras.exposure {
        materials.exposure = cameras.exposure;
        materials.mark_all();
    }
    for (id, surface) in extracted.changed.drain(..) {
        match surface {
            Some(surface) => materials.insert(id, surface, &mut thumbnails, limit),
            None => materials.remove(id, &mut thumbnails),
        }
    }
}

/// Writes the materials that changed, or whose thumbnails did.
pub(super) fn resolve_materials(mut materials: ResMut<Materials>, mut thumbnails: ResMut<Thumbnails>) {
    let materials = &mut *materials;
    if thumbnails.take_settled() {
        materials.mark_all();
    }
    for id in materials.stale.drain() {
        let Some(record) = materials.records.get_mut(&id) else { continue };
        let surface = &record.surface;
        let class = MaterialClass {
            slot: record.class.slot,
            present: !surface.transparent && surface.thumbnails().all(|key| thumbnails.get(key) != Thumbnail::Pending),
            two_sided: surface.two_sided,
            flipped: surface.flipped,
            emits: surface.emissive != Vec3::ZERO,
            unlit: surface.unlit,
            transparent: surface.transparent,
        };
        let gpu = surface.to_gpu(materials.exposure, |key| thumbnails.get(key));
        materials.table.set(class.slot as usize, gpu);
        if record.class != class {
            record.class = class;
            materials.changed.insert(id);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gpu(material: StandardMaterial, exposure: f32) -> Material {
        Surface::of(&material).to_gpu(exposure, |_| Thumbnail::Pending)
    }

    #[test]
    fn metals_send_their_base_color_on() {
        for metallic in [0.0, 0.5, 1.0] {
            let material =
                StandardMaterial { base_color: LinearRgba::rgb(0.5, 1.0, 0.25).into(), metallic, ..default() };
            assert!(gpu(material, 1.0).albedo.abs_diff_eq(Vec4::new(0.5, 1.0, 0.25, 1.0), 1e-6));
        }
    }

    /// As a path tracer's GGX does, by quadrature; matt surfaces and metals have nothing before their colour.
    #[test]
    fn dielectrics_reflect_at_their_surface() {
        let of = |reflectance, perceptual_roughness, metallic| {
            gpu(StandardMaterial { reflectance, perceptual_roughness, metallic, ..default() }, 1.0).specular
        };
        for (roughness, expected) in [(0.15, 0.0834), (0.3, 0.0728), (0.5, 0.0535), (0.65, 0.0403), (0.8, 0.0297)] {
            assert!((of(0.5, roughness, 0.0) - expected).abs() < 0.004, "{roughness}: {}", of(0.5, roughness, 0.0));
        }
        assert_eq!((of(0.0, 1.0, 0.0), of(0.5, 0.3, 1.0)), (0.0, 0.0));
        assert!(of(f32::NAN, f32::INFINITY, 0.0) == 0.0 && of(1e9, 0.0, 0.0) < 0.25);
    }

    #[test]
    fn emission_is_what_is_seen() {
        let lamp = |weight| StandardMaterial {
            emissive: LinearRgba::rgb(8.0, 4.0, 0.0),
            emissive_exposure_weight: weight,
            ..default()
        };
        assert_eq!(gpu(lamp(0.0), 0.5).emissive, Vec3::new(16.0, 8.0, 0.0));
        assert_eq!(gpu(lamp(1.0), 0.5).emissive, Vec3::new(8.0, 4.0, 0.0));
        assert_eq!(gpu(lamp(0.5), 0.5).emissive, Vec3::new(12.0, 6.0, 0.0));
        let unlit = StandardMaterial { unlit: true, ..lamp(0.0) };
        assert_eq!((gpu(unlit.clone(), 1.0).emissive, gpu(unlit, 1.0).albedo), (Vec3::ZERO, Vec4::W));
    }

    #[test]
    fn light_passes_what_is_blended() {
        let passes = |alpha_mode| Surface::of(&StandardMaterial { alpha_mode, ..default() }).transparent;
        assert!(
            [AlphaMode::Blend, AlphaMode::Add, AlphaMode::Multiply, AlphaMode::Premultiplied].map(passes) == [true; 4]
        );
        assert!(![AlphaMode::Opaque, AlphaMode::Mask(0.3), AlphaMode::AlphaToCoverage].into_iter().any(passes));
    }

    #[test]
    fn a_texture_is_cut_where_it_makes_the_surface_end() {
        let of = |cutoff, alpha| {
            let material = StandardMaterial {
                base_color: Color::linear_rgba(1.0, 1.0, 1.0, alpha),
                base_color_texture: Some(Handle::default()),
                alpha_mode: AlphaMode::Mask(cutoff),
                ..default()
            };
            Surface::of(&material).albedo_thumbnail.map(|key| key.cutoff)
        };
        assert_eq!(
            [of(0.5, 1.0), of(0.5, 0.5), of(0.5, 0.1), of(1.0, 1.0)].map(Option::unwrap_or_default),
            [128, 255, 255, 255]
        );
        assert_eq!((of(0.0, 1.0), of(1e-6, 1.0)), (Some(0), Some(1)));
    }

    #[test]
    fn uv_rows_are_the_transform() {
        let uv_transform = Affine2::from_scale_angle_translation(Vec2::new(2.0, 3.0), 0.4, Vec2::new(0.1, 0.2));
        let material = gpu(StandardMaterial { uv_transform, ..default() }, 1.0);
        let uv = Vec3::new(0.3, 0.7, 1.0);
        let found = Vec2::new(material.uv_x.truncate().dot(uv), material.uv_y.truncate().dot(uv));
        assert!(found.abs_diff_eq(uv_transform.transform_point2(uv.truncate()), 1e-6));
    }

    #[test]
    fn nothing_that_is_not_finite_gets_through() {
        let material = StandardMaterial {
            base_color: LinearRgba::rgb(f32::NAN, 2.0, -1.0).into(),
            emissive: LinearRgba::rgb(f32::INFINITY, f32::NAN, 1.0),
            metallic: f32::NAN,
            uv_transform: Affine2::from_scale(Vec2::NAN),
            ..default()
        };
        let material = gpu(material, 1e-30);
        assert_eq!(material.albedo, Vec4::new(0.0, 1.0, 0.0, 1.0));
        assert!(material.emissive.is_finite() && material.uv_x == Vec4::X);
    }
}
