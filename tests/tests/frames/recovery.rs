//! A device that is lost: on the next one, pictures are what they were.

use std::path::Path;
use std::time::Duration;

use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::prelude::*;
use bevy::render::error_handler::{RenderErrorHandler, RenderErrorPolicy};
use bevy::render::renderer::RenderDevice;
use bevy_bounce::{
    GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, SsbcSettings, Technique, VplVisibility,
    gpu_memory,
};
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_examples::{Run, adapter};
use bevy_bounce_tests::baked::small_cornell_box;
use bevy_bounce_tests::gpu::webgpu_limits;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(64, 36);
/// Frames from a loss to the first picture of another device: the loss is noticed, a device is made, its resources are.
const FRAMES: usize = 3;
/// Frames that history averages over.
const HISTORY: u32 = 4;
/// Frames of which baked light is the mean while everything rests.
const RESTING: u32 = 64;

/// Everything that keeps something on the GPU.
fn everything() -> GiSettings {
    GiSettings {
        visibility: VplVisibility::Atlas,
        probes: 8,
        ssbc: SsbcSettings::default(),
        radiance_cache: RadianceCacheSettings { glossy: true, ..default() },
        history: HISTORY,
        ..SMALL
    }
}

fn lit(technique: Technique) -> GlobalIllumination {
    GlobalIllumination { technique, quality: Quality::Custom(everything()), ..default() }
}

/// A game that asks for another device when one is lost.
fn carry_on(app: &mut App) {
    app.insert_resource(RenderErrorHandler(|_, _, _| {
        RenderErrorPolicy::Recover(adapter::settings(webgpu_limits()).into())
    }));
}

/// Between two frames; what a driver takes away within one, Bevy does not outlive.
fn destroy(device: &wgpu::Device) {
    device.destroy();
    // Tells those who asked to be told.
    device.poll(wgpu::PollType::wait_indefinitely()).expect("has nothing left to do");
}

/// Loses the device and gets another.
fn lose_device(stage: &mut Stage) {
    let render_device = |stage: &Stage| stage.render_world().get_resource_change_ticks::<RenderDevice>();
    let lost = render_device(stage).map(|ticks| ticks.changed);
    destroy(stage.render_world().resource::<RenderDevice>().wgpu_device());
    (0..FRAMES).for_each(|_| stage.frame(Duration::ZERO));
    assert!(render_device(stage).map(|ticks| ticks.changed) != lost, "no other device after {FRAMES} frames");
}

/// Frames until scene, probes, history and baked light that rests are as they were.
fn settle(stage: &mut Stage) {
    let camera = stage.only::<Camera3d>();
    let technique = stage.world().get::<GlobalIllumination>(camera).map(|light| light.technique);
    let resting = if technique == Some(Technique::SurfaceRadiosity) { RESTING } else { 0 };
    (0..2 * HISTORY + resting).for_each(|_| stage.frame(Duration::ZERO));
}

fn recovers(stage: &mut Stage, name: &str) {
    settle(stage);
    let before = stage.picture();
    assert!(before.nonfinite() == 0 && before.mean_luminance() > 0.0, "{name}: there is no light");
    lose_device(stage);
    settle(stage);
    let after = stage.picture();
    assert!(after == before, "{name}: {:?}", Metrics::new(&after, &before));
}

#[test]
fn virtual_lights_recover() {
    techniques_recover(&[Technique::InstantRadiosity]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn other_techniques_recover() {
    techniques_recover(&[Technique::RadianceCache, Technique::SurfaceRadiosity]);
}

/// One device after the other is lost, each while light comes in another way.
fn techniques_recover(techniques: &[Technique]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let file = SceneFile::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let folder = file.folder();
    let mut stage = Stage::with_assets(run(SIZE, Some(lit(Technique::InstantRadiosity))), Some(folder), |app| {
        carry_on(app);
        let bake = Some(small_cornell_box().clone());
        app.add_plugins(GltfScenePlugin { file, camera, matte: true, flip_textures: false, bake });
    });
    for &technique in techniques {
        stage.light_by(lit(technique));
        recovers(&mut stage, &format!("{technique:?}"));
    }
}

/// Light probes alone, in an app that stays forward.
#[test]
fn probes_recover() {
    let run = Run { forward: true, isolate: GiIsolate::All, ..run(SIZE, Some(lit(default()))) };
    let mut stage = Stage::with_run(run, |app| {
        carry_on(app);
        app.add_plugins(CornellPlugin);
    });
    recovers(&mut stage, "probes");
}

/// Light in volumetric fog.
#[test]
fn fog_recovers() {
    let light = illumination(GiSettings { probes: 8, ..SMALL });
    let run = Run { isolate: GiIsolate::All, ..run(SIZE, Some(light)) };
    let mut stage = Stage::with_run(run, |app| {
        carry_on(app);
        app.add_plugins(CornellPlugin);
    });
    let clear = stage.picture();
    let camera = stage.only::<Camera3d>();
    let world = stage.world();
    world.entity_mut(camera).insert(VolumetricFog::default());
    world.spawn((PointLight { intensity: 0.0, ..default() }, VolumetricLight));
    world.spawn((FogVolume::default(), Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(3.0))));
    settle(&mut stage);
    assert!(stage.picture() != clear, "fog does not show");
    let held = |stage: &mut Stage| gpu_memory(stage.render_world_mut()).get("fog: light").copied();
    let before = held(&mut stage);
    assert!(before.is_some_and(|bytes| bytes > 0), "fog is not lit");
    recovers(&mut stage, "fog");
    assert_eq!(held(&mut stage), before, "fog is no longer lit");
}

/// A game that asks for nothing ends with an error, as Bevy has it.
#[test]
#[should_panic(expected = "the renderer stopped")]
fn without_another_device_there_is_one_error() {
    let mut stage = Stage::with_run(run(SIZE, Some(lit(default()))), |app| {
        app.add_plugins(CornellPlugin);
    });
    destroy(stage.render_world().resource::<RenderDevice>().wgpu_device());
    (0..3).for_each(|_| stage.frame(Duration::ZERO));
}
