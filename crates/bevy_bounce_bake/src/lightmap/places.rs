//! The places of the surface at which a texel is looked at.

use glam::{UVec2, Vec2, Vec3};

use crate::atlas::{Atlas, barycentric};
use crate::scene::{Cutout, Emission, Part, Scene};

/// Places within a texel, a rotated grid: all four differ in each coordinate.
const GRID: [Vec2; 4] =
    [Vec2::new(0.125, 0.625), Vec2::new(0.375, 0.125), Vec2::new(0.625, 0.875), Vec2::new(0.875, 0.375)];
/// A normal of the vertices that leans farther (cosine) from the triangle's own says nothing about its shape.
const LEAST_LEAN: f32 = 0.2;

/// A place of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// World units.
    pub position: Vec3,
    /// That light is reflected about: between the normals of the vertices. Unit length.
    pub normal: Vec3,
    /// Of the triangle, unit length.
    pub plane: Vec3,
}

/// The places of all texels, and what shines there.
pub struct Places {
    /// First place of each texel, and one more.
    starts: Vec<u32>,
    places: Vec<Place>,
    /// Mean of what each texel sends by itself, cd/m².
    pub emission: Vec<Vec3>,
}

/// A place and the texel that it belongs to.
struct Found {
    texel: u32,
    place: Place,
    emission: Vec3,
}

impl Places {
    /// Up to four places a texel, those of its grid that lie on a surface; its middle where none does.
    pub fn new(scene: &Scene, emissions: &[Emission], atlas: &Atlas, cells: &[Option<u32>]) -> Self {
        let mut found = Vec::new();
        let mut number = 0;
        for part in &scene.parts {
            for corners in &part.triangles {
                if let Some(uv) = atlas.charted.corners[number] {
                    let triangle = Triangle::new(scene, emissions, part, *corners, uv);
                    triangle.find(atlas, atlas.charted.chart[number], cells, &mut found);
                }
                number += 1;
            }
        }
        let mut counts = vec![0; atlas.texels.len()];
        found.iter().for_each(|found| counts[found.texel as usize] += 1);
        let middles = (0..).zip(&atlas.texels).filter(|(texel, _)| counts[*texel as usize] == 0);
        found.extend(middles.map(|(texel, at)| {
            let normal = Vec3::from(at.texel.normal);
            let place = Place { position: at.texel.position.into(), normal, plane: normal };
            Found { texel, place, emission: Vec3::ZERO }
        }));
        found.sort_by_key(|found| found.texel);
        let mut places = Self { starts: vec![0], places: Vec::new(), emission: Vec::new() };
        for of_texel in found.chunk_by(|a, b| a.texel == b.texel) {
            places.places.extend(of_texel.iter().map(|found| found.place));
            places.starts.push(places.places.len() as u32);
            let sum: Vec3 = of_texel.iter().map(|found| found.emission).sum();
            places.emission.push(sum / of_texel.len() as f32);
        }
        places
    }

    /// Those of a texel, at least one.
    pub fn of(&self, texel: usize) -> &[Place] {
        &self.places[self.starts[texel] as usize..self.starts[texel + 1] as usize]
    }
}

struct Triangle<'a> {
    scene: &'a Scene,
    part: &'a Part,
    emission: &'a Emission,
    corners: [u32; 3],
    uv: [Vec2; 3],
    plane: Vec3,
    cutout: Option<Cutout>,
}

impl<'a> Triangle<'a> {
    fn new(scene: &'a Scene, emissions: &'a [Emission], part: &'a Part, corners: [u32; 3], uv: [Vec2; 3]) -> Self {
        let [a, b, c] = corners.map(|index| part.positions[index as usize]);
        let plane = (b - a).cross(c - a).normalize_or_zero();
        let cutout = Cutout::new(part, &scene.materials[part.material], corners);
        Self { scene, part, emission: &emissions[part.material], corners, uv, plane, cutout }
    }

    fn find(&self, atlas: &Atlas, chart: u32, cells: &[Option<u32>], found: &mut Vec<Found>) {
        let [a, b, c] = self.uv;
        let low = a.min(b).min(c).max(Vec2::ZERO).as_uvec2();
        let high = a.max(b).max(c).ceil().as_uvec2().min(atlas.size);
        for y in low.y..high.y {
            for x in low.x..high.x {
                let texel = cells[(y * atlas.size.x + x) as usize];
                let texel = texel.filter(|&texel| atlas.texels[texel as usize].texel.chart == chart);
                let Some(texel) = texel else { continue };
                found.extend(GRID.iter().filter_map(|at| {
                    let weights = barycentric(self.uv, UVec2::new(x, y).as_vec2() + at);
                    let inside = weights.iter().all(|&weight| weight >= 0.0);
                    let there = |cutout: &Cutout| cutout.is_there(&self.scene.materials, weights);
                    (inside && self.cutout.as_ref().is_none_or(there)).then(|| self.found(texel, weights))
                }));
            }
        }
    }

    fn found(&self, texel: u32, weights: [f32; 3]) -> Found {
        let position = mix(&self.part.positions, self.corners, weights);
        let normal = self.part.normals.as_ref().map(|normals| mix(normals, self.corners, weights).normalize_or_zero());
        let normal = normal.filter(|normal| normal.dot(self.plane) > LEAST_LEAN).unwrap_or(self.plane);
        let uv = self.part.coordinates_of(self.emission.picture.as_ref());
        let emission = self.emission.radiance(uv.map(|uv| mix(uv, self.corners, weights)));
        Found { texel, place: Place { position, normal, plane: self.plane }, emission }
    }
}

fn mix<T: Copy + std::ops::Mul<f32, Output = T> + std::iter::Sum>(
    values: &[T],
    corners: [u32; 3],
    weights: [f32; 3],
) -> T {
    (0..3).map(|corner| values[corners[corner] as usize] * weights[corner]).sum()
}
