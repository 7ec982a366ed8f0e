//! Light of a baked object's texels, one by one.

use std::f32::consts::PI;

use bevy::math::Vec3;
use bevy_bounce_cssm::{CssmFile, Texel};
use bevy_bounce_shaders::types::{LIGHT_DIRECTIONAL, LIGHT_RECT, LIGHT_SPOT, Light};

/// All texels.
pub fn texels(file: &CssmFile) -> Vec<Texel> {
    (0..file.meta.texels as usize).filter_map(|index| file.texel(index)).collect()
}

/// Irradiance by lights, of an object that stands where it was baked.
pub fn direct(file: &CssmFile, texel: &Texel, lights: &[Light]) -> Vec3 {
    let (position, normal) = (Vec3::from(texel.position), Vec3::from(texel.normal));
    let mut sum = Vec3::ZERO;
    for light in lights {
        if light.kind == LIGHT_DIRECTIONAL {
            let cosine = -normal.dot(light.direction);
            if cosine > 0.0 && file.seen_from_outside(texel.position, light.direction.into()) {
                sum += light.color * cosine;
            }
            continue;
        }
        if light.kind == LIGHT_RECT {
            sum += light.color * rect(file, texel, light);
            continue;
        }
        let way = light.position - position;
        let square = way.length_squared();
        let direction = way / square.sqrt();
        let mut strength = normal.dot(direction).max(0.0) / square;
        if light.range > 0.0 {
            let window = 1.0 - (square / (light.range * light.range)).powi(2);
            strength *= window.clamp(0.0, 1.0).powi(2);
        }
        if light.kind == LIGHT_SPOT {
            let cone = (-direction.dot(light.direction) - light.spot_cos_outer) * light.spot_scale;
            strength *= cone.clamp(0.0, 1.0).powi(2);
        }
        if strength > 0.0 && file.sees(texel, light.position.into()) {
            sum += light.color * strength;
        }
    }
    sum
}

/// Irradiance over radiance by a rect light without an end: by four discs of its area.
fn rect(file: &CssmFile, texel: &Texel, light: &Light) -> f32 {
    let (position, normal) = (Vec3::from(texel.position), Vec3::from(texel.normal));
    let up = light.side.cross(light.direction).normalize() * light.half_height;
    let area = light.side.length() * light.half_height;
    let parts = [(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)];
    let of_part = |(x, y): (f32, f32)| {
        let point = light.position + light.side * x + up * y;
        let way = point - position;
        let direction = way.normalize();
        let cosines = normal.dot(direction).max(0.0) * (-direction.dot(light.direction)).max(0.0);
        let visible = cosines > 0.0 && file.sees(texel, point.into());
        if visible { cosines * area / (way.length_squared() + area / PI) } else { 0.0 }
    };
    parts.into_iter().map(of_part).sum()
}

/// A baked object that was moved and not turned: texels, each with a radiance.
pub struct Object<'a> {
    /// Its bake.
    pub file: &'a CssmFile,
    /// Where its space's origin is in the world.
    pub origin: Vec3,
    /// Of all its texels.
    pub radiance: &'a [Vec3],
}

/// Irradiance over pi at a texel of one of several objects, from all texels of all of them.
pub fn gather(objects: &[Object], receiver: usize, index: usize) -> Vec3 {
    let on = &objects[receiver];
    let to = on.file.texel(index).expect("there are so many");
    let (position, normal) = (Vec3::from(to.position) + on.origin, Vec3::from(to.normal));
    let mut sum = [0.0_f64; 3];
    for (number, object) in objects.iter().enumerate() {
        for (texel, radiance) in texels(object.file).iter().zip(object.radiance) {
            let place = Vec3::from(texel.position) + object.origin;
            let way = place - position;
            let square = way.length_squared();
            let sender = -Vec3::from(texel.normal).dot(way);
            let form_factor = if square < 16.0 * texel.area {
                square_form_factor(way, texel, normal)
            } else {
                texel.area * normal.dot(way).max(0.0) * sender / (square * (PI * square + texel.area))
            };
            if sender <= 0.0 || form_factor <= 0.0 {
                continue;
            }
            let at = |object: &Object, point: Vec3| (point - object.origin).to_array();
            let seen = if number == receiver {
                object.file.visible(texel, at(object, position))
            } else {
                object.file.sees(texel, at(object, position)) && on.file.sees(&to, at(on, place))
            };
            let mut others = (0..objects.len()).filter(|other| *other != number && *other != receiver);
            let hides = |other: usize| {
                let other = &objects[other];
                other.file.stands_between(at(other, place), at(other, position))
            };
            if seen && !others.any(hides) {
                (0..3).for_each(|channel| sum[channel] += f64::from(radiance[channel] * form_factor));
            }
        }
    }
    Vec3::from(sum.map(|sum| sum as f32))
}

/// Of a square of the texel's area; Lambert 1760.
fn square_form_factor(way: Vec3, texel: &Texel, receiver: Vec3) -> f32 {
    let normal = Vec3::from(texel.normal);
    let helper = if normal.z.abs() < 0.9 { Vec3::Z } else { Vec3::X };
    let across = helper.cross(normal).normalize() * (0.5 * texel.area.sqrt());
    let up = normal.cross(across);
    let corners = [way - across - up, way + across - up, way + across + up, way - across + up].map(Vec3::normalize);
    let edge = |a: Vec3, b: Vec3| a.cross(b).normalize_or_zero() * a.angle_between(b);
    let sum: Vec3 = (0..4).map(|i| edge(corners[i], corners[(i + 1) % 4])).sum();
    (-sum.dot(receiver) / (2.0 * PI)).max(0.0)
}
