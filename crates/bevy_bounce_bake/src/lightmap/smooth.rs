//! Noise of the rays, evened out where the difference between texels is no more than that.
//!
//! A bilateral filter (Tomasi and Manduchi 1998) within each chart, whose tolerance follows from the rays of the texels
//! themselves: edges that are clearer than the noise stay. The fewer rays, the more it does.

use glam::{IVec2, Vec3};
use rayon::prelude::*;

use super::radiosity::Gathered;
use crate::atlas::Atlas;

/// Texels that are looked at to each side.
const RADIUS: i32 = 2;

/// Tolerance in standard errors of independent rays, which these are not: points that cover the square evenly err by
/// less.
const TOLERANCE: f32 = 0.5;

/// The light of all texels, evened out.
pub fn smooth(atlas: &Atlas, cells: &[Option<u32>], gathered: &[Option<Gathered>]) -> Vec<Option<Vec3>> {
    let texels = (0..gathered.len()).into_par_iter();
    texels.map(|texel| Some(mean(atlas, cells, gathered, texel, gathered[texel].as_ref()?))).collect()
}

fn mean(atlas: &Atlas, cells: &[Option<u32>], gathered: &[Option<Gathered>], texel: usize, middle: &Gathered) -> Vec3 {
    let here = &atlas.texels[texel].texel;
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for y in -RADIUS..=RADIUS {
        for x in -RADIUS..=RADIUS {
            let at = IVec2::new(here.cell[0] as i32 + x, here.cell[1] as i32 + y);
            if at.min_element() < 0 || at.as_uvec2().cmpge(atlas.size).any() {
                continue;
            }
            let near = cells[(at.y as u32 * atlas.size.x + at.x as u32) as usize];
            let near = near.filter(|&near| atlas.texels[near as usize].texel.chart == here.chart);
            let Some(near) = near.and_then(|near| gathered[near as usize].as_ref()) else { continue };
            let variance = (middle.variance + near.variance).element_sum();
            let tolerated = (TOLERANCE * TOLERANCE * variance).max(f32::MIN_POSITIVE);
            let weight = (-0.5 * middle.light.distance_squared(near.light) / tolerated).exp();
            sum += near.light * weight;
            weights += weight;
        }
    }
    sum / weights
}
