//! Every shader of the crate: valid, within WebGPU's limits, known to every backend, of one mind with Rust.

use bevy_bounce_shaders::SHADERS;
use bevy_bounce_tests::compose::{Composed, compose};
use bevy_bounce_tests::layout;
use bevy_bounce_tests::translate::{Demand, translate_everywhere};

/// Compute shaders and imported modules. Fragment shaders need the definitions of a view: see `pipelines`.
fn composed() -> impl Iterator<Item = (&'static str, Composed)> {
    let alone = SHADERS.iter().filter(|shader| !shader.source.contains("@fragment"));
    alone.map(|shader| match compose(shader.path, &[]) {
        Ok(composed) => (shader.path, composed),
        Err(error) => panic!("{error}"),
    })
}

#[test]
fn entry_points_are_those_listed() {
    for (path, composed) in composed() {
        let listed = bevy_bounce_shaders::shader(path).map(|shader| shader.entry_points.to_vec());
        let found: Vec<_> = composed.module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(listed, Some(found), "entry points of {path}");
    }
}

#[test]
fn every_compute_shader_translates_for_every_backend() {
    let failures: Vec<_> = composed()
        .filter_map(|(path, composed)| translate_everywhere(&composed).err().map(|error| format!("{path}: {error}")))
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_compute_shader_is_within_webgpu_limits() {
    let mut failures = Vec::new();
    for (path, composed) in composed() {
        for (entry, demand) in Demand::of_entries(&composed) {
            if let Err(error) = demand.check_webgpu() {
                failures.push(format!("{path}, {entry}: {error}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn structs_lie_the_same_in_rust_and_wgsl() {
    let rust = layout::rust_layouts();
    for (path, composed) in composed() {
        for (name, wgsl) in layout::wgsl_layouts(&composed) {
            if let Some(rust) = rust.get(&name) {
                assert_eq!(&wgsl, rust, "{name} in {path}");
            }
        }
    }
}

#[test]
fn constants_are_the_same_in_rust_and_wgsl() {
    let rust = layout::rust_constants();
    assert!(rust.len() > 5, "types.rs has constants: {rust:?}");
    for (path, composed) in composed() {
        for (name, value) in layout::wgsl_constants(&composed) {
            if let Some(rust) = rust.get(&name) {
                assert_eq!(value, *rust, "{name} in {path}");
            }
        }
    }
}
