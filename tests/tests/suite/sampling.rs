//! The quasi-random sequence and what is made of it: stratification, and distributions by the chi-squared test.

use bevy::math::{Vec2, Vec3};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::stats::chi_squared_p_value;
use bevy_bounce_tests::twins::random::Random;
use bevy_bounce_tests::twins::sampling;

/// Evaluates a WGSL expression of `p` (index, dimension, unit square) for every input.
fn evaluate(expression: &str, inputs: &[[f32; 4]]) -> Vec<[f32; 4]> {
    let source = format!(
        "#import bevy_bounce::shared::sampling
        @group(0) @binding(0) var<storage, read> inputs: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> outputs: array<vec4<f32>>;
        @compute @workgroup_size(64)
        fn evaluate(@builtin(global_invocation_id) id: vec3<u32>) {{
            if id.x < arrayLength(&inputs) {{
                let p = inputs[id.x];
                outputs[id.x] = {expression};
            }}
        }}"
    );
    let kernel = gpu().kernel(&compose_source(&source, "evaluate.wgsl", &[]).expect("composes"), "evaluate");
    let resources = Resources::new(gpu()).floats("inputs", inputs.as_flattened()).zeroed("outputs", inputs.len() * 4);
    let groups = inputs.len().div_ceil(64) as u32;
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [groups, 1, 1]).expect("runs");
    resources.read_floats("outputs").expect("reads back").as_chunks().0.to_vec()
}

fn sequence(first: u32, count: u32, dimension: u32) -> Vec<Vec2> {
    let inputs: Vec<_> = (first..first + count).map(|i| [i as f32, dimension as f32, 0.0, 0.0]).collect();
    let square = "vec4<f32>(sampling::sample_square(u32(p.x), u32(p.y)), 0.0, 0.0)";
    evaluate(square, &inputs).iter().map(|out| Vec2::new(out[0], out[1])).collect()
}

/// Independent points of the unit square, as inputs.
fn independent(count: usize) -> Vec<[f32; 4]> {
    let mut random = Random::new(5);
    (0..count).map(|_| [0.0, 0.0, random.unit(), random.unit()]).collect()
}

#[test]
fn every_aligned_run_is_stratified_in_every_elementary_interval() {
    for dimension in [0, 1, 2, 9, 31] {
        for bits in [1, 4, 6, 10] {
            let count = 1 << bits;
            for first in [0, count, 37 * count] {
                let points = sequence(first, count, dimension);
                for across in 0..=bits {
                    let (columns, rows) = (1u32 << across, 1u32 << (bits - across));
                    let mut taken = vec![false; count as usize];
                    for point in &points {
                        let column = (point.x * columns as f32) as u32;
                        let row = (point.y * rows as f32) as u32;
                        let cell = &mut taken[(row * columns + column) as usize];
                        assert!(!*cell, "two of {count} points from {first} in one of {columns}x{rows} cells");
                        *cell = true;
                    }
                }
            }
        }
    }
}

#[test]
fn the_sequence_equals_its_twin() {
    for dimension in [0, 3, 17] {
        for (i, point) in (1000..).zip(sequence(1000, 500, dimension)) {
            assert_eq!(point, sampling::sample_square(i, dimension), "point {i} of dimension {dimension}");
        }
    }
}

/// Of 49 degrees of freedom; shuffles that keep every run stratified leave a little more than chance.
#[test]
fn dimensions_are_independent() {
    let dimensions = [0, 1, 2, 10, 11, 12, 13, 14, 15, 32, 33];
    let points = |dimension| (0..4096).map(|i| sampling::sample_square(i, dimension)).collect::<Vec<_>>();
    let sequences = dimensions.map(points);
    let (mut sum, mut pairs) = (0.0, 0.0);
    for (i, a) in sequences.iter().enumerate() {
        for b in &sequences[..i] {
            let mut counts = [0.0_f64; 64];
            for (a, b) in a.iter().zip(b) {
                counts[(a.x * 8.0) as usize * 8 + (b.x * 8.0) as usize] += 1.0;
            }
            let statistic = counts.iter().map(|count| (count - 64.0).powi(2) / 64.0).sum::<f64>();
            assert!(statistic < 250.0, "two dimensions are correlated: {statistic}");
            (sum, pairs) = (sum + statistic, pairs + 1.0);
        }
    }
    assert!(sum / pairs < 65.0, "dimensions are correlated: {}", sum / pairs);
}

/// Counts of directions in 8 bands of equal probability of a height, by 8 sectors, and the probability that they are even.
fn evenness(directions: &[Vec3], axis: Vec3, band: impl Fn(f32) -> f32) -> f64 {
    let tangent = axis.any_orthonormal_vector();
    let bitangent = axis.cross(tangent);
    let mut counts = vec![0.0; 64];
    for direction in directions {
        assert!((direction.length() - 1.0).abs() < 1e-5, "{direction} is not of unit length");
        let turn = direction.dot(bitangent).atan2(direction.dot(tangent)) / std::f32::consts::TAU + 0.5;
        let sector = ((turn * 8.0) as usize).min(7);
        let band = ((band(direction.dot(axis)) * 8.0) as usize).min(7);
        counts[band * 8 + sector] += 1.0;
    }
    chi_squared_p_value(&counts, &[directions.len() as f64 / 64.0; 64])
}

#[test]
fn directions_have_the_distributions_they_claim() {
    let inputs = independent(20_000);
    let vectors = |expression: &str| -> Vec<Vec3> {
        evaluate(expression, &inputs).iter().map(|out| Vec3::new(out[0], out[1], out[2])).collect()
    };
    let axes =
        [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::new(0.3, -0.8, 0.2).normalize(), Vec3::new(0.0, 1e-4, -1.0).normalize()];
    for axis in axes {
        let wgsl = format!("vec3<f32>({:?}, {:?}, {:?})", axis.x, axis.y, axis.z);
        // The cumulative distribution of a cosine lobe over the height is its square.
        let cosine = vectors(&format!("vec4<f32>(sampling::cosine_direction({wgsl}, p.zw), 0.0)"));
        assert!(cosine.iter().all(|direction| direction.dot(axis) > -1e-5), "below the surface about {axis}");
        let p = evenness(&cosine, axis, |height| height * height);
        assert!(p > 1e-4, "cosine lobe about {axis}: probability {p}");
        assert!(evenness(&cosine, axis, |height| height) < 1e-6, "a uniform lobe would pass too");
        let cone = vectors(&format!("vec4<f32>(sampling::cone_direction({wgsl}, p.zw, 0.7), 0.0)"));
        let p = evenness(&cone, axis, |height| (1.0 - height) / 0.3);
        assert!(p > 1e-4, "cone about {axis}: probability {p}");
        let sphere = vectors(&format!("vec4<f32>(sampling::cone_direction({wgsl}, p.zw, -1.0), 0.0)"));
        let p = evenness(&sphere, axis, |height| (1.0 - height) / 2.0);
        assert!(p > 1e-4, "sphere about {axis}: probability {p}");
    }
}

#[test]
fn points_of_a_triangle_are_uniform() {
    let points = evaluate("vec4<f32>(sampling::triangle_point(p.zw), 0.0, 0.0)", &independent(20_000));
    let mut counts = vec![0.0; 16];
    for [u, v, ..] in points {
        assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-6, "{u} {v} is outside");
        // Four rows by four steps, folded to sixteen triangles of equal area.
        let (column, row) = ((u * 4.0).min(3.0) as usize, (v * 4.0).min(3.0) as usize);
        let upper = (u * 4.0).fract() + (v * 4.0).fract() > 1.0;
        let cell: usize = (0..row).map(|row| 7 - 2 * row).sum::<usize>() + 2 * column + usize::from(upper);
        counts[cell] += 1.0;
    }
    let p = chi_squared_p_value(&counts, &[1250.0; 16]);
    assert!(p > 1e-4, "probability {p}");
}

#[test]
fn points_of_a_disk_are_uniform() {
    let points = evaluate("vec4<f32>(sampling::disk_point(p.zw), 0.0, 0.0)", &independent(20_000));
    let mut counts = vec![0.0; 64];
    for [x, y, ..] in points {
        let (radius, turn) = (x * x + y * y, y.atan2(x) / std::f32::consts::TAU + 0.5);
        counts[((radius * 8.0) as usize).min(7) * 8 + ((turn * 8.0) as usize).min(7)] += 1.0;
    }
    let p = chi_squared_p_value(&counts, &[312.5; 64]);
    assert!(p > 1e-4, "probability {p}");
}
