//! What is baked: the triangles of a scene and their colours, in the space of the scene's root.

mod check;
mod materials;
mod read;
mod source;

pub use materials::{Material, Picture};
pub use source::Source;

use glam::{Vec2, Vec3};

/// One primitive of one mesh, as one node places it.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// Name of the mesh and number of the primitive, for messages.
    pub name: String,
    /// Numbers of node, mesh and primitive in the source.
    pub numbers: [u32; 3],
    /// Positions in world units.
    pub positions: Vec<Vec3>,
    /// Three indices a triangle, counter-clockwise from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Number of each in the source, where those without area count too.
    pub source_triangles: Vec<u32>,
    /// Triangles in the source.
    pub source_count: u32,
    /// First UV set, for the colour texture.
    pub uv0: Option<Vec<Vec2>>,
    /// Second UV set, for the atlas.
    pub uv1: Option<Vec<Vec2>>,
    /// Linear vertex colours.
    pub colors: Option<Vec<Vec3>>,
    /// Which of [`Scene::materials`].
    pub material: usize,
}

/// The object to bake: everything its scene shows that is rigid.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// In the order of the nodes.
    pub parts: Vec<Part>,
    /// Colours; the last one is glTF's default material.
    pub materials: Vec<Material>,
    /// Hash of the source, for telling whether a bake belongs to it.
    pub source_hash: u64,
}

impl Scene {
    /// Three corners of each triangle, part by part.
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.parts
            .iter()
            .flat_map(|part| part.triangles.iter().map(|corners| corners.map(|index| part.positions[index as usize])))
    }

    /// Smallest and largest corner of the box round all triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.triangles().flatten().fold(empty, |(min, max), corner| (min.min(corner), max.max(corner)))
    }
}
