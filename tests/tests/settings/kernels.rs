//! Kernels of whole apps: those that are used, and all of them on a device with WebGPU's limits.

use std::collections::BTreeSet;
use std::time::Duration;

use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::material::descriptor::PipelineDescriptor;
use bevy::prelude::*;
use bevy::render::render_resource::{CachedPipelineState, PipelineCache, TextureDimension, TextureFormat};
use bevy_bounce::{
    GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, SsbcSettings, Technique, VplVisibility,
};
use bevy_bounce_examples::options::Sky;
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_shaders::SHADERS;
use bevy_bounce_tests::baked::small_cornell_box;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(48, 27);

/// Those that an app has compiled: `PATH:ENTRY`.
fn compiled(stage: &Stage) -> BTreeSet<String> {
    let pipelines = stage.render_world().resource::<PipelineCache>().pipelines();
    let ours = pipelines.filter_map(|pipeline| match (&pipeline.descriptor, &pipeline.state) {
        (PipelineDescriptor::ComputePipelineDescriptor(descriptor), CachedPipelineState::Ok(_)) => {
            descriptor.label.as_deref()?.strip_prefix("bounce/").map(str::to_owned)
        }
        _ => None,
    });
    ours.collect()
}

#[test]
fn an_app_compiles_what_it_uses() {
    let stage = Stage::new(SIZE, SMALL, |app| {
        app.add_plugins(CornellPlugin);
    });
    let compiled = compiled(&stage);
    assert!(compiled.contains("vpl/trace.wgsl:trace_paths"), "{compiled:?}");
    for folder in ["cssm", "debug", "fog", "history", "probes", "radiance_cache", "shadow_atlas", "ssbc"] {
        let unused: Vec<_> = compiled.iter().filter(|kernel| kernel.starts_with(folder)).collect();
        assert!(unused.is_empty(), "{unused:?}");
    }
}

/// What is beside the walls of the box: a picture on a panel, and fog.
fn furnish(stage: &mut Stage) {
    let camera = stage.only::<Camera3d>();
    let world = stage.world();
    let (size, format) = (default(), TextureFormat::Rgba8UnormSrgb);
    let image = Image::new_fill(size, TextureDimension::D2, &[255, 0, 0, 255], format, default());
    let image = world.resource_mut::<Assets<Image>>().add(image);
    let paint = StandardMaterial { base_color_texture: Some(image), ..default() };
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(paint);
    let panel = world.resource_mut::<Assets<Mesh>>().add(Rectangle::default());
    world.spawn((Mesh3d(panel), MeshMaterial3d(paint), Transform::from_xyz(0.0, 1.0, 0.0)));
    world.spawn((PointLight { intensity: 0.0, ..default() }, VolumetricLight));
    world.spawn((FogVolume::default(), Transform::from_xyz(0.0, 2.0, 0.0)));
    world.entity_mut(camera).insert(VolumetricFog::default());
}

/// Each has the bindings that its layout says, and no layout asks for more than WebGPU guarantees.
#[test]
fn every_kernel_is_made_with_webgpu_limits() {
    use GiIsolate::*;
    let everything = GiSettings {
        visibility: VplVisibility::Atlas,
        probes: 8,
        ssbc: SsbcSettings { iterations: 1, ..SsbcSettings::OFF },
        radiance_cache: RadianceCacheSettings { glossy: true, ..default() },
        history: 4,
        ..SMALL
    };
    let mut run = run(SIZE, Some(illumination(SMALL)));
    run.webgpu_limits = true;
    run.sky = Some(Sky([0.4, 0.5, 0.8]));
    let mut stage = Stage::of_asset("cornell_box.glb", run, true, Some(small_cornell_box().clone()));
    furnish(&mut stage);
    let camera = stage.only::<Camera3d>();
    let seen_by = |visibility| GiSettings { visibility, ..SMALL };
    for (technique, settings, isolates) in [
        (Technique::InstantRadiosity, everything, &[All, ShadowAtlas, VoxelLevels, Clusters, Caches][..]),
        (Technique::InstantRadiosity, seen_by(VplVisibility::Ism), &[All]),
        (Technique::InstantRadiosity, seen_by(VplVisibility::Baked), &[All]),
        (Technique::InstantRadiosity, seen_by(VplVisibility::None), &[VoxelAlbedo]),
        (Technique::RadianceCache, SMALL, &[All]),
        (Technique::SurfaceRadiosity, SMALL, &[All, CutSize, TreeLevels, BakedAtlas]),
    ] {
        stage.light_by(GlobalIllumination { technique, quality: Quality::Custom(settings), ..default() });
        for isolate in isolates {
            stage.world().entity_mut(camera).insert(*isolate);
            // One in which kernels are asked for, one in which those are that wait for what these make.
            (0..3).for_each(|_| stage.frame(Duration::ZERO));
        }
    }
    stage.settle();
    let all: BTreeSet<String> = SHADERS
        .iter()
        .flat_map(|shader| shader.entry_points.iter().map(|entry| format!("{}:{entry}", shader.path)))
        .collect();
    let compiled = compiled(&stage);
    assert_eq!(all.difference(&compiled).collect::<Vec<_>>(), Vec::<&String>::new(), "kernels that no app has");
}
