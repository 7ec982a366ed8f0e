//! Texture coordinates for the atlas, and the charts they form.

use std::collections::HashMap;

use glam::{UVec2, Vec2};

use super::unwrap::unwrap;
use crate::{BakeError, Progress, scene::Scene};

/// Where the atlas coordinates come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum UvSource {
    /// The second UV set where every part has one and none is double-sided, for such a set has no room for backs; otherwise
    /// unwrapped.
    #[default]
    Auto,
    /// Unwrapped, whatever UV sets there are.
    Unwrap,
}

/// Atlas coordinates of every triangle.
#[derive(Clone, Debug)]
pub struct Charted {
    /// Width and height of the atlas in texels.
    pub size: UVec2,
    /// In texels, three corners a triangle, counted over all parts. `None` for triangles without room in the atlas.
    pub corners: Vec<Option<[Vec2; 3]>>,
    /// Chart of each triangle.
    pub chart: Vec<u32>,
    /// Number of charts.
    pub charts: u32,
    /// Whether the coordinates are the scene's own second UV set.
    pub from_scene: bool,
}

impl Charted {
    /// Coordinates for an atlas of at most `size` by `size` texels.
    pub fn new(scene: &Scene, size: u32, source: UvSource, progress: &dyn Progress) -> Result<Self, BakeError> {
        let filled = || scene.parts.iter().filter(|part| !part.triangles.is_empty());
        if source == UvSource::Auto && filled().all(|part| part.uv1.is_some() && !part.back) {
            second_set(scene, size)
        } else {
            unwrap(scene, size, progress)
        }
    }
}

/// The second UV set as it stands.
fn second_set(scene: &Scene, size: u32) -> Result<Charted, BakeError> {
    let mut corners = Vec::new();
    let mut sets = DisjointSets::default();
    for part in &scene.parts {
        let Some(uv) = &part.uv1 else { continue };
        // Triangles that share a corner of the atlas at the same vertex are of one chart.
        let mut vertices: HashMap<([u32; 2], [u32; 3]), u32> = HashMap::new();
        for triangle in &part.triangles {
            let at = triangle.map(|index| uv[index as usize]);
            if let Some(corner) = at.iter().find(|uv| uv.min_element() < -1.0e-3 || uv.max_element() > 1.001) {
                return Err(BakeError::Atlas(format!(
                    "{}: TEXCOORD_1 leaves the unit square at {corner}; scale it to fit, or bake with --unwrap",
                    part.name
                )));
            }
            let number = sets.push();
            for (index, uv) in triangle.iter().zip(at) {
                let position = part.positions[*index as usize].to_array().map(f32::to_bits);
                let other = *vertices.entry((uv.to_array().map(f32::to_bits), position)).or_insert(number);
                sets.join(number, other);
            }
            corners.push(Some(at.map(|uv| uv.clamp(Vec2::ZERO, Vec2::ONE) * size as f32)));
        }
    }
    let (chart, charts) = sets.numbers();
    Ok(Charted { size: UVec2::splat(size), corners, chart, charts, from_scene: true })
}

/// Sets of numbers that can be joined.
#[derive(Default)]
struct DisjointSets(Vec<u32>);

impl DisjointSets {
    fn push(&mut self) -> u32 {
        self.0.push(self.0.len() as u32);
        self.0.len() as u32 - 1
    }

    fn root(&mut self, mut number: u32) -> u32 {
        while self.0[number as usize] != number {
            let parent = self.0[number as usize];
            self.0[number as usize] = self.0[parent as usize];
            number = self.0[number as usize];
        }
        number
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a.max(b) as usize] = a.min(b);
    }

    /// A set for each number, counted from zero in the order of their smallest members, and how many sets there are.
    fn numbers(mut self) -> (Vec<u32>, u32) {
        let roots: Vec<u32> = (0..self.0.len() as u32).map(|number| self.root(number)).collect();
        let mut numbers = HashMap::new();
        let sets: Vec<u32> = roots
            .iter()
            .map(|root| {
                let next = numbers.len() as u32;
                *numbers.entry(*root).or_insert(next)
            })
            .collect();
        (sets, numbers.len() as u32)
    }
}
