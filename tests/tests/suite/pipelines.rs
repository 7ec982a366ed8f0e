//! The fragment shaders with the definitions that views really give them, taken from the pipelines of running apps.

use std::collections::{BTreeMap, BTreeSet};

use bevy::material::descriptor::PipelineDescriptor;
use bevy::pbr::{Lightmap, ScreenSpaceReflections};
use bevy::prelude::*;
use bevy::render::render_resource::PipelineCache;
use bevy::shader::{Shader, ShaderDefVal};
use bevy_bounce::{GiIsolate, GiSettings, RadianceCacheSettings};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};
use bevy_bounce_tests::translate::{Demand, translations};

/// Fragment shaders of the app's pipelines whose path starts so: path, text, definitions.
fn fragment_shaders(stage: &mut Stage, prefix: &str) -> Vec<(String, String, Vec<ShaderDefVal>)> {
    let cache = stage.render_world().resource::<PipelineCache>();
    let fragments: Vec<_> = cache
        .pipelines()
        .filter_map(|pipeline| match &pipeline.descriptor {
            PipelineDescriptor::RenderPipelineDescriptor(descriptor) => descriptor.fragment.clone(),
            PipelineDescriptor::ComputePipelineDescriptor(_) => None,
        })
        .collect();
    let shaders = stage.world().resource::<Assets<Shader>>();
    let ours = fragments.iter().filter_map(|fragment| {
        let shader = shaders.get(&fragment.shader).filter(|shader| shader.path.starts_with(prefix))?;
        let mut defs = fragment.shader_defs.clone();
        defs.push(ShaderDefVal::UInt("AVAILABLE_STORAGE_BUFFER_BINDINGS".into(), 8));
        Some((shader.path.clone(), shader.source.as_str().to_owned(), defs))
    });
    ours.collect()
}

/// Languages that each shader has no translation to.
fn failures(shaders: &[(String, String, Vec<ShaderDefVal>)]) -> BTreeMap<&'static str, BTreeSet<String>> {
    let mut failures = BTreeMap::<_, BTreeSet<String>>::new();
    for (path, source, defs) in shaders {
        let composed = compose_source(source, path, defs).unwrap_or_else(|error| panic!("{error}"));
        for (entry, demand) in Demand::of_entries(&composed) {
            demand.check_webgpu().unwrap_or_else(|error| panic!("{path}, {entry}: {error}"));
        }
        for translation in translations(&composed) {
            if let Err(error) = translation.result {
                failures.entry(translation.language).or_default().insert(error);
            }
        }
    }
    failures
}

/// What asks for the passes that a plain camera does without.
fn reflect_a_sky(mut commands: Commands, mut images: ResMut<Assets<Image>>, camera: Single<Entity, With<Camera3d>>) {
    let sky = EnvironmentMapLight { intensity: 1.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) };
    commands.entity(*camera).insert((ScreenSpaceReflections::default(), sky));
}

/// A mesh with a lightmap, which is marked. Not under an environment map: Bevy's own shader does not compile with both where a
/// device binds no arrays.
fn lay_a_lightmap(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let mesh = Plane3d::default().mesh().build().with_inserted_attribute(Mesh::ATTRIBUTE_UV_1, vec![[0.5, 0.5]; 4]);
    let lightmap = Lightmap { image: images.add(Image::default()), ..default() };
    commands.spawn((Mesh3d(meshes.add(mesh)), MeshMaterial3d(materials.add(Color::WHITE)), lightmap));
}

/// Bevy's deferred lighting has no GLSL where its view bindings load from a depth texture: ours calls it, and may lack no
/// more than it does.
#[test]
fn every_fragment_shader_translates_wherever_bevys_does() {
    let glossy = GiSettings { radiance_cache: RadianceCacheSettings { glossy: true, ..default() }, ..SMALL };
    let mut run = run(UVec2::new(32, 32), Some(illumination(glossy)));
    run.webgpu_limits = true;
    run.isolate = GiIsolate::All;
    let scene = |app: &mut App| {
        app.add_plugins(CornellPlugin);
        app.add_systems(PostStartup, reflect_a_sky);
    };
    let under_ambient_light = |app: &mut App| {
        app.add_plugins(CornellPlugin).insert_resource(GlobalAmbientLight { brightness: 1.0, ..default() });
        app.add_systems(PostStartup, lay_a_lightmap);
    };
    let mut ours = fragment_shaders(&mut Stage::with_run(run.clone(), scene), "bevy_bounce/");
    ours.extend(fragment_shaders(&mut Stage::with_run(run.clone(), under_ambient_light), "bevy_bounce/"));
    assert!(ours.iter().any(|(_, _, defs)| defs.contains(&"AMBIENT".into())), "nothing is under ambient light");
    let paths: BTreeSet<_> = ours.iter().map(|(path, ..)| path.as_str()).collect();
    let expected = [
        "compose/compose.wgsl",
        "compose/direct.wgsl",
        "compose/lightmapped.wgsl",
        "compose/reflections.wgsl",
        "ssbc/apply.wgsl",
    ]
    .map(|path| format!("bevy_bounce/{path}"));
    assert_eq!(paths, expected.iter().map(String::as_str).collect());
    run.plain_bevy = true;
    run.illumination = None;
    let mut stage = Stage::with_run(run, scene);
    let mut bevys = fragment_shaders(&mut stage, "embedded://bevy_pbr/deferred/deferred_lighting");
    bevys.extend(fragment_shaders(&mut stage, "embedded://bevy_pbr/ssr/ssr"));
    let (ours, bevys) = (failures(&ours), failures(&bevys));
    for language in ["SPIR-V", "MSL 2.1", "HLSL 5.1"] {
        assert_eq!(ours.get(language), None);
    }
    for (language, errors) in &ours {
        assert_eq!(Some(errors), bevys.get(language), "{language}");
    }
}
