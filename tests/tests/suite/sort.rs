//! What is sorted on the GPU, and by what.

use bevy_bounce_shaders::types::{Digit, HILBERT_BITS, SORT_BLOCK};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::run;
use bevy_bounce_tests::twins::random::Random;

/// Sorts by the lowest bits of the first word, as the shipped code does.
pub fn radix_sort(pairs: &[[u32; 2]], bits: u32) -> Vec<[u32; 2]> {
    let mut pairs = pairs.to_vec();
    let blocks = (pairs.len() as u32).div_ceil(SORT_BLOCK).max(1);
    for shift in (0..bits).step_by(8) {
        let resources = Resources::new(gpu())
            .uniform("digit", &Digit { shift })
            .words("pair_count", &[pairs.len() as u32])
            .words("unsorted", pairs.as_flattened())
            .zeroed("sorted", pairs.len().max(1) * 2)
            .zeroed("counts", blocks as usize * 256);
        run(gpu(), "sort/radix.wgsl", "count_digits", &resources, [blocks, 1, 1]);
        run(gpu(), "sort/radix.wgsl", "scan_digits", &resources, [1, 1, 1]);
        run(gpu(), "sort/radix.wgsl", "scatter", &resources, [blocks, 1, 1]);
        let words = resources.read_words("sorted").expect("reads back");
        let count = pairs.len();
        pairs = words.as_chunks().0[..count].to_vec();
    }
    pairs
}

#[test]
fn sorted_as_a_stable_sort_does() {
    let mut random = Random::new(7);
    let mut word = || random.bits();
    let mut inputs: Vec<Vec<u32>> = vec![vec![], vec![5], vec![0; 3000], (0..2500).rev().collect()];
    for size in [2, 255, 256, 257, 1023, 1024, 1025, 5000] {
        inputs.push((0..size).map(|_| word()).collect());
        inputs.push((0..size).map(|_| word() % 3 * 0x0001_0000).collect());
    }
    for keys in inputs {
        let pairs: Vec<_> = (0..).zip(&keys).map(|(value, key)| [*key, value]).collect();
        for bits in [24, 32] {
            let mut expected = pairs.clone();
            expected.sort_by_key(|[key, _]| key & (u32::MAX >> (32 - bits)));
            assert_eq!(radix_sort(&pairs, bits), expected, "{} keys, {bits} bits", keys.len());
        }
    }
}

#[test]
fn the_hilbert_curve_visits_every_cell_from_a_neighbour() {
    const INDEX: &str = "
        #import bevy_bounce::shared::hilbert::{hilbert_index, HILBERT_BITS}
        @group(0) @binding(0) var<storage, read_write> indices: array<u32>;
        @compute @workgroup_size(64)
        fn index(@builtin(global_invocation_id) id: vec3<u32>) {
            let edge = 1u << HILBERT_BITS;
            let cell = vec3<u32>(id.x % edge, (id.x / edge) % edge, id.x / (edge * edge));
            indices[id.x] = hilbert_index(cell);
        }";
    let cells = 1_u32 << (3 * HILBERT_BITS);
    let resources = Resources::new(gpu()).zeroed("indices", cells as usize);
    let kernel = gpu().kernel(&compose_source(INDEX, "index.wgsl", &[]).expect("composes"), "index");
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [cells / 64, 1, 1]).expect("runs");
    let mut curve = vec![u32::MAX; cells as usize];
    for (cell, index) in (0..).zip(resources.read_words("indices").expect("reads back")) {
        curve[index as usize] = cell;
    }
    let coordinates = |cell: u32| [0, 1, 2].map(|axis| cell >> (axis * HILBERT_BITS) & ((1 << HILBERT_BITS) - 1));
    for step in curve.windows(2) {
        let [a, b] = [coordinates(step[0]), coordinates(step[1])];
        let distance: u32 = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).sum();
        assert_eq!(distance, 1, "from {a:?} to {b:?}");
    }
}
