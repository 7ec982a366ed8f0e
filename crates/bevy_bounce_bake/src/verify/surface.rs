//! The surface, to draw points from and to walk over.

use bevy_bounce_cssm::CssmFile;
use glam::{UVec2, Vec2, Vec3};

use crate::BakeError;
use crate::atlas::barycentric;
use crate::scene::{Cutout, Material, Scene};

/// Rounding by which a place may lie outside the triangle that it is on, as a weight of a corner.
const ROUNDING: f32 = 1.0e-4;

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// World units.
    pub position: Vec3,
    /// Of the triangle, on its front.
    pub normal: Vec3,
    /// In texels of the atlas.
    pub at: Vec2,
}

/// What the atlas shows.
pub struct Surface<'a> {
    triangles: Vec<Triangle>,
    /// Sum of the areas up to each triangle.
    areas: Vec<f64>,
    materials: &'a [Material],
    size: UVec2,
    /// First of the triangles in each cell of the atlas, and one more.
    starts: Vec<u32>,
    /// Triangles by cells.
    in_cells: Vec<u32>,
}

struct Triangle {
    corners: [Vec3; 3],
    /// In texels.
    uv: [Vec2; 3],
    cutout: Option<Cutout>,
}

impl<'a> Surface<'a> {
    /// The surface of the scene that the file was baked from.
    pub fn new(file: &CssmFile, scene: &'a Scene) -> Result<Self, BakeError> {
        let parts: Vec<_> = file.parts.iter().collect();
        let same = parts.len() == scene.parts.len()
            && parts.iter().zip(&scene.parts).all(|(baked, part)| baked.triangles == part.source_count);
        if !same || scene.source_hash != file.meta.source_hash {
            return Err(BakeError::Atlas(
                "the bake is of another scene, or of an older state of it; bake it anew".into(),
            ));
        }
        let size = UVec2::from(file.meta.atlas);
        let (mut triangles, mut areas, mut sum) = (Vec::new(), Vec::new(), 0.0);
        for (baked, part) in parts.iter().zip(&scene.parts) {
            let material = &scene.materials[part.material];
            for (number, corners) in part.source_triangles.iter().zip(&part.triangles) {
                let Some(uv) = file.parts.triangle(baked.first_triangle + number) else { continue };
                let uv = part.source_order(uv).map(|uv| Vec2::from(uv) * size.as_vec2());
                let cutout = Cutout::new(part, material, *corners);
                let corners = corners.map(|index| part.positions[index as usize]);
                sum += f64::from(0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length());
                areas.push(sum);
                triangles.push(Triangle { corners, uv, cutout });
            }
        }
        let (starts, in_cells) = by_cells(&triangles, size);
        Ok(Self { triangles, areas, materials: &scene.materials, size, starts, in_cells })
    }

    /// A random point, evenly by area; nothing in a hole.
    pub fn sample(&self, rng: &mut fastrand::Rng) -> Option<Sample> {
        let at = rng.f64() * self.areas.last()?;
        let index = self.areas.partition_point(|&sum| sum < at).min(self.triangles.len() - 1);
        let (mut b, mut c) = (rng.f32(), rng.f32());
        if b + c > 1.0 {
            (b, c) = (1.0 - b, 1.0 - c);
        }
        self.triangles[index].sample([1.0 - b - c, b, c], self.materials)
    }

    /// The point that a place of the atlas shows, in texels.
    pub fn at(&self, at: Vec2) -> Option<Sample> {
        let cell = at.floor().as_ivec2();
        let inside = cell.min_element() >= 0 && cell.as_uvec2().cmplt(self.size).all();
        let cell = inside.then(|| (cell.y as u32 * self.size.x + cell.x as u32) as usize)?;
        let here = &self.in_cells[self.starts[cell] as usize..self.starts[cell + 1] as usize];
        here.iter().find_map(|&index| {
            let triangle = &self.triangles[index as usize];
            let weights = barycentric(triangle.uv, at);
            let inside = weights.iter().all(|&weight| weight >= -ROUNDING);
            inside.then(|| triangle.sample(weights, self.materials)).flatten()
        })
    }
}

impl Triangle {
    fn sample(&self, weights: [f32; 3], materials: &[Material]) -> Option<Sample> {
        let there = self.cutout.is_none_or(|cutout| cutout.is_there(materials, weights));
        let [a, b, c] = self.corners;
        there.then(|| Sample {
            position: (0..3).map(|corner| self.corners[corner] * weights[corner]).sum(),
            normal: (b - a).cross(c - a).normalize_or_zero(),
            at: (0..3).map(|corner| self.uv[corner] * weights[corner]).sum(),
        })
    }
}

/// The triangles that reach into each cell: first of each in the list, and the list.
fn by_cells(triangles: &[Triangle], size: UVec2) -> (Vec<u32>, Vec<u32>) {
    let cells = |triangle: &Triangle| {
        let [a, b, c] = triangle.uv;
        let low = a.min(b).min(c).max(Vec2::ZERO).as_uvec2();
        let high = a.max(b).max(c).max(Vec2::ZERO).as_uvec2().min(size - 1);
        (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| (y * size.x + x) as usize))
    };
    let mut starts = vec![0; (size.x * size.y + 1) as usize];
    triangles.iter().flat_map(cells).for_each(|cell| starts[cell + 1] += 1);
    for cell in 1..starts.len() {
        starts[cell] += starts[cell - 1];
    }
    let mut next = starts.clone();
    let mut list = vec![0; starts[starts.len() - 1] as usize];
    for (index, triangle) in (0..).zip(triangles) {
        for cell in cells(triangle) {
            list[next[cell] as usize] = index;
            next[cell] += 1;
        }
    }
    (starts, list)
}
