//! Light in the room between surfaces, for what moves there: an irradiance volume as Bevy 0.19 reads it.
//!
//! A voxel is an *ambient cube* (Mitchell, *Shading in Valve's Source Engine*, 2006): irradiance over pi for six
//! facings. The texture of `(x, y, z)` voxels is `(x, 2y, 3z)` texels: facings along x, y and z behind each other in z,
//! the positive of each over the negative in y, as Bevy's `irradiance_volume.wgsl` takes them. It fills a box round the
//! scene that is a little larger, for Bevy counts what lies on its sides as outside.

use glam::{UVec3, Vec3};
use rayon::prelude::*;

use super::fill::fill;
use super::sampling::{Points, sphere_direction};
use super::surface::{Met, Surface};
use crate::bake::count;
use crate::{Progress, Step};

/// Rays of a probe.
const RAYS: u32 = 1024;
/// Share of rays that meet backs above which a probe is taken to be within a solid.
const MOST_BACKS: f32 = 0.25;

/// Probes in a box.
#[derive(Clone, Copy, Debug)]
pub struct Volume {
    /// Middle of the box, world units.
    pub center: Vec3,
    /// Its sides, world units.
    pub size: Vec3,
    /// Voxels along each side.
    pub resolution: UVec3,
}

/// Sides of the box, as a multiple of the scene's.
const MARGIN: f32 = 1.01;

/// A probe's facings: +x, -x, +y, -y, +z, -z.
type Cube = [Vec3; 6];

impl Volume {
    /// For a scene within those bounds, with so many voxels along the longest side.
    pub fn new([min, max]: [Vec3; 2], longest: u32) -> Self {
        let size = MARGIN * (max - min);
        let spacing = size.max_element() / longest as f32;
        let resolution = (size / spacing).round().as_uvec3().clamp(UVec3::ONE, UVec3::splat(longest));
        // What is flat has a box, too.
        Self { center: 0.5 * (min + max), size: size.max(Vec3::splat(spacing)), resolution }
    }

    /// Texels of the texture.
    pub fn texels(&self) -> UVec3 {
        self.resolution * UVec3::new(1, 2, 3)
    }

    /// The texture, row by row and slice by slice, in cd/m².
    pub fn light(&self, surface: &Surface, radiance: &[Vec3], progress: &dyn Progress) -> Vec<Vec3> {
        let probes = self.resolution.element_product();
        let lit = count(progress, Step::Probing, probes as usize);
        let probe = |probe: u32| {
            lit(1);
            self.probe(probe, surface, radiance)
        };
        let cubes: Vec<Option<Cube>> = (0..probes).into_par_iter().map(probe).collect();
        let size = self.texels();
        let mut texture = vec![Vec3::ZERO; size.element_product() as usize];
        for facing in 0..6 {
            let mut cells: Vec<Option<Vec3>> = cubes.iter().map(|cube| Some(cube.as_ref()?[facing])).collect();
            fill(&mut cells, self.resolution, self.resolution.max_element());
            let first = UVec3::new(0, facing as u32 % 2, facing as u32 / 2) * self.resolution;
            for (number, value) in (0..).zip(cells) {
                let at = first + self.voxel(number);
                texture[((at.z * size.y + at.y) * size.x + at.x) as usize] = value.unwrap_or_default();
            }
        }
        texture
    }

    fn voxel(&self, number: u32) -> UVec3 {
        let size = self.resolution;
        UVec3::new(number % size.x, number / size.x % size.y, number / (size.x * size.y))
    }

    /// One probe; nothing within solids and where no light comes.
    fn probe(&self, number: u32, surface: &Surface, radiance: &[Vec3]) -> Option<Cube> {
        let place = (self.voxel(number).as_vec3() + 0.5) / self.resolution.as_vec3() - 0.5;
        let from = self.center + place * self.size;
        let points = Points::new(number);
        let (mut sums, mut weights, mut backs) = ([Vec3::ZERO; 6], [0.0; 6], 0);
        for index in 0..RAYS {
            let direction = sphere_direction(points.at(index));
            let sent = match surface.meet(from, direction) {
                Met::Texel(texel) => radiance[texel as usize],
                Met::Back => {
                    backs += 1;
                    Vec3::ZERO
                }
                Met::Nothing => Vec3::ZERO,
            };
            for axis in 0..3 {
                let facing = 2 * axis + usize::from(direction[axis] < 0.0);
                sums[facing] += sent * direction[axis].abs();
                weights[facing] += direction[axis].abs();
            }
        }
        let cube: Cube = std::array::from_fn(|facing| sums[facing] / f32::max(weights[facing], f32::MIN_POSITIVE));
        let lit = cube.iter().any(|facing| facing.max_element() > 0.0);
        (lit && backs as f32 <= MOST_BACKS * RAYS as f32).then_some(cube)
    }
}
