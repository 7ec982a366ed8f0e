//! Radiosity between texels: light from lamps by shadow rays, from texel to texel by rays with a cosine distribution.
//!
//! A texel sends the same to all sides. What comes to it is the mean of what its rays meet, which is irradiance over
//! pi; times the diffuse colour that is what it sends on (Goral, Torrance, Greenberg and Battaile 1984, by Monte Carlo
//! form factors). The rays of the bounces are cast once and kept as *links*, so that a bounce is a few loads a link;
//! the last step, which is what the lightmap holds, casts rays of its own. Every texel is computed by itself in a fixed
//! order: the result does not depend on the number of threads.

use std::f32::consts::PI;

use bevy_bounce_cssm::NO_TEXEL;
use glam::Vec3;
use rayon::prelude::*;

use super::places::{Place, Places};
use super::sampling::{Points, cosine_direction};
use super::surface::{Met, Surface};
use crate::atlas::Atlas;
use crate::bake::count;
use crate::scene::Light;
use crate::{Progress, Step};

/// Links of a texel.
const LINKS: usize = 64;
/// Texels that are told of at once.
const CHUNK: usize = 256;
/// Bounces end where one adds less than this share of all light.
const CONVERGED: f64 = 1.0e-4;
/// More of them never come: with a reflectance of 0.99 everywhere, 2 % of the light would be left out.
const MOST_BOUNCES: u32 = 400;
/// A place is within a solid where more than this share of its rays meets backs.
const MOST_BACKS: f32 = 0.5;

/// What is lit, and by what.
pub struct Radiosity<'a> {
    /// What rays meet.
    pub surface: &'a Surface<'a>,
    /// Where texels are looked at.
    pub places: &'a Places,
    /// What they reflect.
    pub atlas: &'a Atlas,
    /// Lamps.
    pub lights: &'a [Light],
    /// How far above the surface rays start, world units.
    pub lift: f32,
}

/// What rays bring to a texel.
pub struct Gathered {
    /// Irradiance over pi, cd/m².
    pub light: Vec3,
    /// Of that, as if the rays were independent.
    pub variance: Vec3,
    /// Irradiance from lamps over pi, cd/m².
    pub direct: Vec3,
}

/// What texels send.
pub struct Solution {
    /// cd/m².
    pub radiance: Vec<Vec3>,
    /// Irradiance from lamps over pi, cd/m².
    pub direct: Vec<Vec3>,
    /// Reflections that are in it.
    pub bounces: u32,
}

impl Radiosity<'_> {
    /// What all texels send after so many reflections, or after as many as matter.
    pub fn solve(&self, bounces: Option<u32>, progress: &dyn Progress) -> Solution {
        let count_of_texels = self.atlas.texels.len();
        let linked = count(progress, Step::Linking, count_of_texels);
        let mut links = vec![NO_TEXEL; count_of_texels * LINKS];
        let mut direct = vec![Vec3::ZERO; count_of_texels];
        let chunks = links.par_chunks_mut(LINKS * CHUNK).zip(direct.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each(|(chunk, (links, direct))| {
            for (i, (links, direct)) in links.chunks_mut(LINKS).zip(&mut *direct).enumerate() {
                self.link(chunk * CHUNK + i, links);
                *direct = self.direct(chunk * CHUNK + i);
            }
            linked(direct.len());
        });
        let diffuse: Vec<Vec3> = self.atlas.texels.iter().map(|texel| texel.texel.diffuse.into()).collect();
        let reflect = |arriving: &[Vec3]| -> Vec<Vec3> { arriving.iter().zip(&diffuse).map(|(a, b)| a * b).collect() };
        let reflected = reflect(&direct);
        let mut radiance: Vec<Vec3> = reflected.iter().zip(&self.places.emission).map(|(a, b)| a + b).collect();
        let mut last = radiance.clone();
        let most = bounces.unwrap_or(MOST_BOUNCES).clamp(1, MOST_BOUNCES);
        let mut done = 1;
        while done < most {
            progress.report(Step::Bouncing, done as usize, bounces.map(|bounces| bounces as usize));
            let arriving: Vec<Vec3> = links.par_chunks(LINKS).map(|links| mean(links, &last)).collect();
            last = reflect(&arriving);
            radiance.iter_mut().zip(&last).for_each(|(sum, more)| *sum += *more);
            done += 1;
            if bounces.is_none() && self.power(&last) <= CONVERGED * self.power(&radiance) {
                break;
            }
        }
        Solution { radiance, direct, bounces: done }
    }

    /// Light that all texels send, in any unit.
    fn power(&self, radiance: &[Vec3]) -> f64 {
        let texels = self.atlas.texels.iter().zip(radiance);
        texels.map(|(texel, radiance)| f64::from(texel.texel.area * radiance.element_sum())).sum()
    }

    /// Casts the rays of the bounces.
    fn link(&self, texel: usize, links: &mut [u32]) {
        let places = self.places.of(texel);
        let points = self.points(texel, 1);
        for (i, link) in (0..).zip(links.iter_mut()) {
            if let Met::Texel(met) = self.cast(&places[i as usize % places.len()], points, i) {
                *link = met;
            }
        }
    }

    fn points(&self, texel: usize, pass: u32) -> Points {
        let [x, y] = self.atlas.texels[texel].texel.cell;
        Points::new((y * self.atlas.size.x + x).wrapping_mul(2).wrapping_add(pass))
    }

    /// What a ray of a place meets. Those that would leave through the surface are turned up.
    fn cast(&self, place: &Place, points: Points, index: u32) -> Met {
        let direction = cosine_direction(place.normal, points.at(index));
        let below = direction.dot(place.plane).min(0.0);
        self.surface.meet(place.position + place.plane * self.lift, direction - place.plane * (2.0 * below))
    }

    /// Irradiance from lamps over pi, the mean of a texel's places.
    fn direct(&self, texel: usize) -> Vec3 {
        let places = self.places.of(texel);
        let sum: Vec3 = places.iter().map(|place| self.direct_at(place)).sum();
        sum / places.len() as f32
    }

    /// Irradiance from lamps over pi.
    fn direct_at(&self, place: &Place) -> Vec3 {
        let from = place.position + place.plane * self.lift;
        let arriving = self.lights.iter().filter_map(|light| {
            let ray = light.ray_from(from)?;
            let cosine = ray.direction.dot(place.normal);
            let seen = cosine > 0.0
                && ray.direction.dot(place.plane) > 0.0
                && self.surface.bvh.is_free(from, ray.direction, ray.distance);
            seen.then(|| ray.illuminance * cosine)
        });
        arriving.sum::<Vec3>() / PI
    }

    /// Irradiance over pi of every texel by so many rays each, from texels that send `radiance`; nothing for texels
    /// that no light reaches or that lie within solids.
    pub fn gather(&self, radiance: &[Vec3], rays: u32, progress: &dyn Progress) -> Vec<Option<Gathered>> {
        let lit = count(progress, Step::Gathering, self.atlas.texels.len());
        let texels = (0..self.atlas.texels.len()).into_par_iter().map(|texel| {
            lit(1);
            self.gather_texel(texel, radiance, rays)
        });
        texels.collect()
    }

    /// Each place by itself first: one that lies under what stands there has no part in the texel.
    fn gather_texel(&self, texel: usize, radiance: &[Vec3], rays: u32) -> Option<Gathered> {
        let places = self.places.of(texel);
        let points = self.points(texel, 0);
        let (mut sum, mut squares, mut direct, mut open) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0);
        for (first, place) in (0..).zip(places) {
            let (mut here, mut here_squares, mut backs, mut all) = (Vec3::ZERO, Vec3::ZERO, 0, 0);
            for index in (first..rays.max(places.len() as u32)).step_by(places.len()) {
                all += 1;
                match self.cast(place, points, index) {
                    Met::Texel(met) => {
                        here += radiance[met as usize];
                        here_squares += radiance[met as usize] * radiance[met as usize];
                    }
                    Met::Back => backs += 1,
                    Met::Nothing => {}
                }
            }
            if here.max_element() > 0.0 && backs as f32 <= MOST_BACKS * all as f32 {
                sum += here;
                squares += here_squares;
                direct += self.direct_at(place) * all as f32;
                open += all;
            }
        }
        let light = (open > 0).then(|| sum / open as f32)?;
        let variance = (squares / open as f32 - light * light).max(Vec3::ZERO) / open as f32;
        Some(Gathered { light, variance, direct: direct / open as f32 })
    }
}

/// The mean of what links send.
fn mean(links: &[u32], radiance: &[Vec3]) -> Vec3 {
    let sent = links.iter().filter_map(|&texel| radiance.get(texel as usize));
    sent.sum::<Vec3>() / LINKS as f32
}
