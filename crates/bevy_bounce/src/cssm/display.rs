//! How much light makes a step on the display: the inverse of Bevy's tone mapping, for greys, in the dark.
//!
//! The tables of some methods are read where Bevy keeps them; without Bevy's feature `tonemapping_luts` there are none, and light
//! counts as it is.

use bevy::core_pipeline::tonemapping::{Tonemapping, TonemappingLuts};
use bevy::image::Image;
use bevy::prelude::*;
use bevy::render::render_resource::TextureFormat;

/// Exposed light whose display value is `steps` 255ths above black.
pub fn light_of_steps(tonemapping: Tonemapping, luts: Option<(&TonemappingLuts, &Assets<Image>)>, steps: f32) -> f32 {
    let table = |handle: fn(&TonemappingLuts) -> &Handle<Image>| {
        let (luts, images) = luts?;
        images.get(handle(luts)).and_then(greys)
    };
    match tonemapping {
        Tonemapping::None => invert(|x| x, steps),
        Tonemapping::Reinhard | Tonemapping::ReinhardLuminance => invert(|x| x / (1.0 + x), steps),
        Tonemapping::AcesFitted => invert(aces, steps),
        Tonemapping::SomewhatBoringDisplayTransform => invert(|x| 0.97 * (1.0 - (-x).exp()), steps),
        Tonemapping::KhronosPbrNeutral => invert(pbr_neutral, steps),
        Tonemapping::TonyMcMapface => by_table(table(|luts| &luts.tony_mc_mapface), |x| x / (1.0 + x), steps),
        Tonemapping::AgX => by_table(table(|luts| &luts.agx), |x| log_encoded(x, -10.0, 6.5), steps),
        Tonemapping::BlenderFilmic => {
            by_table(table(|luts| &luts.blender_filmic), |x| log_encoded(x, -11.0, 12.0), steps)
        }
    }
}

fn by_table(table: Option<Vec<f32>>, place: impl Fn(f32) -> f32, steps: f32) -> f32 {
    match table {
        Some(table) => invert(|x| sample(&table, place(x)), steps),
        None => invert(|x| x, steps),
    }
}

/// Where a curve is `steps` 255ths of the display's range above where it begins, by bisection.
fn invert(curve: impl Fn(f32) -> f32, steps: f32) -> f32 {
    let shown = |x: f32| srgb(curve(x));
    let wanted = shown(0.0) + steps / 255.0;
    let (mut low, mut high) = (0.0_f32, 64.0_f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if shown(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// The display's encoding of linear light.
fn srgb(x: f32) -> f32 {
    let x = x.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Stephen Hill's fit of the ACES transforms, for greys; their matrices keep grey as it is.
fn aces(x: f32) -> f32 {
    (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (0.983_729 * x + 0.432_951) + 0.238_081)
}

/// Khronos PBR neutral below where it compresses.
fn pbr_neutral(x: f32) -> f32 {
    let offset = if x < 0.08 { x - 6.25 * x * x } else { 0.04 };
    x - offset
}

/// Bevy's `convertOpenDomainToNormalizedLog2_`.
fn log_encoded(x: f32, least: f32, most: f32) -> f32 {
    let x = if x < 0.000_030_517_57 { x + 0.000_015_258_78 } else { x };
    ((x / 0.18).log2().clamp(least, most) - least) / (most - least)
}

/// A table of greys at a place from 0 to 1.
fn sample(table: &[f32], place: f32) -> f32 {
    let at = place.clamp(0.0, 1.0) * (table.len() - 1) as f32;
    let low = (at as usize).min(table.len().saturating_sub(2));
    let part = at - low as f32;
    table[low] * (1.0 - part) + table[(low + 1).min(table.len() - 1)] * part
}

/// The diagonal of a table, green channel; nothing of a format that Bevy's tables do not have.
fn greys(image: &Image) -> Option<Vec<f32>> {
    let size = image.texture_descriptor.size;
    let (side, data) = (size.width as usize, image.data.as_ref()?);
    let cubic = size.height as usize == side && size.depth_or_array_layers as usize == side && side > 1;
    let bytes = image.texture_descriptor.format.block_copy_size(None)? as usize;
    let green: fn(&[u8]) -> Option<f32> = match image.texture_descriptor.format {
        TextureFormat::Rgb9e5Ufloat => |texel| {
            let word = u32::from_le_bytes(texel.try_into().ok()?);
            Some((word >> 9 & 0x1ff) as f32 * 2.0_f32.powi((word >> 27) as i32 - 24))
        },
        TextureFormat::Rgba16Float => |texel| Some(half::f16::from_le_bytes([texel[2], texel[3]]).to_f32()),
        TextureFormat::Rgba8Unorm => |texel| Some(f32::from(texel[1]) / 255.0),
        _ => return None,
    };
    let diagonal = (0..side).map(|i| {
        let at = (i * side * side + i * side + i) * bytes;
        data.get(at..at + bytes).and_then(green)
    });
    if cubic { diagonal.collect() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_are_inverted() {
        let none = light_of_steps(Tonemapping::None, None, 1.0);
        assert!((none - 1.0 / 255.0 / 12.92).abs() < 1.0e-7);
        let reinhard = light_of_steps(Tonemapping::Reinhard, None, 255.0 * srgb(0.5));
        assert!((reinhard - 1.0).abs() < 1.0e-4, "{reinhard}");
        // A toe: the first step takes more light than without it.
        assert!(light_of_steps(Tonemapping::AcesFitted, None, 1.0) > 1.5 * none);
        assert!(light_of_steps(Tonemapping::KhronosPbrNeutral, None, 1.0) > 4.0 * none);
    }

    #[test]
    fn more_steps_take_more_light() {
        for method in [Tonemapping::AcesFitted, Tonemapping::SomewhatBoringDisplayTransform, Tonemapping::None] {
            let light = [0.5, 1.0, 2.0, 8.0].map(|steps| light_of_steps(method, None, steps));
            assert!(light.is_sorted() && light[0] > 0.0, "{method:?}: {light:?}");
        }
    }

    #[test]
    fn tables_are_read() {
        use bevy::asset::RenderAssetUsages;
        use bevy::render::render_resource::{Extent3d, TextureDimension};
        let side = 4_u32;
        let texels = (0..side.pow(3)).flat_map(|i| {
            let green = (i / side % side) as f32 / 6.0;
            [0.0, green, 0.0, 1.0].map(|value| half::f16::from_f32(value).to_le_bytes()).concat()
        });
        let image = Image::new(
            Extent3d { width: side, height: side, depth_or_array_layers: side },
            TextureDimension::D3,
            texels.collect(),
            TextureFormat::Rgba16Float,
            RenderAssetUsages::default(),
        );
        let table = greys(&image).expect("such a table is known");
        assert!((sample(&table, 1.0) - 0.5).abs() < 1.0e-3 && (sample(&table, 0.5) - 0.25).abs() < 1.0e-3);
    }
}
