//! How far a picture is from its reference.

use crate::flip::mean_flip;
use crate::picture::{Picture, luminance};

/// Distances of a picture from its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metrics {
    /// Mean luminance over the reference's.
    pub energy: f64,
    /// Root mean square error over the reference's mean, RGB.
    pub nrmse: f64,
    /// The same after a Gaussian blur of 3 pixels: what is left when noise is averaged away.
    pub low: f64,
    /// Mean LDR-FLIP with the reference's 90th percentile of luminance shown at one half.
    pub flip: f64,
    /// NaN and infinite values of the picture.
    pub nonfinite: usize,
}

/// What [`Metrics`] may be at most; `None` does not matter.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// Lowest and highest energy.
    pub energy: Option<(f64, f64)>,
    /// Highest low-frequency error.
    pub low: Option<f64>,
    /// Highest FLIP.
    pub flip: Option<f64>,
    /// Highest error.
    pub nrmse: Option<f64>,
}

impl Metrics {
    /// Compares pictures of one size.
    pub fn new(test: &Picture, reference: &Picture) -> Result<Self, String> {
        let sizes = [test, reference].map(|picture| (picture.width, picture.height));
        if sizes[0] != sizes[1] || test.pixels.is_empty() {
            return Err(format!("sizes differ or are empty: {:?} and {:?}", sizes[0], sizes[1]));
        }
        let nonfinite = test.nonfinite();
        let finite = |pixel: [f32; 3]| pixel.map(|c| if c.is_finite() { c } else { 0.0 });
        let test = test.map(finite);
        let mean = reference.pixels.as_flattened().iter().map(|&c| f64::from(c)).sum::<f64>()
            / reference.pixels.as_flattened().len() as f64;
        let scale = 0.5 / percentile(reference.pixels.iter().map(|&p| luminance(p)).collect(), 90.0).max(1e-9);
        let show = |picture: &Picture| {
            picture.map(|pixel| pixel.map(|c| (f64::from(c) * scale).clamp(0.0, 1.0).powf(1.0 / 2.2) as f32))
        };
        Ok(Self {
            energy: test.mean_luminance() / reference.mean_luminance().max(1e-9),
            nrmse: rms(&test, reference) / mean.max(1e-9),
            low: rms(&blur(&test, 3.0), &blur(reference, 3.0)) / mean.max(1e-9),
            flip: mean_flip(&show(reference), &show(&test)),
            nonfinite,
        })
    }

    /// Fails with every bound that is broken; values that are not finite always fail.
    pub fn check(&self, bounds: &Bounds) -> Result<(), String> {
        let mut broken = Vec::new();
        if self.nonfinite > 0 {
            broken.push(format!("{} values are not finite", self.nonfinite));
        }
        if let Some((low, high)) = bounds.energy
            && !(low..=high).contains(&self.energy)
        {
            broken.push(format!("energy {:.4} is outside {low} to {high}", self.energy));
        }
        let highest =
            [("low", self.low, bounds.low), ("flip", self.flip, bounds.flip), ("nrmse", self.nrmse, bounds.nrmse)];
        for (name, value, bound) in highest {
            // A NaN must not pass.
            if bound.is_some_and(|bound| value.is_nan() || value > bound) {
                broken.push(format!("{name} {value:.4} is above {}", bound.unwrap_or_default()));
            }
        }
        if broken.is_empty() { Ok(()) } else { Err(broken.join("; ")) }
    }
}

/// Compares and checks in one step; fails with the broken bounds and all metrics.
pub fn compare(test: &Picture, reference: &Picture, bounds: &Bounds) -> Result<Metrics, String> {
    let metrics = Metrics::new(test, reference)?;
    metrics.check(bounds).map_err(|broken| format!("{broken} ({metrics:?})"))?;
    Ok(metrics)
}

fn rms(a: &Picture, b: &Picture) -> f64 {
    let (a, b) = (a.pixels.as_flattened(), b.pixels.as_flattened());
    let sum: f64 = a.iter().zip(b).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Linear interpolation between the closest ranks, as numpy's default.
fn percentile(mut values: Vec<f64>, percent: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let rank = percent / 100.0 * values.len().saturating_sub(1) as f64;
    let (below, share) = (rank.floor() as usize, rank.fract());
    let value = |i: usize| values.get(i).or(values.last()).copied().unwrap_or(0.0);
    value(below) * (1.0 - share) + value(below + 1) * share
}

/// Gaussian blur cut off at four deviations, mirrored at the border (the border pixel twice), as scipy's default.
fn blur(picture: &Picture, deviation: f64) -> Picture {
    let radius = (4.0 * deviation + 0.5) as isize;
    let weight = |x: isize| (-0.5 * (x as f64 / deviation).powi(2)).exp();
    let sum: f64 = (-radius..=radius).map(weight).sum();
    let filter: Vec<(isize, f64)> = (-radius..=radius).map(|x| (x, weight(x) / sum)).collect();
    let mirror = |i: isize, end: usize| {
        let i = i.rem_euclid(2 * end as isize) as usize;
        if i < end { i } else { 2 * end - 1 - i }
    };
    let (width, height) = (picture.width, picture.height);
    let pass = |source: &Vec<[f64; 3]>, at: &dyn Fn(usize, usize, isize) -> usize| -> Vec<[f64; 3]> {
        let pixel = |i: usize| {
            let mut mean = [0.0; 3];
            for &(offset, weight) in &filter {
                let sample = source[at(i % width, i / width, offset)];
                (0..3).for_each(|c| mean[c] += weight * sample[c]);
            }
            mean
        };
        (0..source.len()).map(pixel).collect()
    };
    let source = picture.pixels.iter().map(|pixel| pixel.map(f64::from)).collect();
    let rows = pass(&source, &|x, y, offset| y * width + mirror(x as isize + offset, width));
    let both = pass(&rows, &|x, y, offset| mirror(y as isize + offset, height) * width + x);
    Picture { width, height, pixels: both.iter().map(|pixel| pixel.map(|c| c as f32)).collect() }
}
