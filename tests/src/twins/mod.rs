//! CPU twins of the shaders: plain Rust on the same input, kept as close to the WGSL as the language allows, so that the
//! two can be read side by side.

pub mod clusters;
pub mod cssm;
pub mod grid;
pub mod near;
pub mod random;
pub mod sampling;
pub mod ssbc;
pub mod voxels;

use bevy::math::{Vec2, Vec3};

fn sign_not_zero(v: Vec2) -> Vec2 {
    Vec2::new(if v.x >= 0.0 { 1.0 } else { -1.0 }, if v.y >= 0.0 { 1.0 } else { -1.0 })
}

/// Twin of `shared/octahedral.wgsl`.
pub fn encode_unit(n: Vec3) -> u32 {
    let p = Vec2::new(n.x, n.y) / (n.x.abs() + n.y.abs() + n.z.abs());
    let p = if n.z >= 0.0 { p } else { (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign_not_zero(p) };
    let snorm = |c: f32| u32::from((0.5 + 32767.0 * c.clamp(-1.0, 1.0)).floor() as i16 as u16);
    snorm(p.x) | snorm(p.y) << 16
}

/// Twin of `shared/octahedral.wgsl`.
pub fn decode_unit(word: u32) -> Vec3 {
    let unorm = |half: u32| (f32::from(half as u16 as i16) / 32767.0).max(-1.0);
    let p = Vec2::new(unorm(word & 0xffff), unorm(word >> 16));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let xy = if z >= 0.0 { p } else { (Vec2::ONE - Vec2::new(p.y, p.x).abs()) * sign_not_zero(p) };
    xy.extend(z).normalize()
}
