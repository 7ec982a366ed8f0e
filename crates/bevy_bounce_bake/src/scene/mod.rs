//! What is baked: the triangles of a scene and their colours, in the space of the scene's root.

mod check;
mod cutout;
mod emission;
mod lights;
mod materials;
mod read;
mod source;

pub use cutout::Cutout;
pub(crate) use emission::{Emission, emissions};
pub(crate) use lights::{Light, lights};
pub use materials::{Material, Picture};
pub(crate) use read::buffers;
pub use source::Source;

use glam::{Vec2, Vec3, Vec4};

use crate::BakeError;

/// Smallest and largest object that can be baked, in world units: products of four lengths stay numbers.
const LEAST_DIAMETER: f32 = 1.0e-6;
const MOST_DIAMETER: f32 = 1.0e6;

/// One primitive of one mesh, as one node places it. A double-sided one is two parts in a row: its fronts, then the same
/// triangles turned over.
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
    /// Normals of the vertices, unit length.
    pub normals: Option<Vec<Vec3>>,
    /// First UV set, for the colour texture.
    pub uv0: Option<Vec<Vec2>>,
    /// Second UV set, for the atlas.
    pub uv1: Option<Vec<Vec2>>,
    /// Linear vertex colours and alpha.
    pub colors: Option<Vec<Vec4>>,
    /// Which of [`Scene::materials`].
    pub material: usize,
    /// The backs of the part before. Stops no light that the fronts do not.
    pub back: bool,
    /// Placed by a transform that mirrors: corners are in the other order than the source's.
    pub mirrored: bool,
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

impl Part {
    /// A white part. Triangles without area are left out.
    fn new(name: String, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, String> {
        if let Some(vertex) = positions.iter().position(|position| !position.is_finite()) {
            return Err(format!("the position of vertex {vertex} is not a finite number; export it anew"));
        }
        if let Some(index) = triangles.as_flattened().iter().find(|&&index| index as usize >= positions.len()) {
            return Err(format!("index {index} is past the {} vertices; export it anew", positions.len()));
        }
        let area = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|index| positions[index as usize]);
            (b - a).cross(c - a).length_squared()
        };
        let source_count = triangles.len() as u32;
        let solid = (0..source_count).zip(triangles).filter(|(_, corners)| area(corners) > 0.0);
        let (source_triangles, triangles) = solid.unzip();
        Ok(Self { name, positions, triangles, source_triangles, source_count, ..Self::default() })
    }

    /// The part's backs.
    fn turned_over(&self) -> Self {
        let back = Self { name: format!("{}, back", self.name), back: true, ..self.clone() };
        let triangles = self.triangles.iter().map(|&corners| back.source_order(corners)).collect();
        let normals = self.normals.as_ref().map(|normals| normals.iter().map(|normal| -normal).collect());
        Self { triangles, normals, ..back }
    }

    /// A triangle's corners in the order of the source instead of the part's, or the other way round.
    pub(crate) fn source_order<T: Copy>(&self, [a, b, c]: [T; 3]) -> [T; 3] {
        if self.back { [a, c, b] } else { [a, b, c] }
    }

    /// The UV set that the material's colour texture takes.
    pub fn texture_coordinates(&self, material: &Material) -> Option<&Vec<Vec2>> {
        self.coordinates_of(material.picture.as_ref())
    }

    /// The UV set that a texture takes.
    pub(crate) fn coordinates_of(&self, picture: Option<&Picture>) -> Option<&Vec<Vec2>> {
        match picture {
            Some(picture) if picture.uv_set == 1 => self.uv1.as_ref(),
            _ => self.uv0.as_ref(),
        }
    }
}

impl Scene {
    /// A single white mesh, without a glTF file.
    pub fn from_mesh(name: &str, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Result<Self, BakeError> {
        let part = Part::new(name.to_owned(), positions, triangles);
        let part = part.map_err(|problem| BakeError::source(name, problem))?;
        let scene = Self { parts: vec![part], materials: vec![Material::default()], source_hash: 0 };
        scene.checked(name)
    }

    /// Whether there is something to bake, of a size that can be reckoned with.
    fn checked(self, name: &str) -> Result<Self, BakeError> {
        if self.parts.iter().all(|part| part.triangles.is_empty()) {
            let problem = "shows no triangle of any area that stops light: export opaque or masked meshes with faces";
            return Err(BakeError::source(name, problem.to_owned()));
        }
        let (min, max) = self.bounds();
        let diameter = min.distance(max);
        if !(LEAST_DIAMETER..=MOST_DIAMETER).contains(&diameter) {
            let problem =
                format!("is {diameter:e} units large; scale it to between {LEAST_DIAMETER:e} and {MOST_DIAMETER:e}");
            return Err(BakeError::source(name, problem));
        }
        Ok(self)
    }

    /// Without the parts of nodes that move: those with a skin, morph targets or an animation, and what hangs on the latter; and
    /// without those that have no triangle of any area.
    pub fn still(self, source: &Source) -> Result<Self, BakeError> {
        let moving = read::moving_nodes(source);
        let stays = |part: &Part| !part.triangles.is_empty() && !moving.contains(&(part.numbers[0] as usize));
        let parts = self.parts.into_iter().filter(stays).collect();
        Self { parts, ..self }.checked(&source.name)
    }

    /// Three corners of each triangle, part by part.
    pub fn triangles(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.parts
            .iter()
            .flat_map(|part| part.triangles.iter().map(|corners| corners.map(|index| part.positions[index as usize])))
    }

    /// Three corners of each triangle that stops light, and its holes, part by part: those of [`triangles`](Self::triangles)
    /// but for backs.
    pub fn occluders(&self) -> impl Iterator<Item = ([Vec3; 3], Option<Cutout>)> + '_ {
        self.parts.iter().filter(|part| !part.back).flat_map(|part| {
            let material = &self.materials[part.material];
            part.triangles.iter().map(|&corners| {
                let cutout = Cutout::new(part, material, corners);
                (corners.map(|index| part.positions[index as usize]), cutout)
            })
        })
    }

    /// Smallest and largest corner of the box round all triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.triangles().flatten().fold(empty, |(min, max), corner| (min.min(corner), max.max(corner)))
    }
}
