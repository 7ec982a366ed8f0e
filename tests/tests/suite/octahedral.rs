//! Unit vectors in one word: round trip through the shipped module.

use bevy::math::Vec3;
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};

const ROUND_TRIP: &str = "
#import bevy_bounce::shared::octahedral::{encode_unit, decode_unit}

@group(0) @binding(0) var<storage, read> vectors: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> words: array<u32>;
@group(0) @binding(2) var<storage, read_write> decoded: array<vec4<f32>>;

@compute @workgroup_size(64)
fn round_trip(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < arrayLength(&vectors) {
        let word = encode_unit(vectors[id.x].xyz);
        words[id.x] = word;
        decoded[id.x] = vec4<f32>(decode_unit(word), 0.0);
    }
}
";

/// Axes, diagonals and a spiral over the sphere.
fn directions() -> Vec<Vec3> {
    let mut directions = Vec::new();
    for x in [-1.0, 0.0, 1.0] {
        for y in [-1.0, 0.0, 1.0] {
            for z in [-1.0, 0.0, 1.0] {
                directions.extend(Vec3::new(x, y, z).try_normalize());
            }
        }
    }
    let count = 4000;
    directions.extend((0..count).map(|i| {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let (sin, cos) = (i as f32 * 2.399_963).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        Vec3::new(radius * cos, radius * sin, z)
    }));
    directions
}

#[test]
fn unit_vectors_survive_their_word() {
    let gpu = gpu();
    let composed = compose_source(ROUND_TRIP, "round_trip.wgsl", &[]).expect("composes");
    let kernel = gpu.kernel(&composed, "round_trip").expect("the device takes it");
    let directions = directions();
    let vectors: Vec<f32> = directions.iter().flat_map(|v| [v.x, v.y, v.z, 0.0]).collect();
    let resources = Resources::new(gpu)
        .floats("vectors", &vectors)
        .zeroed("words", directions.len())
        .zeroed("decoded", directions.len() * 4);
    let groups = directions.len().div_ceil(64) as u32;
    gpu.dispatch(&kernel, &resources, [groups, 1, 1]).expect("runs");
    let words = resources.read_words("words").expect("reads back");
    let decoded = resources.read_floats("decoded").expect("reads back");
    for (i, direction) in directions.iter().enumerate() {
        let result = Vec3::from_slice(&decoded[4 * i..]);
        let angle = result.dot(*direction).clamp(-1.0, 1.0).acos().min(result.distance(*direction));
        assert!(angle.to_degrees() < 0.0045, "{direction} came back as {result}");
        assert!((result.length() - 1.0).abs() < 1e-5, "{result} is not of unit length");
        let twin = bevy_bounce_tests::twins::encode_unit(*direction);
        assert!(close(words[i], twin), "{direction}: GPU {:08x}, CPU {twin:08x}", words[i]);
    }
}

/// Equal but for one step of rounding in either half.
fn close(a: u32, b: u32) -> bool {
    let halves = |word: u32| [word as i16 as i32, (word >> 16) as i16 as i32];
    halves(a).iter().zip(halves(b)).all(|(a, b)| (a - b).abs() <= 1)
}
