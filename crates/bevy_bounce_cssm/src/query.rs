//! Visibility from a texel to a point.

use crate::block::LANES;
use crate::cube::{FacePoint, group_and_row};
use crate::{CssmFile, Texel};

/// How much of the neighbourhood has a say.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Filter {
    /// One texel, one pixel: yes or no.
    #[default]
    Nearest,
    /// Percentage-closer filtering of the four pixels round the point (Reeves, Salesin and Cook 1987).
    Pixels,
    /// The same at the four texels round the receiver too: generalised percentage-closer filtering (Ritschel, Grosch,
    /// Kautz and Müller, *Interactive Illumination with Coherent Shadow Maps*, 2007).
    PixelsAndTexels,
}

impl CssmFile {
    /// Centre of a texel's cube map.
    pub fn center(&self, texel: &Texel) -> [f32; 3] {
        std::array::from_fn(|axis| texel.position[axis] + texel.normal[axis] * self.meta.lift)
    }

    /// The code of a texel's cube map at a face's pixel; nothing outside the map.
    pub fn code(&self, texel: &Texel, face: u32, pixel: [u32; 2]) -> Option<u16> {
        let side = self.meta.depth;
        let (group, row) = group_and_row(pixel, side);
        let (block, lane) = (texel.slot as usize / LANES, texel.slot as usize % LANES);
        let group = (face * side * side) as usize / crate::block::ROWS + group;
        self.maps.code(block * self.meta.groups() + group, row, lane)
    }

    /// Whether nothing of the object stands between the texel and a point of the object, by one pixel. Points behind the
    /// texel are not visible.
    ///
    /// `point` is in world units of the object's space. For points outside the object's hull ask the maps from outside
    /// too: where a ray has left the object through its only surface there, the cube map leaves open where that was.
    pub fn visible(&self, texel: &Texel, point: [f32; 3]) -> bool {
        let center = self.center(texel);
        let offset: [f32; 3] = std::array::from_fn(|axis| point[axis] - center[axis]);
        if dot(offset, texel.normal) <= 0.0 {
            return false;
        }
        let place = FacePoint::of(offset, self.meta.depth);
        self.lit(texel, place.face, place.pixel(self.meta.depth), place.depth)
    }

    /// Share of a point of the object that is visible, 0 to 1. `at` is where the receiver lies in the atlas, in texels;
    /// the texel there must be `texel`.
    pub fn visibility(&self, texel: &Texel, at: [f32; 2], point: [f32; 3], filter: Filter) -> f32 {
        match filter {
            Filter::Nearest => f32::from(u8::from(self.visible(texel, point))),
            Filter::Pixels => self.filtered(texel, point),
            Filter::PixelsAndTexels => {
                let sum = corners(at).map(|(cell, weight)| {
                    let neighbor = self.texel_at(cell).and_then(|index| self.texel(index));
                    let neighbor = neighbor.filter(|neighbor| neighbor.chart == texel.chart);
                    neighbor.map_or([0.0; 2], |neighbor| [weight * self.filtered(&neighbor, point), weight])
                });
                let [seen, whole] = sum.into_iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
                if whole > 0.0 { seen / whole } else { self.filtered(texel, point) }
            }
        }
    }

    /// Bilinear share of the four pixels round a point.
    fn filtered(&self, texel: &Texel, point: [f32; 3]) -> f32 {
        let center = self.center(texel);
        let offset: [f32; 3] = std::array::from_fn(|axis| point[axis] - center[axis]);
        if dot(offset, texel.normal) <= 0.0 {
            return 0.0;
        }
        let side = self.meta.depth;
        let place = FacePoint::of(offset, side);
        let [x, y] = place.at.map(|at| at - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let mut seen = 0.0;
        for (dx, dy, weight) in [
            (0.0, 0.0, (1.0 - fx) * (1.0 - fy)),
            (1.0, 0.0, fx * (1.0 - fy)),
            (0.0, 1.0, (1.0 - fx) * fy),
            (1.0, 1.0, fx * fy),
        ] {
            // A neighbour past the face's edge is found on the next face.
            let neighbor = FacePoint { at: [x.floor() + dx + 0.5, y.floor() + dy + 0.5], ..place };
            let direction = neighbor.direction(side);
            let there = FacePoint::of(direction, side);
            let axis = (there.face / 2) as usize;
            // Rays to the texel's back have no depth of their own.
            let known = dot(direction, texel.normal) > 0.0;
            let (face, pixel, depth) = match known {
                true => (there.face, there.pixel(side), offset[axis].abs()),
                false => (place.face, place.pixel(side), place.depth),
            };
            seen += if self.lit(texel, face, pixel, depth) { weight } else { 0.0 };
        }
        seen
    }

    fn lit(&self, texel: &Texel, face: u32, pixel: [u32; 2], depth: f32) -> bool {
        self.code(texel, face, pixel).is_some_and(|code| depth <= self.quantizer().depth(code))
    }
}

/// The four cells whose centres surround a place in the atlas, and their bilinear weights.
fn corners(at: [f32; 2]) -> [([u32; 2], f32); 4] {
    let [x, y] = at.map(|at| at - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    // Cells before the first have numbers that no atlas has.
    let cell = |x: f32, y: f32| [x, y].map(|value| if value < 0.0 { u32::MAX } else { value as u32 });
    [
        (cell(left, top), (1.0 - fx) * (1.0 - fy)),
        (cell(left + 1.0, top), fx * (1.0 - fy)),
        (cell(left, top + 1.0), (1.0 - fx) * fy),
        (cell(left + 1.0, top + 1.0), fx * fy),
    ]
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
