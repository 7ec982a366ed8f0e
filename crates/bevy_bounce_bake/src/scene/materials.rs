//! Diffuse colours.

use glam::{Vec2, Vec3};
use gltf::texture::WrappingMode;

use super::Source;

/// Longest side that is kept of a picture, in pixels. An atlas texel covers more than a pixel of what is left.
const LONGEST_SIDE: u32 = 512;

/// The diffuse colour of a surface, linear.
#[derive(Clone, Debug)]
pub struct Material {
    /// Factor, already reduced by how metallic the surface is.
    pub factor: Vec3,
    /// What the factor is multiplied with.
    pub picture: Option<Picture>,
}

impl Default for Material {
    fn default() -> Self {
        Self { factor: Vec3::ONE, picture: None }
    }
}

/// A colour texture.
#[derive(Clone, Debug)]
pub struct Picture {
    width: u32,
    height: u32,
    /// Linear colours, row by row.
    pixels: Vec<Vec3>,
    wrap: [WrappingMode; 2],
    /// Which UV set: 0 or 1.
    pub uv_set: u32,
}

impl Material {
    pub(super) fn read(material: &gltf::Material, source: &Source, buffers: &[Vec<u8>]) -> Result<Self, String> {
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        // A metal has no diffuse colour; where a texture says how metallic a surface is, the factor alone says nothing.
        let metallic = if pbr.metallic_roughness_texture().is_some() { 0.0 } else { pbr.metallic_factor() };
        let factor = Vec3::new(r, g, b) * (1.0 - metallic);
        let picture = match pbr.base_color_texture() {
            Some(info) => Some(Picture::read(&info, source, buffers)?),
            None => None,
        };
        Ok(Self { factor, picture })
    }

    /// The colour at these coordinates of the picture's UV set.
    pub fn color(&self, uv: Option<Vec2>) -> Vec3 {
        match (&self.picture, uv) {
            (Some(picture), Some(uv)) => self.factor * picture.color(uv),
            _ => self.factor,
        }
    }
}

impl Picture {
    fn read(info: &gltf::texture::Info, source: &Source, buffers: &[Vec<u8>]) -> Result<Self, String> {
        let texture = info.texture();
        let image = texture.source();
        let wrong = |problem: String| format!("image {}: {problem}", image.index());
        let bytes = match image.source() {
            gltf::image::Source::Uri { uri, .. } => source.file(uri).map_err(wrong)?,
            gltf::image::Source::View { view, .. } => {
                let buffer = &buffers[view.buffer().index()];
                buffer[view.offset()..view.offset() + view.length()].to_vec()
            }
        };
        let decoded = image::load_from_memory(&bytes)
            .map_err(|error| wrong(format!("{error}; export colour textures as PNG or JPEG")))?;
        let longest = decoded.width().max(decoded.height());
        let small = if longest > LONGEST_SIDE { decoded.thumbnail(LONGEST_SIDE, LONGEST_SIDE) } else { decoded };
        let small = small.to_rgb8();
        let sampler = texture.sampler();
        Ok(Self {
            width: small.width(),
            height: small.height(),
            pixels: small.pixels().map(|pixel| Vec3::from(pixel.0.map(linear))).collect(),
            wrap: [sampler.wrap_s(), sampler.wrap_t()],
            uv_set: info.tex_coord(),
        })
    }

    fn color(&self, uv: Vec2) -> Vec3 {
        let [x, y] = [(uv.x, self.wrap[0], self.width), (uv.y, self.wrap[1], self.height)].map(|(t, wrap, size)| {
            let t = match wrap {
                WrappingMode::ClampToEdge => t.clamp(0.0, 1.0),
                WrappingMode::Repeat => t.rem_euclid(1.0),
                WrappingMode::MirroredRepeat => 1.0 - (t.rem_euclid(2.0) - 1.0).abs(),
            };
            ((t * size as f32) as u32).min(size - 1)
        });
        self.pixels[(y * self.width + x) as usize]
    }
}

/// The linear value of an sRGB byte.
fn linear(byte: u8) -> f32 {
    let value = f32::from(byte) / 255.0;
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
