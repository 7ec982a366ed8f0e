//! Diffuse colours, and where a surface is at all.
//!
//! - Masked surfaces (`alphaMode` `MASK`) are there where alpha reaches the cutoff: rays pass their holes, and texels count
//!   what is left.
//! - Blended surfaces (`BLEND`) and those that transmit (`KHR_materials_transmission`) are not there: light passes them, and
//!   they have no texels.
//! - Double-sided surfaces have texels on both sides. All surfaces stop light from both sides.
//! - Unlit surfaces stop light and reflect none.
//! - A metal sends light on by its base colour, as if it were matt: what it mirrors lights others no less.

use glam::{Affine2, Mat2, Vec2, Vec3, Vec4};
use gltf::material::AlphaMode;
use gltf::texture::WrappingMode;

use super::Source;

/// Longest side that is kept of a colour texture, in pixels. An atlas texel covers more than a pixel of what is left.
pub(super) const LONGEST_SIDE: u32 = 512;
/// The same of a texture that says where a surface is: rays meet single pixels of it.
const LONGEST_MASK: u32 = 4096;

/// What a surface reflects, linear, and where it is.
#[derive(Clone, Debug)]
pub struct Material {
    /// Colour and alpha.
    pub factor: Vec4,
    /// What the factor is multiplied with.
    pub picture: Option<Picture>,
    /// The surface is there where alpha is at least that; 0 for everywhere.
    pub cutoff: f32,
    /// Light passes it.
    pub transparent: bool,
    /// Both sides reflect.
    pub two_sided: bool,
}

impl Default for Material {
    fn default() -> Self {
        Self { factor: Vec4::ONE, picture: None, cutoff: 0.0, transparent: false, two_sided: false }
    }
}

/// A colour texture.
#[derive(Clone, Debug)]
pub struct Picture {
    width: u32,
    height: u32,
    /// sRGB and alpha, row by row.
    pixels: Vec<[u8; 4]>,
    wrap: [WrappingMode; 2],
    /// From the UV set to the picture.
    transform: Affine2,
    /// Which UV set: 0 or 1.
    pub uv_set: u32,
}

impl Material {
    pub(super) fn read(material: &gltf::Material, source: &Source, buffers: &[Vec<u8>]) -> Result<Self, String> {
        let pbr = material.pbr_metallic_roughness();
        let reflects = if material.unlit() { 0.0 } else { 1.0 };
        let factor = Vec4::from(pbr.base_color_factor()) * Vec3::splat(reflects).extend(1.0);
        let cutoff = match material.alpha_mode() {
            AlphaMode::Mask => material.alpha_cutoff().unwrap_or(0.5),
            AlphaMode::Opaque | AlphaMode::Blend => 0.0,
        };
        let longest = if cutoff > 0.0 { LONGEST_MASK } else { LONGEST_SIDE };
        let picture = match pbr.base_color_texture() {
            Some(info) => Some(Picture::read(&info, longest, source, buffers)?),
            None => None,
        };
        let transmission = material.transmission().map_or(0.0, |glass| glass.transmission_factor());
        let transparent = material.alpha_mode() == AlphaMode::Blend || transmission > 0.0;
        Ok(Self { factor, picture, cutoff, transparent, two_sided: material.double_sided() })
    }

    /// Colour and alpha at these coordinates of the picture's UV set.
    pub fn color(&self, uv: Option<Vec2>) -> Vec4 {
        match (&self.picture, uv) {
            (Some(picture), Some(uv)) => self.factor * picture.color(uv),
            _ => self.factor,
        }
    }
}

impl Picture {
    pub(super) fn read(
        info: &gltf::texture::Info,
        longest: u32,
        source: &Source,
        buffers: &[Vec<u8>],
    ) -> Result<Self, String> {
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
        let large = decoded.width().max(decoded.height()) > longest;
        let small = if large { decoded.thumbnail(longest, longest) } else { decoded }.to_rgba8();
        let sampler = texture.sampler();
        let place = info.texture_transform();
        let transform = place.as_ref().map_or(Affine2::IDENTITY, |place| {
            // Turned by the negative angle, as glTF has it.
            let turned = Mat2::from_angle(-place.rotation()) * Mat2::from_diagonal(place.scale().into());
            Affine2::from_mat2_translation(turned, place.offset().into())
        });
        Ok(Self {
            width: small.width(),
            height: small.height(),
            pixels: small.pixels().map(|pixel| pixel.0).collect(),
            wrap: [sampler.wrap_s(), sampler.wrap_t()],
            transform,
            uv_set: place.and_then(|place| place.tex_coord()).unwrap_or(info.tex_coord()),
        })
    }

    pub(super) fn color(&self, uv: Vec2) -> Vec4 {
        let uv = self.transform.transform_point2(uv);
        let [x, y] = [(uv.x, self.wrap[0], self.width), (uv.y, self.wrap[1], self.height)].map(|(t, wrap, size)| {
            let t = match wrap {
                WrappingMode::ClampToEdge => t.clamp(0.0, 1.0),
                WrappingMode::Repeat => t.rem_euclid(1.0),
                WrappingMode::MirroredRepeat => 1.0 - (t.rem_euclid(2.0) - 1.0).abs(),
            };
            ((t * size as f32) as u32).min(size - 1)
        });
        let [r, g, b, a] = self.pixels[(y * self.width + x) as usize];
        Vec3::from([r, g, b].map(|byte| linear(f32::from(byte) / 255.0))).extend(f32::from(a) / 255.0)
    }
}

/// The linear value of an sRGB one.
pub(super) fn linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}
