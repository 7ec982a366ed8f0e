//! Which texel a ray meets.

use glam::{UVec2, Vec2, Vec3};

use crate::atlas::Atlas;
use crate::rays::Bvh;
use crate::scene::Scene;

/// What a ray meets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Met {
    /// A texel, by its number in the atlas.
    Texel(u32),
    /// The back of a surface that has only a front: the ray began within a solid, or looks at what was not meant to be
    /// seen.
    Back,
    /// Nothing that sends light.
    Nothing,
}

/// Everything that rays may meet.
pub struct Surface<'a> {
    /// Its triangles are [`Scene::occluders`].
    pub bvh: Bvh<'a>,
    atlas: &'a Atlas,
    cells: &'a [Option<u32>],
    /// Numbers of each occluder's front and back among all triangles.
    sides: Vec<[Option<u32>; 2]>,
}

impl<'a> Surface<'a> {
    /// `cells` are the numbers of the texels, row by row.
    pub fn new(scene: &'a Scene, atlas: &'a Atlas, cells: &'a [Option<u32>]) -> Self {
        let mut sides: Vec<[Option<u32>; 2]> = Vec::new();
        let mut number = 0;
        for part in &scene.parts {
            let count = part.triangles.len();
            let numbers = number..number + count as u32;
            if part.back {
                // The fronts are the part before.
                let fronts = sides.len() - count;
                sides[fronts..].iter_mut().zip(numbers).for_each(|(sides, back)| sides[1] = Some(back));
            } else {
                sides.extend(numbers.map(|front| [Some(front), None]));
            }
            number += count as u32;
        }
        Self { bvh: Bvh::new(scene), atlas, cells, sides }
    }

    /// What a ray meets first.
    pub fn meet(&self, from: Vec3, direction: Vec3) -> Met {
        let Some(hit) = self.bvh.first(from, direction) else { return Met::Nothing };
        let [front, back] = self.sides[hit.occluder as usize];
        let [a, b, c] = hit.weights;
        let (side, weights) = if hit.front { (front, [a, b, c]) } else { (back, [a, c, b]) };
        let Some(triangle) = side.map(|side| side as usize) else { return Met::Back };
        let Some(corners) = self.atlas.charted.corners[triangle] else { return Met::Nothing };
        let at = (0..3).map(|corner| corners[corner] * weights[corner]).sum();
        self.texel(at, self.atlas.charted.chart[triangle]).map_or(Met::Nothing, Met::Texel)
    }

    /// The texel of a chart at this place of the atlas, or the next one where the chart hardly reaches into that.
    fn texel(&self, at: Vec2, chart: u32) -> Option<u32> {
        const AROUND: [[i32; 2]; 9] = [[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1], [-1, -1], [1, -1], [-1, 1], [1, 1]];
        let size: UVec2 = self.atlas.size;
        let cell = at.as_ivec2();
        let texels = AROUND.iter().filter_map(|&offset| {
            let cell = cell + glam::IVec2::from(offset);
            let inside = cell.min_element() >= 0 && cell.as_uvec2().cmplt(size).all();
            self.cells[inside.then(|| (cell.y as u32 * size.x + cell.x as u32) as usize)?]
        });
        texels.into_iter().find(|&texel| self.atlas.texels[texel as usize].texel.chart == chart)
    }
}
