//! The harness itself must catch what is wrong: a picture, a buffer, a shader, a layout.

use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::layout;
use bevy_bounce_tests::metrics::{Bounds, compare};
use bevy_bounce_tests::stats::chi_squared_p_value;
use bevy_bounce_tests::translate::{Demand, translate_everywhere};

use crate::metrics::pair;

const TIGHT: Bounds = Bounds { energy: Some((0.98, 1.02)), low: Some(0.02), flip: Some(0.07), nrmse: Some(0.1) };

#[test]
fn a_wrong_picture_is_caught() {
    let (test, reference) = pair(48, 32, 0.3, 0);
    compare(&test, &reference, &TIGHT).expect("noise alone is within the bounds");

    let fails = |picture: &_, what: &str| {
        let error = compare(picture, &reference, &TIGHT).expect_err(what);
        assert!(error.contains(what), "expected a complaint about {what}, got: {error}");
    };
    fails(&test.map(|pixel| pixel.map(|c| c * 1.05)), "energy");
    fails(&test.map(|[r, g, b]| [b, g, r]), "low");
    fails(&pair(48, 32, 0.0, 2).0, "flip");
    fails(&pair(48, 32, 0.9, 0).0, "nrmse");
    fails(&pair(40, 32, 0.3, 0).0, "sizes differ");
    let mut broken = test.clone();
    broken.pixels[5][1] = f32::NAN;
    fails(&broken, "not finite");
}

#[test]
fn a_picture_test_panics_on_a_wrong_picture() {
    let (test, reference) = pair(48, 32, 0.3, 0);
    let wrong = test.map(|_| [1.0; 3]);
    let outcome = std::panic::catch_unwind(|| compare(&wrong, &reference, &TIGHT).expect("within the bounds"));
    assert!(outcome.is_err(), "a flat picture passed for a scene");
}

const DOUBLE: &str = "
@group(0) @binding(0) var<uniform> offset: vec4<u32>;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;

@compute @workgroup_size(64)
fn double(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&values) {
        values[id.x] = values[id.x] * 2u + offset.y;
    }
}
";

#[test]
fn a_kernel_runs_and_a_wrong_buffer_is_caught() {
    let gpu = gpu();
    let kernel = gpu.kernel(&compose_source(DOUBLE, "double.wgsl", &[]).expect("composes"), "double");
    let kernel = kernel.expect("the device takes it");
    let input: Vec<u32> = (0..1001).map(|i| i * 7).collect();
    let resources = Resources::new(gpu).words("offset", &[0, 3, 0, 0]).words("values", &input);
    gpu.dispatch(&kernel, &resources, [16, 1, 1]).expect("runs");
    let read = resources.read_words("values").expect("reads back");
    let expected: Vec<u32> = input.iter().map(|value| value * 2 + 3).collect();
    assert_eq!(read, expected);

    // A workgroup too few leaves the last values as they were.
    let resources = Resources::new(gpu).words("offset", &[0, 3, 0, 0]).words("values", &input);
    gpu.dispatch(&kernel, &resources, [15, 1, 1]).expect("runs");
    assert_ne!(resources.read_words("values").expect("reads back"), expected);

    // A binding without a resource is an error that names it.
    let missing = Resources::new(gpu).words("values", &input);
    let error = gpu.dispatch(&kernel, &missing, [1, 1, 1]).expect_err("offset is missing");
    assert!(error.contains("offset"), "{error}");
}

#[test]
fn an_invalid_shader_is_caught() {
    let wrong = DOUBLE.replace("* 2u", "* 2.0");
    assert!(compose_source(&wrong, "wrong.wgsl", &[]).is_err());
    let unknown = format!("#import bevy_bounce::no_such::module::twice\n{DOUBLE}").replace("* 2u", "+ twice()");
    assert!(compose_source(&unknown, "unknown.wgsl", &[]).is_err());
}

#[test]
fn a_shader_beyond_webgpu_is_caught() {
    let mut greedy = String::from("var<workgroup> memory: array<vec4<f32>, 1025>;\n");
    for i in 0..9 {
        greedy += &format!("@group(0) @binding({i}) var<storage, read_write> buffer_{i}_: array<u32>;\n");
    }
    greedy += "@compute @workgroup_size(17, 16) fn greedy() {\n memory[0] = vec4<f32>(1.0);\n";
    (0..9).for_each(|i| greedy += &format!("buffer_{i}_[0] = 1u;\n"));
    greedy += "}";
    let composed = compose_source(&greedy, "greedy.wgsl", &[]).expect("it is valid WGSL");
    let (name, demand) = Demand::of_entries(&composed).remove(0);
    assert_eq!(name, "greedy");
    let error = demand.check_webgpu().expect_err("beyond the limits");
    for complaint in ["9 storage buffers", "272 threads", "16400 bytes"] {
        assert!(error.contains(complaint), "no {complaint} in: {error}");
    }
}

#[test]
fn a_shader_that_one_backend_lacks_is_caught() {
    let source = "
        @group(0) @binding(0) var samples: texture_multisampled_2d<f32>;
        @group(0) @binding(1) var<storage, read_write> count: u32;
        @compute @workgroup_size(1) fn count_samples() { count = textureNumSamples(samples); }";
    let composed = compose_source(source, "samples.wgsl", &[]).expect("composes");
    let error = translate_everywhere(&composed).expect_err("GLSL ES has no textureSamples");
    assert!(error.contains("GLSL ES 3.10") && !error.contains("SPIR-V"), "{error}");
}

#[test]
fn a_wrong_layout_and_a_wrong_constant_are_caught() {
    let source = "
        const NONE: u32 = 7u;
        struct Chunk { first_triangle: u32, instance: u32 }
        @group(0) @binding(0) var<storage, read_write> chunks: array<Chunk>;
        @compute @workgroup_size(1) fn touch() { chunks[0].instance = NONE; }";
    let composed = compose_source(source, "layout.wgsl", &[]).expect("composes");
    let (rust, wgsl) = (layout::rust_layouts(), layout::wgsl_layouts(&composed));
    assert_ne!(rust["Chunk"], wgsl["Chunk"]);
    assert_ne!(layout::rust_constants()["NONE"], layout::wgsl_constants(&composed)["NONE"]);
}

#[test]
fn an_uneven_distribution_is_caught() {
    let expected = [100.0; 16];
    let even: Vec<f64> = (0..16).map(|i| 100.0 + f64::from(i % 3 - 1) * 8.0).collect();
    assert!(chi_squared_p_value(&even, &expected) > 0.1);
    let uneven: Vec<f64> = (0..16).map(|i| 100.0 + if i < 4 { 45.0 } else { -15.0 }).collect();
    assert!(chi_squared_p_value(&uneven, &expected) < 1e-6);
    // 15 degrees of freedom: the 5 % point is 24.996.
    let edge: Vec<f64> = (0..16).map(|i| 100.0 + if i % 2 == 0 { 12.499 } else { -12.499 }).collect();
    assert!((chi_squared_p_value(&edge, &expected) - 0.05).abs() < 0.001);
}
