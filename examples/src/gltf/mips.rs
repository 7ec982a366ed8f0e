//! Mip levels for textures that come without, as those of glTF files do: else they glitter when seen from afar.

use bevy::prelude::*;
use bevy::render::render_resource::{TextureDimension, TextureFormat};

/// Gives every plain 8-bit texture its mip levels, averaged in linear light.
pub fn generate(images: &mut Assets<Image>) {
    let plain = |image: &Image| {
        let texture = &image.texture_descriptor;
        texture.mip_level_count == 1
            && texture.dimension == TextureDimension::D2
            && texture.size.depth_or_array_layers == 1
            && matches!(texture.format, TextureFormat::Rgba8Unorm | TextureFormat::Rgba8UnormSrgb)
            && image.data.as_ref().is_some_and(|data| {
                data.len() == texture.size.width as usize * texture.size.height as usize * 4 && data.len() > 4
            })
    };
    let ids: Vec<_> = images.iter().filter(|(_, image)| plain(image)).map(|(id, _)| id).collect();
    for id in ids {
        let Some(mut image) = images.get_mut(id) else { continue };
        let (size, srgb) = (image.size(), image.texture_descriptor.format == TextureFormat::Rgba8UnormSrgb);
        if let Some(data) = &mut image.data {
            let levels = append_levels(data, size, srgb);
            image.texture_descriptor.mip_level_count = levels;
        }
    }
}

/// Appends all levels below the first to `texels`, and says how many there are now.
fn append_levels(texels: &mut Vec<u8>, size: UVec2, srgb: bool) -> u32 {
    let decode: Vec<f32> =
        (0..=255u8).map(|byte| if srgb { linear(f32::from(byte) / 255.0) } else { f32::from(byte) }).collect();
    let encode = |value: f32| if srgb { (nonlinear(value) * 255.0).round() as u8 } else { value.round() as u8 };
    let (mut size, mut start, mut levels) = (size, 0, 1);
    while size.max_element() > 1 {
        let next = (size / 2).max(UVec2::ONE);
        let level = texels.len();
        for y in 0..next.y {
            for x in 0..next.x {
                let at = |dx: u32, dy: u32| {
                    let (x, y) = ((2 * x + dx).min(size.x - 1), (2 * y + dy).min(size.y - 1));
                    start + (y * size.x + x) as usize * 4
                };
                let four = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                for channel in 0..3 {
                    let sum: f32 = four.iter().map(|texel| decode[usize::from(texels[texel + channel])]).sum();
                    texels.push(encode(sum * 0.25));
                }
                let alpha: u32 = four.iter().map(|texel| u32::from(texels[texel + 3])).sum();
                texels.push(((alpha + 2) / 4) as u8);
            }
        }
        (size, start, levels) = (next, level, levels + 1);
    }
    levels
}

fn linear(value: f32) -> f32 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

fn nonlinear(value: f32) -> f32 {
    if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_average_linear_light() {
        let mut texels = [[0, 0, 0, 255], [255, 255, 255, 255]].concat();
        assert_eq!(append_levels(&mut texels, UVec2::new(2, 1), true), 2);
        assert_eq!(texels[8..], [188, 188, 188, 255]);
        let mut constant = [10, 20, 30, 40].repeat(5 * 3);
        assert_eq!(append_levels(&mut constant, UVec2::new(5, 3), false), 3);
        assert!(constant.chunks_exact(4).all(|texel| texel == [10, 20, 30, 40]));
    }
}
