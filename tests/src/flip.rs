//! LDR-FLIP: the error that an observer sees when two pictures alternate.
//!
//! Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", HPG 2020, with the separable filters of the
//! authors' later note. Written anew in Rust, so that tests need no C++ compiler; a test holds it against values of the
//! authors' evaluator.

use crate::picture::{Picture, srgb_to_linear};

/// Pixels per degree of a 0.7 m wide screen of 3840 pixels seen from 0.7 m: the evaluator's default.
pub const PIXELS_PER_DEGREE: f64 = 3840.0 * std::f64::consts::PI / 180.0;

/// Exponent of the colour difference (q_c).
const COLOR_EXPONENT: f64 = 0.7;
/// Share of the largest colour difference below which the mapping is steep (p_c).
const COLOR_KNEE: f64 = 0.4;
/// Value that the knee maps to (p_t).
const COLOR_KNEE_VALUE: f64 = 0.95;
/// Width of the feature detector, degrees (w).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of the feature difference (q_f).
const FEATURE_EXPONENT: f64 = 0.5;
/// D65.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

type Plane = Vec<f64>;

/// Mean LDR-FLIP of two pictures whose values are sRGB-encoded, 0 to 1; 0 is identical. The sizes must be equal.
pub fn mean_flip(reference: &Picture, test: &Picture) -> f64 {
    assert_eq!((reference.width, reference.height), (test.width, test.height), "pictures of different size");
    let size = (reference.width, reference.height);
    let (reference, test) = (Opponent::new(reference), Opponent::new(test));
    let color = color_difference(&reference, &test, size);
    let feature = feature_difference(&reference.y, &test.y, size);
    let sum: f64 = color.iter().zip(&feature).map(|(color, feature)| color.powf(1.0 - feature)).sum();
    sum / color.len().max(1) as f64
}

/// A picture in the opponent space Y, C_x, C_z.
struct Opponent {
    y: Plane,
    cx: Plane,
    cz: Plane,
}

impl Opponent {
    fn new(encoded: &Picture) -> Self {
        let mut planes = Self { y: Vec::new(), cx: Vec::new(), cz: Vec::new() };
        for pixel in &encoded.pixels {
            let linear = pixel.map(|c| f64::from(srgb_to_linear(c.clamp(0.0, 1.0))));
            let [x, y, z] = xyz_from_linear(linear);
            let [x, y, z] = [x / WHITE[0], y / WHITE[1], z / WHITE[2]];
            planes.y.push(116.0 * y - 16.0);
            planes.cx.push(500.0 * (x - y));
            planes.cz.push(200.0 * (y - z));
        }
        planes
    }
}

fn xyz_from_linear([r, g, b]: [f64; 3]) -> [f64; 3] {
    [
        (10_135_552.0 * r + 8_788_810.0 * g + 4_435_075.0 * b) / 24_577_794.0,
        (2_613_072.0 * r + 8_788_810.0 * g + 887_015.0 * b) / 12_288_897.0,
        (1_425_312.0 * r + 8_788_810.0 * g + 70_074_185.0 * b) / 73_733_382.0,
    ]
}

fn linear_from_xyz([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.241_003_275 * x - 1.537_398_934 * y - 0.498_615_861 * z,
        -0.969_224_334 * x + 1.875_930_071 * y + 0.041_554_224 * z,
        0.055_639_423 * x - 0.204_011_202 * y + 1.057_148_933 * z,
    ]
}

/// CIELAB with the Hunt effect: chroma shrinks with lightness.
fn hunt_lab(linear: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let xyz = xyz_from_linear(linear);
    let f = |i: usize| {
        let t: f64 = xyz[i] / WHITE[i];
        if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 }
    };
    let lightness = 116.0 * f(1) - 16.0;
    let chroma = |c: f64| 0.01 * lightness * c;
    [lightness, chroma(500.0 * (f(0) - f(1))), chroma(200.0 * (f(1) - f(2)))]
}

/// City-block in lightness, Euclidean in chroma.
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

fn color_difference(reference: &Opponent, test: &Opponent, size: (usize, usize)) -> Plane {
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = COLOR_KNEE * largest;
    let filtered = [reference, test].map(|picture| contrast_sensitivity(picture, size));
    filtered[0]
        .iter()
        .zip(&filtered[1])
        .map(|(&a, &b)| {
            let difference = hyab(hunt_lab(a), hunt_lab(b)).powf(COLOR_EXPONENT);
            if difference < knee {
                difference * COLOR_KNEE_VALUE / knee
            } else {
                COLOR_KNEE_VALUE + (difference - knee) / (largest - knee) * (1.0 - COLOR_KNEE_VALUE)
            }
        })
        .collect()
}

/// Blurs as the eye does, and returns to linear RGB within 0 to 1.
fn contrast_sensitivity(picture: &Opponent, size: (usize, usize)) -> Vec<[f64; 3]> {
    use std::f64::consts::PI;
    let widest = 0.04_f64;
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as isize;
    let gaussian = |height: f64, width: f64| -> Plane {
        let weight = |x: isize| {
            let degrees = x as f64 / PIXELS_PER_DEGREE;
            height * (PI / width).sqrt() * (-PI * PI * degrees * degrees / width).exp()
        };
        (-radius..=radius).map(weight).collect()
    };
    let normalized = |mut filter: Plane| {
        let sum: f64 = filter.iter().sum();
        filter.iter_mut().for_each(|weight| *weight /= sum);
        filter
    };
    let y = normalized(gaussian(1.0, 0.0047));
    let cx = normalized(gaussian(1.0, 0.0053));
    // C_z is a sum of two Gaussians: each is filtered on its own with the square root of its height in either direction.
    let root = |height: f64, width: f64| -> Plane {
        let peak = height * (PI / width).sqrt();
        gaussian(height, width).iter().map(|weight| weight / peak.sqrt()).collect()
    };
    let (mut narrow, mut wide) = (root(34.1, 0.04), root(13.5, 0.025));
    let norm = narrow.iter().sum::<f64>().hypot(wide.iter().sum());
    narrow.iter_mut().chain(&mut wide).for_each(|weight| *weight /= norm);

    let blur = |plane: &Plane, filter: &Plane| convolve(plane, filter, filter, size);
    let (y, cx) = (blur(&picture.y, &y), blur(&picture.cx, &cx));
    let (cz_a, cz_b) = (blur(&picture.cz, &narrow), blur(&picture.cz, &wide));
    (0..y.len())
        .map(|i| {
            let luminance = (y[i] + 16.0) / 116.0;
            let x = luminance + cx[i] / 500.0;
            let z = luminance - (cz_a[i] + cz_b[i]) / 200.0;
            let xyz = [x * WHITE[0], luminance * WHITE[1], z * WHITE[2]];
            linear_from_xyz(xyz).map(|c| c.clamp(0.0, 1.0))
        })
        .collect()
}

fn feature_difference(reference: &Plane, test: &Plane, size: (usize, usize)) -> Plane {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as isize;
    let offsets = || (-radius..=radius).map(|x| x as f64);
    let weight = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    // Positive and negative weights sum to 1 and -1.
    let balanced = |filter: Plane| -> Plane {
        let positive: f64 = filter.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -filter.iter().filter(|w| **w <= 0.0).sum::<f64>();
        filter.iter().map(|&w| w / if w > 0.0 { positive } else { negative }).collect()
    };
    let mut smooth: Plane = offsets().map(weight).collect();
    let sum: f64 = smooth.iter().sum();
    smooth.iter_mut().for_each(|w| *w /= sum);
    let edge = balanced(offsets().map(|x| -x * weight(x)).collect());
    let point = balanced(offsets().map(|x| (x * x / (deviation * deviation) - 1.0) * weight(x)).collect());

    let magnitude = |plane: &Plane, filter: &Plane| -> Plane {
        let gray: Plane = plane.iter().map(|y| (y + 16.0) / 116.0).collect();
        let horizontal = convolve(&gray, filter, &smooth, size);
        let vertical = convolve(&gray, &smooth, filter, size);
        horizontal.iter().zip(&vertical).map(|(x, y)| x.hypot(*y)).collect()
    };
    let (edge_a, edge_b) = (magnitude(reference, &edge), magnitude(test, &edge));
    let (point_a, point_b) = (magnitude(reference, &point), magnitude(test, &point));
    (0..edge_a.len())
        .map(|i| {
            let difference = (edge_a[i] - edge_b[i]).abs().max((point_a[i] - point_b[i]).abs());
            (difference / std::f64::consts::SQRT_2).powf(FEATURE_EXPONENT)
        })
        .collect()
}

/// Separable convolution; beyond the border the outermost pixel repeats.
fn convolve(plane: &Plane, horizontal: &Plane, vertical: &Plane, (width, height): (usize, usize)) -> Plane {
    let clamp = |i: isize, end: usize| i.clamp(0, end as isize - 1) as usize;
    let (rx, ry) = ((horizontal.len() / 2) as isize, (vertical.len() / 2) as isize);
    let mut rows = vec![0.0; plane.len()];
    for y in 0..height {
        for x in 0..width {
            let sample =
                |(i, weight): (usize, &f64)| weight * plane[y * width + clamp(x as isize + i as isize - rx, width)];
            rows[y * width + x] = horizontal.iter().enumerate().map(sample).sum();
        }
    }
    let mut out = vec![0.0; plane.len()];
    for y in 0..height {
        for x in 0..width {
            let sample =
                |(i, weight): (usize, &f64)| weight * rows[clamp(y as isize + i as isize - ry, height) * width + x];
            out[y * width + x] = vertical.iter().enumerate().map(sample).sum();
        }
    }
    out
}
