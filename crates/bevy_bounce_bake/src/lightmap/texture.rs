//! Textures as files: KTX 2 with 9 bits for each of red, green and blue and 5 for their common exponent, which every
//! GPU filters, in 4 bytes a texel.

use glam::{UVec3, Vec3};
use ktx2::dfd::{Basic, Block};
use ktx2::{Format, Header, Index, LevelIndex};

use crate::BakeError;

/// The largest number: 511/512 * 2^16.
pub const LARGEST: f32 = 65_408.0;
/// Bits of a mantissa, and what is added to the exponent.
const MANTISSA: i32 = 9;
const BIAS: i32 = 15;
/// Bytes of a texel.
const TEXEL: usize = 4;

/// A file of a texture, which is flat where its depth is 1. What is larger than [`LARGEST`] is cut off.
pub fn write(texels: &[Vec3], size: UVec3) -> Result<Vec<u8>, BakeError> {
    let format = Format::E5B9G9R9_UFLOAT_PACK32;
    let failed =
        |problem: &dyn std::fmt::Debug| BakeError::Atlas(format!("a texture cannot be described: {problem:?}"));
    let (basic, type_size) = Basic::from_format(format).map_err(|problem| failed(&problem))?;
    let block = Block::Basic(basic).to_vec();
    let descriptor = [&(block.len() as u32 + 4).to_le_bytes(), &block[..]].concat();
    let start = Header::LENGTH + LevelIndex::LENGTH;
    let data = (start + descriptor.len()).next_multiple_of(TEXEL);
    let length = texels.len() * TEXEL;
    let index = Index {
        dfd_byte_offset: start as u32,
        dfd_byte_length: descriptor.len() as u32,
        kvd_byte_offset: 0,
        kvd_byte_length: 0,
        sgd_byte_offset: 0,
        sgd_byte_length: 0,
    };
    let header = Header {
        format: Some(format),
        type_size,
        pixel_width: size.x,
        pixel_height: size.y,
        pixel_depth: if size.z > 1 { size.z } else { 0 },
        layer_count: 0,
        face_count: 1,
        level_count: 1,
        supercompression_scheme: None,
        index,
    };
    let level =
        LevelIndex { byte_offset: data as u64, byte_length: length as u64, uncompressed_byte_length: length as u64 };
    let mut bytes = [&header.as_bytes()[..], &level.as_bytes(), &descriptor].concat();
    bytes.resize(data, 0);
    bytes.extend(texels.iter().flat_map(|texel| rgb9e5(*texel).to_le_bytes()));
    Ok(bytes)
}

/// A colour with a common exponent, rounded to the nearest (Khronos, `EXT_texture_shared_exponent`).
fn rgb9e5(color: Vec3) -> u32 {
    let color = color.clamp(Vec3::ZERO, Vec3::splat(LARGEST));
    let largest = color.max_element();
    let exponent = |of: f32| if of > 0.0 { (of.log2().floor() as i32).max(-BIAS - 1) + 1 + BIAS } else { 0 };
    let unit = |exponent: i32| 2.0f32.powi(exponent - BIAS - MANTISSA);
    let mut shared = exponent(largest);
    if (largest / unit(shared)).round() >= (1 << MANTISSA) as f32 {
        shared += 1;
    }
    let [r, g, b] = color.to_array().map(|channel| (channel / unit(shared)).round() as u32);
    r | g << MANTISSA | b << (2 * MANTISSA) | (shared as u32) << (3 * MANTISSA)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(word: u32) -> Vec3 {
        let unit = 2.0f32.powi((word >> 27) as i32 - BIAS - MANTISSA);
        Vec3::from([0, 9, 18].map(|shift| (word >> shift & 511) as f32 * unit))
    }

    #[test]
    fn numbers_are_kept_to_half_a_step() {
        let mut rng = fastrand::Rng::with_seed(1);
        let large = [LARGEST, 65_000.0, 1.0, 0.999_9, 511.6 / 512.0].map(Vec3::splat);
        let random = (0..10_000).map(|_| {
            let scale = 2.0f32.powf(rng.f32() * 30.0 - 14.0);
            Vec3::from([(); 3].map(|()| rng.f32())) * scale
        });
        for color in random.collect::<Vec<_>>().into_iter().chain(large) {
            let back = decode(rgb9e5(color));
            // The smallest exponent has steps of 2^-24.
            let half_a_step = (color.max_element() / 511.0).max(2.0f32.powi(-25));
            assert!((back - color).abs().max_element() <= half_a_step, "{color} became {back}");
        }
        assert_eq!(decode(rgb9e5(Vec3::new(f32::INFINITY, -1.0, 0.0))), Vec3::new(LARGEST, 0.0, 0.0));
        assert_eq!(rgb9e5(Vec3::ZERO), 0);
    }
}
