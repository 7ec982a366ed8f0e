//! Metrics against values that the Python tools print for the same pictures (scipy, and FLIP's own evaluator).

use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;

/// A gradient with a coloured block, and the same shifted and with noise.
pub fn pair(width: usize, height: usize, noise: f64, shift: usize) -> (Picture, Picture) {
    let hash = |x: usize, y: usize, c: usize| {
        let mixed = (x * 73_856_093) ^ (y * 19_349_663) ^ (c * 83_492_791);
        (mixed & 0xffff) as f64 / 65535.0
    };
    let value = |x: usize, y: usize, c: usize| {
        let gradient = 2.0 + 8.0 * (x + c * 5) as f64 / (width + 10) as f64 * (1.0 - 0.5 * y as f64 / height as f64);
        let block = (10..20).contains(&x) && (8..24).contains(&y);
        gradient * if block { [0.2, 1.0, 3.0][c] } else { 1.0 }
    };
    let reference = Picture::from_fn(width, height, |x, y| [0, 1, 2].map(|c| value(x, y, c) as f32));
    let test = Picture::from_fn(width, height, |x, y| {
        [0, 1, 2].map(|c| (value(x + shift, y, c) * (1.0 + noise * (hash(x, y, c) - 0.5))) as f32)
    });
    (test, reference)
}

fn assert_close(name: &str, value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{name} is {value}, expected {expected}");
}

#[test]
fn equal_those_of_the_reference_tools() {
    // energy, nrmse, low, flip
    let cases = [
        ((48, 32, 0.3, 0), [0.998_321_02, 0.095_434_21, 0.006_880_54, 0.059_945_85]),
        ((48, 32, 0.0, 2), [1.042_560_01, 0.221_988_11, 0.090_086_35, 0.110_524_26]),
        ((33, 17, 0.8, 1), [1.025_144_99, 0.335_593_37, 0.061_528_97, 0.164_218_60]),
    ];
    for ((width, height, noise, shift), expected) in cases {
        let (test, reference) = pair(width, height, noise, shift);
        let metrics = Metrics::new(&test, &reference).expect("sizes are equal");
        assert_close("energy", metrics.energy, expected[0], 1e-6);
        assert_close("nrmse", metrics.nrmse, expected[1], 1e-6);
        assert_close("low", metrics.low, expected[2], 1e-6);
        assert_close("flip", metrics.flip, expected[3], 1e-4);
    }
}

#[test]
fn equal_pictures_have_no_error() {
    let (_, reference) = pair(20, 12, 0.0, 0);
    let metrics = Metrics::new(&reference, &reference).expect("sizes are equal");
    assert_eq!((metrics.energy, metrics.nrmse, metrics.low, metrics.flip), (1.0, 0.0, 0.0, 0.0));
}

#[test]
fn pictures_survive_a_file() {
    let folder = std::env::temp_dir().join(format!("bevy_bounce_tests_{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("the temporary folder is writable");
    let (picture, _) = pair(13, 7, 0.5, 0);
    let exr = folder.join("picture.exr");
    picture.save(&exr).expect("EXR is written");
    assert_eq!(Picture::load(&exr).expect("EXR is read"), picture);
    let png = folder.join("picture.png");
    let shown = picture.map(|pixel| pixel.map(|c| (c / 20.0).clamp(0.0, 1.0)));
    shown.save(&png).expect("PNG is written");
    let read = Picture::load(&png).expect("PNG is read");
    let bounds = Bounds { nrmse: Some(0.02), ..Default::default() };
    compare(&read, &shown, &bounds).expect("8 bits are enough for 2 %");
    std::fs::remove_dir_all(&folder).expect("the temporary folder is ours");
}
