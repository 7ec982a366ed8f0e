//! Where a direction falls in a depth cube map.
//!
//! The faces stand square to the axes of the object's space: face `2 a` looks along axis `a`, face `2 a + 1` against it. On
//! a face, u runs along axis `a + 1` and v along axis `a + 2` (modulo 3), both from -1 to 1, and the depth of a point is its
//! distance from the centre along the face's axis. Pixels are kept in squares of 8 by 8, row by row; each square is two
//! groups of 32.

use crate::block::ROWS;

/// Side of a square of pixels.
const SQUARE: u32 = 8;

/// A place on a face of the cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePoint {
    /// 0 to 5.
    pub face: u32,
    /// Column and row in pixels, 0 at the first one's outer edge.
    pub at: [f32; 2],
    /// Distance along the face's axis.
    pub depth: f32,
}

impl FacePoint {
    /// Where a point is seen that lies at `offset` from the centre, on faces of `side` pixels.
    pub fn of(offset: [f32; 3], side: u32) -> Self {
        let [x, y, z] = offset.map(f32::abs);
        let axis = if x >= y && x >= z {
            0
        } else if y >= z {
            1
        } else {
            2
        };
        let depth = offset[axis].abs();
        let place = |value: f32| (value / depth * 0.5 + 0.5) * side as f32;
        let at = [place(offset[(axis + 1) % 3]), place(offset[(axis + 2) % 3])];
        Self { face: 2 * axis as u32 + u32::from(offset[axis] < 0.0), at, depth }
    }

    /// The direction through the point; its part along the face's axis has length 1.
    pub fn direction(&self, side: u32) -> [f32; 3] {
        let axis = (self.face / 2) as usize;
        let place = |at: f32| 2.0 * at / side as f32 - 1.0;
        let mut direction = [0.0; 3];
        direction[axis] = if self.face.is_multiple_of(2) { 1.0 } else { -1.0 };
        direction[(axis + 1) % 3] = place(self.at[0]);
        direction[(axis + 2) % 3] = place(self.at[1]);
        direction
    }

    /// Column and row of the pixel.
    pub fn pixel(&self, side: u32) -> [u32; 2] {
        self.at.map(|at| (at as u32).min(side - 1))
    }
}

/// Group within a map, and row within the group, of a pixel in a picture of `side` pixels.
pub fn group_and_row([x, y]: [u32; 2], side: u32) -> (usize, usize) {
    let square = (y / SQUARE) * (side / SQUARE) + x / SQUARE;
    let pixel = (y % SQUARE) * SQUARE + x % SQUARE;
    let groups = SQUARE * SQUARE / ROWS as u32;
    ((square * groups + pixel / ROWS as u32) as usize, (pixel % ROWS as u32) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_directions() {
        for face in 0..6 {
            for x in 0..16 {
                for y in 0..16 {
                    let point = FacePoint { face, at: [x as f32 + 0.5, y as f32 + 0.5], depth: 1.0 };
                    let direction = point.direction(16);
                    let back = FacePoint::of(direction.map(|value| value * 3.0), 16);
                    assert_eq!((back.face, back.pixel(16), back.depth), (face, [x, y], 3.0));
                }
            }
        }
    }

    #[test]
    fn every_pixel_has_its_place() {
        let mut seen = vec![false; 24 * 24];
        for y in 0..24 {
            for x in 0..24 {
                let (group, row) = group_and_row([x, y], 24);
                assert!(!std::mem::replace(&mut seen[group * ROWS + row], true));
            }
        }
    }
}
