//! Lights of a glTF file (`KHR_lights_punctual`), as Bevy 0.19 loads and shades them.
//!
//! - Their colours are taken for sRGB, as Bevy's loader takes them.
//! - Point and spot lights without a `range` reach 20 units. Towards the end of its range a light fades out:
//!   `saturate(1 - (d / range)^4)^2` (Karis, *Real Shading in Unreal Engine 4*, 2013).
//! - The cone of a spot light fades out by the square of what is linear in the cosine, from the inner to the outer angle.
//! - What is within 0.1 units of a point or spot light casts no shadow: it is nearer than Bevy's shadow maps begin.

use std::f32::consts::FRAC_PI_2;

use glam::{Mat4, Vec3};
use gltf::khr_lights_punctual::Kind;

use super::materials::linear;
use super::{Source, read::placed_nodes};
use crate::BakeError;

/// Range of lights that name none, world units.
const DEFAULT_RANGE: f32 = 20.0;
/// Where Bevy's shadow maps of point and spot lights begin, world units.
const NEAR: f32 = 0.1;
/// Squared distance below which light does not grow any more.
const LEAST_DISTANCE_SQUARED: f32 = 1.0e-4;
/// Least difference between the cosines of a spot light's angles.
const LEAST_CONE: f32 = 1.0e-4;

/// A point, spot or directional light.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Candela; lux of directional lights.
    color: Vec3,
    /// World units.
    position: Vec3,
    /// The way that the light goes, unit length.
    direction: Vec3,
    shape: Shape,
}

#[derive(Clone, Copy, Debug)]
enum Shape {
    Directional,
    /// The cone's factor is `saturate(cosine * scale + offset)^2`.
    Local {
        inverse_range_squared: f32,
        scale: f32,
        offset: f32,
    },
}

/// What a light gives to a place if nothing stands between.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Towards the light, unit length.
    pub direction: Vec3,
    /// How far away occluders count, world units.
    pub distance: f32,
    /// On a surface that faces the light, lux.
    pub illuminance: Vec3,
}

/// The lights of the default scene.
pub fn lights(source: &Source) -> Result<Vec<Light>, BakeError> {
    let Some(scene) = source.gltf.default_scene().or_else(|| source.gltf.scenes().next()) else {
        return Ok(Vec::new());
    };
    let nodes = placed_nodes(&scene).map_err(|problem| BakeError::source(&source.name, problem))?;
    let lights = nodes.iter().filter_map(|(node, transform)| Some((node, Light::new(&node.light()?, *transform))));
    lights
        .map(|(node, light)| {
            let finite = light.color.is_finite() && light.position.is_finite() && light.direction.is_finite();
            let wrong = || format!("node {}: its light's numbers are not finite; export it anew", node.index());
            finite.then_some(light).ok_or_else(|| BakeError::source(&source.name, wrong()))
        })
        .collect()
}

impl Light {
    fn new(light: &gltf::khr_lights_punctual::Light, transform: Mat4) -> Self {
        let range = light.range().unwrap_or(DEFAULT_RANGE);
        let local = |scale, offset| Shape::Local { inverse_range_squared: 1.0 / (range * range), scale, offset };
        let shape = match light.kind() {
            Kind::Directional => Shape::Directional,
            Kind::Point => local(0.0, 1.0),
            Kind::Spot { inner_cone_angle, outer_cone_angle } => {
                let outer = outer_cone_angle.min(FRAC_PI_2 - 1.0e-4);
                let scale = 1.0 / (inner_cone_angle.min(outer).cos() - outer.cos()).max(LEAST_CONE);
                local(scale, -outer.cos() * scale)
            }
        };
        Self {
            color: Vec3::from(light.color().map(linear)) * light.intensity(),
            position: transform.w_axis.truncate(),
            direction: transform.transform_vector3(Vec3::NEG_Z).normalize_or(Vec3::NEG_Z),
            shape,
        }
    }

    /// What comes to a place; nothing where the light does not reach.
    pub fn ray_from(&self, place: Vec3) -> Option<Ray> {
        let Shape::Local { inverse_range_squared, scale, offset } = self.shape else {
            return Some(Ray { direction: -self.direction, distance: f32::INFINITY, illuminance: self.color });
        };
        let way = self.position - place;
        let (squared, length) = (way.length_squared(), way.length());
        let direction = way / length;
        let fade = (1.0 - (squared * inverse_range_squared).powi(2)).clamp(0.0, 1.0).powi(2);
        let cone = (scale * self.direction.dot(-direction) + offset).clamp(0.0, 1.0).powi(2);
        let illuminance = self.color * (fade * cone / squared.max(LEAST_DISTANCE_SQUARED));
        (length > 0.0 && illuminance.max_element() > 0.0).then_some(Ray {
            direction,
            distance: (length - NEAR).max(0.0),
            illuminance,
        })
    }
}
