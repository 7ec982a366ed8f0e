//! Meshes out of numbers, for Bevy's world and for a bake.

use bevy::mesh::{Indices, PrimitiveTopology};
use bevy::prelude::*;

/// Triangles of one paint.
#[derive(Clone, Debug, Default)]
pub struct Solid {
    /// Corners, metres.
    pub positions: Vec<Vec3>,
    /// One a corner, unit length.
    pub normals: Vec<Vec3>,
    /// Linear colours, one a corner, which the paint is multiplied with.
    pub colors: Vec<Vec3>,
    /// Where in the atlas of a bake each corner is, 0 to 1; without any the baker unwraps.
    pub atlas: Vec<Vec2>,
    /// Three a triangle, counter-clockwise.
    pub indices: Vec<u32>,
}

impl Solid {
    /// Adds a flat quadrilateral, counter-clockwise.
    pub fn quad(&mut self, corners: [Vec3; 4], color: Vec3) {
        let [a, b, _, d] = corners;
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.normals.extend([(b - a).cross(d - a).normalize_or(Vec3::Y); 4]);
        self.colors.extend([color; 4]);
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }

    /// Adds six sides of a box.
    pub fn block(&mut self, low: Vec3, high: Vec3) {
        let at = |x: u32, y: u32, z: u32| {
            let pick = |bit: u32, low: f32, high: f32| if bit == 0 { low } else { high };
            Vec3::new(pick(x, low.x, high.x), pick(y, low.y, high.y), pick(z, low.z, high.z))
        };
        for corners in [
            [at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1)],
            [at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0)],
            [at(0, 1, 0), at(0, 1, 1), at(1, 1, 1), at(1, 1, 0)],
            [at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1)],
            [at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)],
            [at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0)],
        ] {
            self.quad(corners, Vec3::ONE);
        }
    }

    /// Adds boxes in a row, counter-clockwise about an axis along z and between two depths: `at(step)` is where each begins, near the axis
    /// and far from it. Closed but where one meets the next.
    pub fn arch(&mut self, steps: u32, at: impl Fn(u32) -> [Vec2; 2], [back, front]: [f32; 2]) {
        for step in 0..steps {
            let ([near, far], [next_near, next_far]) = (at(step), at(step + 1));
            let (b, f) = (|p: Vec2| p.extend(back), |p: Vec2| p.extend(front));
            self.quad([f(near), f(next_near), b(next_near), b(near)], Vec3::ONE);
            self.quad([b(far), b(next_far), f(next_far), f(far)], Vec3::ONE);
            self.quad([f(near), f(far), f(next_far), f(next_near)], Vec3::ONE);
            self.quad([b(near), b(next_near), b(next_far), b(far)], Vec3::ONE);
        }
    }

    /// As Bevy draws it.
    pub fn mesh(&self) -> Mesh {
        let triples = |values: &[Vec3]| values.iter().map(Vec3::to_array).collect::<Vec<_>>();
        let colors: Vec<[f32; 4]> = self.colors.iter().map(|color| color.extend(1.0).to_array()).collect();
        Mesh::new(PrimitiveTopology::TriangleList, default())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, triples(&self.positions))
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, triples(&self.normals))
            .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, colors)
            .with_inserted_indices(Indices::U32(self.indices.clone()))
    }
}

/// A place in one of six charts of an atlas, three in a row, with room between them.
pub fn atlas_place(chart: u32, at: Vec2) -> Vec2 {
    const MARGIN: f32 = 0.08;
    let cell = UVec2::new(chart % 3, chart / 3).as_vec2();
    (cell + MARGIN + at * (1.0 - 2.0 * MARGIN)) / Vec2::new(3.0, 2.0)
}
