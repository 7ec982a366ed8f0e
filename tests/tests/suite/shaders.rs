//! Every shader of the crate: valid, within WebGPU's limits, known to every backend, of one mind with Rust.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use bevy::shader::ShaderDefVal;
use bevy_bounce_shaders::SHADERS;
use bevy_bounce_tests::compose::{Composed, compose};
use bevy_bounce_tests::layout;
use bevy_bounce_tests::translate::{Demand, translate_everywhere};
use naga::valid::Capabilities;
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};

/// Compute shaders and imported modules, each with every set of the definitions that it asks for, composed once for all tests. What reads
/// Bevy's view bindings needs the definitions of a view: see `pipelines`.
fn composed() -> &'static [(&'static str, Composed)] {
    static ALL: LazyLock<Vec<(&str, Composed)>> = LazyLock::new(|| compose_all().collect());
    &ALL
}

fn compose_all() -> impl Iterator<Item = (&'static str, Composed)> {
    let alone = SHADERS.iter().filter(|shader| !shader.source.contains("mesh_view_bindings"));
    let alone = alone.filter(|shader| !shader.source.contains("@fragment"));
    alone.flat_map(|shader| {
        variants(&with_imports(shader.source)).into_iter().map(|defs| match compose(shader.path, &defs) {
            Ok(composed) => (shader.path, composed),
            Err(error) => panic!("{error}"),
        })
    })
}

/// The text of a shader and of all modules of ours that it imports.
fn with_imports(source: &str) -> String {
    let mut text = source.to_owned();
    for import in source.lines().filter_map(|line| line.strip_prefix("#import bevy_bounce::")) {
        let mut parts = import.split("::");
        let (Some(folder), Some(file)) = (parts.next(), parts.next()) else { continue };
        let imported = bevy_bounce_shaders::shader(&format!("{folder}/{}.wgsl", file.trim()));
        text.extend(imported.map(|shader| with_imports(shader.source)));
    }
    text
}

/// Every subset of the names that a shader tests for.
fn variants(source: &str) -> Vec<Vec<ShaderDefVal>> {
    let tested = source.lines().filter_map(|line| line.strip_prefix("#ifdef ").or(line.strip_prefix("#ifndef ")));
    let names: BTreeSet<_> = tested.map(str::trim).collect();
    let with = |mask: usize| names.iter().enumerate().filter(move |(i, _)| mask & 1 << i != 0);
    (0..1 << names.len()).map(|mask| with(mask).map(|(_, name)| (*name).into()).collect()).collect()
}

#[test]
fn variants_are_found() {
    let [accumulate, emission]: [ShaderDefVal; 2] = ["ACCUMULATE".into(), "EMISSION".into()];
    let source = bevy_bounce_shaders::shader("avg/voxelize.wgsl").expect("there is such a shader").source;
    let both = vec![accumulate.clone(), emission.clone()];
    assert_eq!(variants(source), [vec![], vec![accumulate], vec![emission], both]);
    let shade = bevy_bounce_shaders::shader("interleaved/shade.wgsl").expect("there is such a shader").source;
    assert_eq!(variants(&with_imports(shade)).len(), 64, "what it imports has variants, too");
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
        .iter()
        .filter_map(|(path, composed)| translate_everywhere(composed).err().map(|error| format!("{path}: {error}")))
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn every_compute_shader_is_within_webgpu_limits() {
    let mut failures = Vec::new();
    for (path, composed) in composed() {
        for (entry, demand) in Demand::of_entries(composed) {
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
    let mut seen = BTreeSet::new();
    for (path, composed) in composed() {
        for (name, wgsl) in layout::wgsl_layouts(composed) {
            if let Some(rust) = rust.get(&name) {
                assert_eq!(&wgsl, rust, "{name} in {path}");
                seen.insert(name);
            }
        }
    }
    let unseen: Vec<_> = rust.keys().filter(|name| !seen.contains(*name)).collect();
    assert!(unseen.is_empty(), "structs of types.rs that no shader has: {unseen:?}");
}

#[test]
fn constants_are_the_same_in_rust_and_wgsl() {
    let rust = layout::rust_constants();
    assert!(rust.len() > 5, "types.rs has constants: {rust:?}");
    for (path, composed) in composed() {
        for (name, value) in layout::wgsl_constants(composed) {
            if let Some(rust) = rust.get(&name) {
                assert_eq!(value, *rust, "{name} in {path}");
            }
        }
    }
}

/// With its feature `glsl`, which no package of the workspace may ask for, naga_oil gives up at such modules; Bevy has them wherever a GPU
/// binds arrays of textures.
#[test]
fn modules_that_bind_arrays_compose() {
    let mut composer = Composer::default().with_capabilities(Capabilities::all());
    let arrays = "
        #define_import_path arrays
        @group(0) @binding(0) var textures: binding_array<texture_2d<f32>, 4>;
        fn texel(i: u32) -> vec4<f32> { return textureLoad(textures[i], vec2<i32>(0), 0); }";
    let module = ComposableModuleDescriptor { source: arrays, file_path: "arrays.wgsl", ..Default::default() };
    composer.add_composable_module(module).expect("composes");
    let source = "
        #import arrays::texel
        @fragment fn fragment() -> @location(0) vec4<f32> { return texel(0u); }";
    let module = NagaModuleDescriptor { source, file_path: "texel.wgsl", ..Default::default() };
    let module = composer.make_naga_module(module).expect("composes");
    assert_eq!(module.entry_points.len(), 1);
}
