//! Light that surfaces send by themselves.

use glam::Vec3;

use super::{Picture, Source, materials, read};
use crate::BakeError;

/// What a material sends: `emissiveFactor` times `KHR_materials_emissive_strength` times the texture, in cd/m².
#[derive(Clone, Debug, Default)]
pub struct Emission {
    /// cd/m².
    pub factor: Vec3,
    /// What the factor is multiplied with.
    pub picture: Option<Picture>,
}

/// The emission of each of [`Scene::materials`](super::Scene::materials).
pub fn emissions(source: &Source) -> Result<Vec<Emission>, BakeError> {
    let wrong = |problem: String| BakeError::source(&source.name, problem);
    let buffers = read::buffers(source).map_err(wrong)?;
    let default = std::iter::once(Ok(Emission::default()));
    let read = source.gltf.materials().map(|material| Emission::read(&material, source, &buffers).map_err(wrong));
    read.chain(default).collect()
}

impl Emission {
    fn read(material: &gltf::Material, source: &Source, buffers: &[Vec<u8>]) -> Result<Self, String> {
        let factor = Vec3::from(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        if material.unlit() || factor.max_element() <= 0.0 {
            return Ok(Self::default());
        }
        let picture = material.emissive_texture();
        let picture = picture.map(|info| Picture::read(&info, materials::LONGEST_SIDE, source, buffers)).transpose()?;
        Ok(Self { factor, picture })
    }

    /// cd/m² at these coordinates of the picture's UV set.
    pub fn radiance(&self, uv: Option<glam::Vec2>) -> Vec3 {
        match (&self.picture, uv) {
            (Some(picture), Some(uv)) => self.factor * picture.color(uv).truncate(),
            _ => self.factor,
        }
    }
}
