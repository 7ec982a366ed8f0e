//! Triangles with holes.

use glam::Vec2;

use super::{Material, Part};

/// A triangle of a masked surface: it is there where alpha reaches the cutoff.
#[derive(Clone, Copy, Debug)]
pub struct Cutout {
    uv: Option<[Vec2; 3]>,
    /// Of the vertex colours.
    alpha: [f32; 3],
    /// Which of [`Scene::materials`](super::Scene::materials).
    material: usize,
}

impl Cutout {
    /// Of a triangle of a part; nothing where its material has no holes.
    pub(crate) fn new(part: &Part, material: &Material, corners: [u32; 3]) -> Option<Self> {
        let uv = part.texture_coordinates(material).map(|uv| corners.map(|index| uv[index as usize]));
        let alpha = part.colors.as_ref().map_or([1.0; 3], |colors| corners.map(|index| colors[index as usize].w));
        (material.cutoff > 0.0).then_some(Self { uv, alpha, material: part.material })
    }

    /// Whether the surface is there at these weights of the corners, which add up to 1.
    pub fn is_there(&self, materials: &[Material], weights: [f32; 3]) -> bool {
        let material = &materials[self.material];
        let uv = self.uv.map(|uv| (0..3).map(|corner| uv[corner] * weights[corner]).sum());
        let alpha: f32 = (0..3).map(|corner| self.alpha[corner] * weights[corner]).sum();
        alpha * material.color(uv).w >= material.cutoff
    }
}
