//! Directions of rays: fixed points that cover a square evenly, shifted for each texel.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};

/// Steps of the additive recurrence R2 (Roberts, *The Unreasonable Effectiveness of Quasirandom Sequences*, 2018): the
/// inverses of the plastic number and of its square, as shares of 2^32.
const STEPS: [u32; 2] = [3_242_174_889, 2_447_445_414];

/// A sequence of points in the unit square, another one for each seed.
#[derive(Clone, Copy)]
pub struct Points([u32; 2]);

impl Points {
    pub fn new(seed: u32) -> Self {
        let first = hash(seed);
        Self([first, hash(first)])
    }

    pub fn at(self, index: u32) -> Vec2 {
        let unit =
            |axis: usize| (self.0[axis].wrapping_add(STEPS[axis].wrapping_mul(index)) >> 8) as f32 / 16_777_216.0;
        Vec2::new(unit(0), unit(1))
    }
}

/// PCG's output permutation (Jarzynski and Olano, *Hash Functions for GPU Rendering*, 2020).
fn hash(seed: u32) -> u32 {
    let state = seed.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A direction about `normal` with density cosine over pi (Malley's method).
pub fn cosine_direction(normal: Vec3, point: Vec2) -> Vec3 {
    let (across, along) = normal.any_orthonormal_pair();
    let (sin, cos) = (TAU * point.y).sin_cos();
    let radius = point.x.sqrt();
    (across * (radius * cos) + along * (radius * sin) + normal * (1.0 - point.x).max(0.0).sqrt()).normalize()
}

/// A direction anywhere, evenly.
pub fn sphere_direction(point: Vec2) -> Vec3 {
    let height = 1.0 - 2.0 * point.x;
    let radius = (1.0 - height * height).max(0.0).sqrt();
    let (sin, cos) = (TAU * point.y).sin_cos();
    Vec3::new(radius * cos, radius * sin, height)
}
