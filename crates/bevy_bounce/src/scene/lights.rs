//! Point, spot, directional and rect lights, with Bevy's units, cones and ranges.
//!
//! Bevy lights by rect lights only with its feature `area_light_luts`; without it they do not bounce either. It gives them no shadows;
//! their bounced light has what it meets first.
//!
//! What the air takes from directional lights is in `air`.
//!
//! A light takes part while its `InheritedVisibility` is true and a camera with global illumination shares a layer with
//! it, in view or not. Lights without output, `GiLight::OFF` ones and those with values that are not finite are left out.

use std::f32::consts::{FRAC_PI_2, PI};

use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::ecs::query::QueryData;
use bevy::light::{DirectionalLight, PointLight, RectLight, SpotLight, SunDisk};
use bevy::pbr::{MeshPipelineKey, MeshPipelineViewLayoutKey};
use bevy::platform::collections::HashSet;
use bevy::platform::collections::hash_map::Entry;
use bevy::prelude::*;
use bevy::render::Extract;
use bevy_bounce_shaders::types::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_RECT, LIGHT_SPOT, Light};

use super::GiLight;
use super::air::AirOfScene;
use super::extract::{SceneCameras, spawn_order};
use super::regions::Regions;
use super::table::GpuTable;

/// Weights of linear sRGB in luminance. ITU-R BT.709.
const LUMINANCE: Vec3 = Vec3::new(0.2126, 0.7152, 0.0722);

/// A light as the GPU sees it, but for the running sum of the powers.
#[derive(Clone, Copy, Debug)]
struct ExtractedLight {
    light: Light,
    share: f32,
    /// Of a directional light: how wide its sun is, radians.
    diameter: f32,
}

/// Lights by what they are called: each has the least number that is free when it comes, and keeps it while it is there, shining or
/// not, so that its paths stay where they are whatever else shines.
#[derive(Default)]
struct Names {
    of: EntityHashMap<u32>,
}

impl Names {
    /// Names those that are new, and forgets those that are gone; `present` in the order in which they came.
    fn update(&mut self, present: &[Entity]) {
        let known = present.iter().filter(|entity| self.of.contains_key(*entity)).count();
        if known == self.of.len() && known == present.len() {
            return;
        }
        let there: EntityHashSet = present.iter().copied().collect();
        self.of.retain(|entity, _| there.contains(entity));
        let taken: HashSet<u32> = self.of.values().copied().collect();
        let mut free = (0..).filter(|name| !taken.contains(name));
        for &entity in present {
            if let Entry::Vacant(vacant) = self.of.entry(entity) {
                vacant.insert(free.next().unwrap_or_default());
            }
        }
    }
}

/// The lights of this frame, in the order of their entities.
#[derive(Resource, Default)]
pub(super) struct ExtractedLights {
    lights: Vec<(Entity, ExtractedLight)>,
    names: Names,
    /// All there are, shining or not.
    present: Vec<Entity>,
}

type Common =
    (&'static GlobalTransform, &'static InheritedVisibility, Option<&'static GiLight>, Option<&'static RenderLayers>);

type CommonItem<'w, 's> = <Common as QueryData>::Item<'w, 's>;

/// Reads all lights; they are few.
pub(super) fn extract_lights(
    mut extracted: ResMut<ExtractedLights>,
    cameras: Res<SceneCameras>,
    points: Extract<Query<(Entity, &PointLight, Common)>>,
    spots: Extract<Query<(Entity, &SpotLight, Common)>>,
    directionals: Extract<Query<(Entity, &DirectionalLight, Option<&SunDisk>, Common)>>,
    rects: Extract<Query<(Entity, &RectLight, Common)>>,
) {
    let ExtractedLights { lights, names, present } = &mut *extracted;
    lights.clear();
    present.clear();
    if !cameras.active {
        return;
    }
    let mut add = |entity: Entity, common: CommonItem<'_, '_>, light: Light, diameter: f32| {
        present.push(entity);
        let (transform, visibility, gi, layers) = common;
        if !visibility.get() || !cameras.layers.intersects(layers.unwrap_or_default()) {
            return;
        }
        if let Some(light) = placed(light, transform, gi.copied().unwrap_or_default()) {
            lights.push((entity, ExtractedLight { diameter, ..light }));
        }
    };
    for (entity, light, common) in &points {
        add(entity, common, point_light(light), 0.0);
    }
    for (entity, light, common) in &spots {
        add(entity, common, spot_light(light), 0.0);
    }
    for (entity, light, disk, common) in &directionals {
        add(entity, common, directional_light(light), disk.unwrap_or_default().angular_size);
    }
    if bevy_has_rect_lights() {
        for (entity, light, common) in &rects {
            add(entity, common, rect_light(light, common.0), 0.0);
        }
    }
    lights.sort_by_key(|(entity, _)| spawn_order(*entity));
    present.sort_by_key(|entity| spawn_order(*entity));
    names.update(present);
    for (entity, extracted) in lights {
        extracted.light.name = names.of.get(entity).copied().unwrap_or_default();
    }
}

/// bevy_pbr's `extract_lights`: candela are lumens over 4 pi.
fn point_light(light: &PointLight) -> Light {
    Light {
        kind: LIGHT_POINT,
        color: light.color.to_linear().to_vec3() * light.intensity / (4.0 * PI),
        range: range(light.range),
        ..default()
    }
}

/// On the GPU 0 is no limit, and a square must not overflow; a range of 0 reaches nothing, hence -1.
fn range(range: f32) -> f32 {
    if range <= 0.0 {
        -1.0
    } else if range > 1e18 {
        0.0
    } else {
        range
    }
}

/// As a point light: Bevy divides by 4 pi here too, whatever the cone. Cone as bevy_pbr's `prepare_lights`.
fn spot_light(light: &SpotLight) -> Light {
    let outer = if light.outer_angle >= FRAC_PI_2 { FRAC_PI_2 - 1e-4 } else { light.outer_angle };
    let inner = light.inner_angle.min(outer);
    let cos_outer = outer.cos();
    let scale = 1.0 / (inner.cos() - cos_outer).max(1e-4);
    Light {
        kind: LIGHT_SPOT,
        color: light.color.to_linear().to_vec3() * light.intensity / (4.0 * PI),
        range: range(light.range),
        spot_scale: scale,
        spot_cos_outer: cos_outer,
        ..default()
    }
}

fn directional_light(light: &DirectionalLight) -> Light {
    Light { kind: LIGHT_DIRECTIONAL, color: light.color.to_linear().to_vec3() * light.illuminance, ..default() }
}

/// Whether Bevy's shaders know rect lights: it tells by its layouts alone.
fn bevy_has_rect_lights() -> bool {
    MeshPipelineViewLayoutKey::from(MeshPipelineKey::NONE).contains(MeshPipelineViewLayoutKey::AREA_LIGHT_LUTS)
}

/// bevy_pbr's `extract_lights`: lumens over pi and the area, which the scale of its entity changes.
fn rect_light(light: &RectLight, transform: &GlobalTransform) -> Light {
    let matrix = transform.affine().matrix3;
    let half_width = 0.5 * light.width * matrix.x_axis.length();
    let half_height = 0.5 * light.height * matrix.y_axis.length();
    Light {
        kind: LIGHT_RECT,
        color: light.color.to_linear().to_vec3() * light.intensity / (4.0 * half_width * half_height * PI),
        range: range(light.range),
        side: transform.right() * half_width,
        half_height,
        ..default()
    }
}

/// The light where it stands; `None` if it gives no light, or none that could be computed.
fn placed(mut light: Light, transform: &GlobalTransform, gi: GiLight) -> Option<ExtractedLight> {
    light.position = transform.translation();
    light.direction = transform.affine().transform_vector3(Vec3::NEG_Z).try_normalize().unwrap_or(Vec3::NEG_Y);
    light.color = (light.color * gi.intensity).max(Vec3::ZERO);
    light.max_bounces = gi.bounces;
    let shines = light.color.is_finite() && light.color.dot(LUMINANCE) > 0.0;
    let placed = light.position.is_finite() && light.range >= 0.0;
    let cone = light.spot_scale.is_finite();
    let area = light.side.is_finite() && light.half_height.is_finite();
    let weighted = gi.share.is_finite() && gi.share > 0.0 && gi.bounces > 0;
    (shines && placed && cone && area && weighted).then_some(ExtractedLight { light, share: gi.share, diameter: 0.0 })
}

/// Luminous flux by which paths are shared out, lumens: all of a point light's, a spot's within its cone as if it did not
/// fall off, all of a rect light's, and what a directional light casts on the box of the scene; of large scenes, weighted by how
/// near the cameras it is.
fn power(light: &Light, regions: &Regions) -> f32 {
    let luminance = light.color.dot(LUMINANCE);
    if light.kind == LIGHT_DIRECTIONAL {
        return luminance * regions.weighted_area(light.direction);
    }
    let flux = match light.kind {
        LIGHT_POINT => luminance * 4.0 * PI,
        LIGHT_SPOT => luminance * 2.0 * PI * (1.0 - light.spot_cos_outer),
        LIGHT_RECT => luminance * PI * 4.0 * light.side.length() * light.half_height,
        _ => 0.0,
    };
    flux * regions.importance(light.position)
}

/// The lights on the GPU.
#[derive(Resource)]
pub(super) struct Lights {
    /// In the order of their entities.
    pub table: GpuTable<Light>,
    /// Sum of the powers, lumens.
    pub power: f32,
}

impl Default for Lights {
    fn default() -> Self {
        Self { table: GpuTable::new("bounce_lights"), power: 0.0 }
    }
}

/// Sums up the powers of what the air lets through.
pub(super) fn update_lights(
    mut lights: ResMut<Lights>,
    extracted: Res<ExtractedLights>,
    regions: Res<Regions>,
    air: AirOfScene,
) {
    let mut sum = 0.0;
    let lights = &mut *lights;
    let air = air.find();
    lights.table.replace(extracted.lights.iter().filter_map(|(_, extracted)| {
        let mut light = extracted.light;
        if let Some(air) = air.as_ref().filter(|_| light.kind == LIGHT_DIRECTIONAL) {
            light.color *= air.lets_through(-light.direction, extracted.diameter);
        }
        let weight = power(&light, &regions) * extracted.share;
        let next = sum + weight;
        if !(next.is_finite() && next > sum) {
            return None;
        }
        sum = next;
        Some(Light { cumulative_power: sum, ..light })
    }));
    lights.power = sum;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attenuation(light: &Light, angle: f32) -> f32 {
        let x = ((angle.cos() - light.spot_cos_outer) * light.spot_scale).clamp(0.0, 1.0);
        x * x
    }

    #[test]
    fn cone_falls_from_inner_to_outer() {
        let light = spot_light(&SpotLight { inner_angle: 0.3, outer_angle: 0.6, ..default() });
        assert!((attenuation(&light, 0.299) - 1.0).abs() < 1e-4);
        assert!(attenuation(&light, 0.601) < 1e-4);
        assert!((0.05..0.95).contains(&attenuation(&light, 0.45)));
    }

    #[test]
    fn a_cone_of_no_width_is_sharp_and_finite() {
        let light = spot_light(&SpotLight { inner_angle: 0.5, outer_angle: 0.5, ..default() });
        assert!(light.spot_scale.is_finite() && attenuation(&light, 0.51) == 0.0 && attenuation(&light, 0.48) == 1.0);
        let wide = spot_light(&SpotLight { inner_angle: 3.0, outer_angle: 2.0, ..default() });
        assert!(wide.spot_cos_outer > 0.0 && wide.spot_cos_outer < 1e-3);
    }

    #[test]
    fn power_of_each_kind() {
        let bounds = Regions::of(Vec3::ZERO, Vec3::new(2.0, 3.0, 5.0));
        let white = Color::WHITE;
        let point = point_light(&PointLight { color: white, intensity: 800.0, ..default() });
        assert!((power(&point, &bounds) - 800.0).abs() < 0.01);
        let spot = SpotLight { color: white, intensity: 800.0, outer_angle: PI / 3.0, ..default() };
        assert!((power(&spot_light(&spot), &bounds) - 200.0).abs() < 0.01);
        let sun = directional_light(&DirectionalLight { color: white, illuminance: 100.0, ..default() });
        let sun = Light { direction: Vec3::NEG_Y, ..sun };
        assert!((power(&sun, &bounds) - 1000.0).abs() < 0.01);
        let panel = RectLight { color: white, intensity: 800.0, width: 0.5, height: 3.0, ..default() };
        for scale in [Vec3::ONE, Vec3::new(2.0, 0.5, 1.0)] {
            let panel = rect_light(&panel, &GlobalTransform::from_scale(scale));
            assert!((power(&panel, &bounds) - 800.0).abs() < 0.01, "{scale}");
        }
    }

    #[test]
    fn lights_keep_their_names() {
        let [a, b, c, d] = [3, 5, 6, 9].map(|index| Entity::from_raw_u32(index).expect("not the last"));
        let mut names = Names::default();
        let mut called = |present: &[Entity]| {
            names.update(present);
            present.iter().map(|entity| names.of[entity]).collect::<Vec<_>>()
        };
        assert_eq!(called(&[a, b, c]), [0, 1, 2]);
        assert_eq!(called(&[b, c]), [1, 2], "one that goes changes no other");
        assert_eq!(called(&[b, c, d]), [1, 2, 0], "its name is free");
        assert_eq!(called(&[a, b, c, d]), [3, 1, 2, 0]);
        assert!(called(&[]).is_empty());
        assert_eq!(called(&[d]), [0]);
    }

    #[test]
    fn lights_that_give_nothing_are_left_out() {
        let here = GlobalTransform::IDENTITY;
        let light = point_light(&PointLight::default());
        assert!(placed(light, &here, GiLight::default()).is_some());
        assert!(placed(light, &here, GiLight::OFF).is_none());
        assert!(placed(light, &GlobalTransform::from_xyz(f32::NAN, 0.0, 0.0), GiLight::default()).is_none());
        assert!(placed(point_light(&PointLight { range: 0.0, ..default() }), &here, GiLight::default()).is_none());
        assert!(
            placed(point_light(&PointLight { range: f32::INFINITY, ..default() }), &here, GiLight::default()).is_some()
        );
        assert!(placed(Light { color: Vec3::INFINITY, ..light }, &here, GiLight::default()).is_none());
        let line = RectLight { width: 0.0, ..default() };
        assert!(placed(rect_light(&line, &here), &here, GiLight::default()).is_none());
        let zero_scale = GlobalTransform::from_scale(Vec3::ZERO);
        assert!(placed(light, &zero_scale, GiLight::default()).is_some_and(|l| l.light.direction == Vec3::NEG_Y));
    }
}
