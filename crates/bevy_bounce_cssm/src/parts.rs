//! Which texel a point of a mesh has: atlas coordinates of every triangle's corners.

use crate::CssmError;

/// Words of a part's record.
pub const PART_WORDS: usize = 5;
/// The word of a corner whose triangle has no room in the atlas.
pub const NO_CORNER: u32 = u32::MAX;

/// One primitive of one mesh, as one node places it, by the numbers that the glTF file gives them. A double-sided primitive
/// is two parts in a row: the first of its fronts, the second of the same triangles' backs. Corners are in the glTF file's order
/// in both.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Number of the node.
    pub node: u32,
    /// Number of the mesh.
    pub mesh: u32,
    /// Number of the primitive within the mesh.
    pub primitive: u32,
    /// First triangle in the list of corners.
    pub first_triangle: u32,
    /// Triangles, as many as the primitive has.
    pub triangles: u32,
}

/// Atlas coordinates of a baked scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Parts {
    /// Records of [`PART_WORDS`] words: the fields of [`Part`].
    pub records: Vec<u32>,
    /// Three words a triangle: column in the low and row in the high half, of 65535 for the whole atlas. Or [`NO_CORNER`].
    pub corners: Vec<u32>,
}

impl Parts {
    /// Appends a part whose triangles have these corners, in 0 to 1 of the atlas.
    pub fn push(&mut self, [node, mesh, primitive]: [u32; 3], corners: &[Option<[[f32; 2]; 3]>]) {
        let first = (self.corners.len() / 3) as u32;
        self.records.extend([node, mesh, primitive, first, corners.len() as u32]);
        for corners in corners {
            self.corners.extend(corners.map_or([NO_CORNER; 3], |corners| corners.map(pack)));
        }
    }

    /// All parts, in the order of the nodes.
    pub fn iter(&self) -> impl Iterator<Item = Part> + '_ {
        self.records.as_chunks::<PART_WORDS>().0.iter().map(|words| {
            let [node, mesh, primitive, first_triangle, triangles] = *words;
            Part { node, mesh, primitive, first_triangle, triangles }
        })
    }

    /// Atlas coordinates, 0 to 1, of a triangle's corners; nothing if it has no room in the atlas.
    pub fn triangle(&self, index: u32) -> Option<[[f32; 2]; 3]> {
        let words = self.corners.as_chunks::<3>().0.get(index as usize)?;
        (!words.contains(&NO_CORNER)).then(|| words.map(unpack))
    }

    pub(crate) fn check(&self) -> Result<(), CssmError> {
        if !self.records.len().is_multiple_of(PART_WORDS) || !self.corners.len().is_multiple_of(3) {
            return Err(CssmError::section("parts", "it ends within a record"));
        }
        let triangles = self.corners.len() as u64 / 3;
        match self.iter().position(|part| u64::from(part.first_triangle) + u64::from(part.triangles) > triangles) {
            Some(part) => Err(CssmError::section("parts", format!("part {part} has triangles that are not there"))),
            None => Ok(()),
        }
    }
}

fn pack(corner: [f32; 2]) -> u32 {
    let [x, y] = corner.map(|value| (value.clamp(0.0, 1.0) * 65535.0).round() as u32);
    // The very last corner would look like none.
    (x | y << 16).min(NO_CORNER - 1)
}

fn unpack(word: u32) -> [f32; 2] {
    [word & 0xffff, word >> 16].map(|value| value as f32 / 65535.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip() {
        let mut parts = Parts::default();
        let corners = [[0.0, 0.25], [1.0, 1.0], [0.5, 0.125]];
        parts.push([3, 1, 4], &[None, Some(corners)]);
        parts.push([5, 9, 2], &[Some(corners)]);
        assert!(parts.check().is_ok());
        let last = Part { node: 5, mesh: 9, primitive: 2, first_triangle: 2, triangles: 1 };
        assert_eq!(parts.iter().last(), Some(last));
        assert_eq!(parts.triangle(0), None);
        let back = parts.triangle(2).expect("it has room");
        assert!(back.as_flattened().iter().zip(corners.as_flattened()).all(|(a, b)| (a - b).abs() < 2.0e-5));
        parts.records[9] = 2;
        assert!(parts.check().is_err());
    }
}
