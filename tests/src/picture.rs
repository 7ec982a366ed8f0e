//! Pictures of linear RGB.

use std::path::Path;

/// Linear RGB, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` pixels.
    pub pixels: Vec<[f32; 3]>,
}

/// Rec. 709 weights of luminance.
pub const LUMA: [f64; 3] = [0.2126, 0.7152, 0.0722];

impl Picture {
    /// A picture computed pixel by pixel.
    pub fn from_fn(width: usize, height: usize, mut pixel: impl FnMut(usize, usize) -> [f32; 3]) -> Self {
        let pixels = (0..width * height).map(|i| pixel(i % width, i / width)).collect();
        Self { width, height, pixels }
    }

    /// Reads an EXR (as it is) or a PNG (sRGB made linear).
    pub fn load(path: &Path) -> Result<Self, String> {
        let decoded = image::open(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let linear = decoded.as_rgb32f().is_some() || decoded.as_rgba32f().is_some();
        let rgb = decoded.into_rgb32f();
        let to_linear = |c: f32| if linear { c } else { srgb_to_linear(c) };
        let pixels = rgb.pixels().map(|pixel| pixel.0.map(to_linear)).collect();
        Ok(Self { width: rgb.width() as usize, height: rgb.height() as usize, pixels })
    }

    /// Writes an EXR, or a PNG that shows linear 0 to 1.
    pub fn save(&self, path: &Path) -> Result<(), String> {
        let (width, height) = (self.width as u32, self.height as u32);
        let buffer = image::Rgb32FImage::from_vec(width, height, self.pixels.as_flattened().to_vec())
            .ok_or("pixel count does not match the size")?;
        let fail = |error: image::ImageError| format!("{}: {error}", path.display());
        if path.extension().is_some_and(|extension| extension == "exr") {
            return buffer.save(path).map_err(fail);
        }
        let byte = |c: &f32| (linear_to_srgb(c.clamp(0.0, 1.0)) * 255.0).round() as u8;
        image::RgbImage::from_vec(width, height, buffer.iter().map(byte).collect())
            .ok_or("pixel count does not match the size")?
            .save(path)
            .map_err(fail)
    }

    /// The pixel in column `x` of row `y`.
    pub fn at(&self, x: usize, y: usize) -> [f32; 3] {
        self.pixels[y * self.width + x]
    }

    /// The same picture with every pixel changed.
    pub fn map(&self, mut change: impl FnMut([f32; 3]) -> [f32; 3]) -> Self {
        let pixels = self.pixels.iter().map(|&pixel| change(pixel)).collect();
        Self { width: self.width, height: self.height, pixels }
    }

    /// Values that are NaN or infinite.
    pub fn nonfinite(&self) -> usize {
        self.pixels.as_flattened().iter().filter(|c| !c.is_finite()).count()
    }

    /// Mean luminance.
    pub fn mean_luminance(&self) -> f64 {
        self.pixels.iter().map(|&pixel| luminance(pixel)).sum::<f64>() / self.pixels.len().max(1) as f64
    }

    /// Mean colour of the pixels `x0..x1`, `y0..y1`.
    pub fn mean_of(&self, x: std::ops::Range<usize>, y: std::ops::Range<usize>) -> [f64; 3] {
        let mut sum = [0.0; 3];
        let count = (x.len() * y.len()).max(1) as f64;
        for row in y {
            for column in x.clone() {
                for (sum, c) in sum.iter_mut().zip(self.at(column, row)) {
                    *sum += f64::from(c) / count;
                }
            }
        }
        sum
    }
}

/// Luminance of linear RGB.
pub fn luminance(pixel: [f32; 3]) -> f64 {
    pixel.iter().zip(LUMA).map(|(&c, weight)| f64::from(c) * weight).sum()
}

/// IEC 61966-2-1.
pub fn srgb_to_linear(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// IEC 61966-2-1.
pub fn linear_to_srgb(c: f32) -> f32 {
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
}
