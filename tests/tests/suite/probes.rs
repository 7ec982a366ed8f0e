//! Bounced light on what is not in the G-buffer, beside what the deferred pass shows of the same surfaces.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::light::{IrradianceVolume, LightProbe};
use bevy::material::OpaqueRendererMethod;
use bevy::pbr::{ExtendedMaterial, MaterialExtension};
use bevy::prelude::*;
use bevy::render::render_resource::{AsBindGroup, Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{
    GiIsolate, GiSettings, GlobalIllumination, ProbeVolume, Quality, Resolution, Technique, VplVisibility, gpu_memory,
};
use bevy_bounce_examples::scenes::{Builder, CornellBox, CornellPlugin, Walls};
use bevy_bounce_tests::cornell;
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};
use bevy_bounce_tests::twins::random::Random;

/// Pixels of the pictures in which points are compared.
pub const SIZE: UVec2 = UVec2::new(192, 108);

/// Copies of the scene's meshes over them, blended.
#[derive(Component)]
struct Glass;

/// What a pixel of the Cornell box shows: a wall, or a side of a block. `None` where neighbours show something else.
fn surface_at(x: usize, y: usize) -> Option<usize> {
    let surface = |x: f32, y: f32| {
        let half = (0.5 * CornellBox::FIELD_OF_VIEW).tan();
        let aspect = SIZE.x as f32 / SIZE.y as f32;
        let ndc = Vec2::new(2.0 * x / SIZE.x as f32 - 1.0, 1.0 - 2.0 * y / SIZE.y as f32);
        let ray = Vec3::new(ndc.x * half * aspect, ndc.y * half, -1.0);
        cornell::hit(CornellBox::EYE, ray).map(|hit| hit.surface)
    };
    let center = surface(x as f32 + 0.5, y as f32 + 0.5)?;
    let around = [(-1.0, -1.0), (2.0, -1.0), (-1.0, 2.0), (2.0, 2.0)];
    around.iter().all(|(dx, dy)| surface(x as f32 + dx, y as f32 + dy) == Some(center)).then_some(center)
}

/// Fifty pixels at random, of surfaces that have no edge there, and what they show.
fn points() -> Vec<(usize, usize, usize)> {
    let mut random = Random::new(23);
    let mut points = Vec::new();
    while points.len() < 50 {
        let (x, y) = ((random.unit() * SIZE.x as f32) as usize, (random.unit() * SIZE.y as f32) as usize);
        if let Some(surface) = surface_at(x, y) {
            points.push((x, y, surface));
        }
    }
    points
}

/// The default quality, at every pixel: between those of half resolution, light of so small a picture is farther than edges are.
fn medium() -> GiSettings {
    GiSettings { resolution: Resolution::Full, ..Quality::Medium.settings() }
}

/// Few lights and probes, for what is the same with many.
const FEW: GiSettings = GiSettings { probes: 8, ..SMALL };
const FEW_SIZE: UVec2 = UVec2::new(64, 36);

/// The Cornell box, deferred or forward.
fn stage(size: UVec2, settings: GiSettings, forward: bool) -> Stage {
    stage_of(size, settings, forward, |app| {
        app.add_plugins(CornellPlugin);
    })
}

/// It warms up with few lights and no probes, for what is asked for takes seconds a frame on a software adapter; no frame has that yet.
pub fn stage_of(size: UVec2, settings: GiSettings, forward: bool, scene: impl FnOnce(&mut App)) -> Stage {
    let mut run = run(size, Some(illumination(SMALL)));
    run.forward = forward;
    run.isolate = GiIsolate::All;
    let mut stage = Stage::with_run(run, scene);
    stage.light_by(illumination(settings));
    stage
}

pub fn show(stage: &mut Stage, isolate: GiIsolate) {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(isolate);
}

fn settled(stage: &mut Stage, settings: GiSettings) -> Picture {
    stage.light_by(illumination(settings));
    stage.settle();
    stage.picture()
}

pub fn minus(a: &Picture, b: &Picture) -> Picture {
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    Picture { pixels, ..a.clone() }
}

/// Light that the probes bring.
fn by_probes(stage: &mut Stage, settings: GiSettings) -> Picture {
    show(stage, GiIsolate::All);
    let with = settled(stage, settings);
    let without = settled(stage, GiSettings { probes: 0, ..settings });
    minus(&with, &without)
}

/// How far the luminance of each point is from what is expected there, as a share of it.
fn errors(name: &str, found: &Picture, expected: &Picture) -> Vec<f64> {
    let mut errors: Vec<_> = points()
        .iter()
        .map(|&(x, y, surface)| {
            let [a, b] = [found, expected].map(|picture| luminance(picture.at(x, y)));
            (a / b - 1.0, x, y, surface, a, b)
        })
        .collect();
    errors.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let mean = errors.iter().map(|e| e.0).sum::<f64>() / errors.len() as f64;
    let rms = (errors.iter().map(|e| e.0 * e.0).sum::<f64>() / errors.len() as f64).sqrt();
    println!("{name}: mean {mean:+.3}, root mean square {rms:.3}; worst:");
    for (error, x, y, surface, a, b) in errors.iter().take(6) {
        println!("  {error:+.3} at {x}, {y} of surface {surface}: {a:.2} for {b:.2}");
    }
    errors.into_iter().map(|error| error.0).collect()
}

fn set_method(stage: &mut Stage, method: OpaqueRendererMethod) {
    let mut materials = stage.world().resource_mut::<Assets<StandardMaterial>>();
    let all: Vec<_> = materials.ids().collect();
    for id in all {
        if let Some(mut material) = materials.get_mut(id) {
            material.opaque_render_method = method;
        }
    }
}

/// Puts blended copies over all meshes.
fn cover(stage: &mut Stage) {
    let world = stage.world();
    let mut meshes = world.query_filtered::<(&Mesh3d, &MeshMaterial3d<StandardMaterial>, &Transform), Without<Glass>>();
    let found: Vec<_> = meshes.iter(world).map(|(mesh, paint, at)| (mesh.clone(), paint.clone(), *at)).collect();
    for (mesh, paint, at) in found {
        let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
        let Some(mut material) = materials.get(&paint.0).cloned() else { continue };
        material.alpha_mode = AlphaMode::Blend;
        material.base_color.set_alpha(0.999);
        material.depth_bias = 100.0;
        let paint = materials.add(material);
        world.spawn((mesh, MeshMaterial3d(paint), at, Glass));
    }
}

/// All points are within 15 % of the deferred pass's.
fn assert_alike(name: &str, found: &Picture, expected: &Picture) {
    let errors = errors(name, found, expected);
    let within = errors.iter().filter(|error| error.abs() < 0.15).count();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!(within == errors.len() && mean.abs() < 0.05, "{name}: {within} within 15 %, mean {mean}");
}

fn assert_points_are_alike(settings: GiSettings) {
    let mut stage = stage(SIZE, settings, false);
    show(&mut stage, GiIsolate::Indirect);
    let deferred = settled(&mut stage, settings);
    set_method(&mut stage, OpaqueRendererMethod::Forward);
    assert_alike("forward", &by_probes(&mut stage, settings), &deferred);
    set_method(&mut stage, OpaqueRendererMethod::Auto);
    cover(&mut stage);
    assert_alike("blended", &by_probes(&mut stage, settings), &deferred);
}

#[test]
fn what_is_not_in_the_g_buffer_is_lit_like_what_is() {
    assert_points_are_alike(Quality::High.settings());
}

/// The same with the lights of the default quality.
#[test]
fn points_are_lit_alike_by_default() {
    assert_points_are_alike(medium());
}

/// Whole pictures of an app that stays forward: MSAA stays, and the light is that of the deferred app. With the lights of the default
/// quality, where single points may be off.
#[test]
fn a_forward_app_is_lit_by_probes_alone() {
    let mut deferred = stage(SIZE, medium(), false);
    show(&mut deferred, GiIsolate::Indirect);
    let expected = settled(&mut deferred, medium());
    drop(deferred);
    let mut stage = stage(SIZE, medium(), true);
    let camera = stage.only::<Camera3d>();
    assert_eq!(stage.world().get::<Msaa>(camera), Some(&Msaa::Sample4));
    let with = settled(&mut stage, medium());
    stage.light_by(GlobalIllumination { technique: Technique::None, ..default() });
    stage.frame(Duration::ZERO);
    let without = stage.settled_picture();
    let errors = errors("forward app", &minus(&with, &without), &expected);
    let mean = |of: fn(f64) -> f64| errors.iter().map(|&error| of(error)).sum::<f64>() / errors.len() as f64;
    let (mean, rms) = (mean(|error| error), mean(|error| error * error).sqrt());
    assert!(mean.abs() < 0.05 && rms < 0.06, "mean {mean}, root mean square {rms}");
}

#[derive(Asset, AsBindGroup, TypePath, Clone, Default)]
struct Plain {}

impl MaterialExtension for Plain {}

type Custom = ExtendedMaterial<StandardMaterial, Plain>;

/// A material that extends Bevy's is lit as that is.
#[test]
fn custom_materials_are_lit_too() {
    let mut stage = stage_of(FEW_SIZE, FEW, true, |app| {
        app.add_plugins((MaterialPlugin::<Custom>::default(), CornellPlugin));
    });
    let expected = settled(&mut stage, FEW);
    let world = stage.world();
    let mut meshes = world.query::<(Entity, &Mesh3d, &MeshMaterial3d<StandardMaterial>, &Transform)>();
    let found: Vec<_> = meshes.iter(world).map(|(_, mesh, paint, at)| (mesh.clone(), paint.clone(), *at)).collect();
    for (mesh, paint, at) in found {
        let base = world.resource::<Assets<StandardMaterial>>().get(&paint.0).cloned().unwrap_or_default();
        let base = StandardMaterial { depth_bias: 100.0, ..base };
        let paint = world.resource_mut::<Assets<Custom>>().add(Custom { base, extension: Plain {} });
        world.spawn((mesh, MeshMaterial3d(paint), at));
    }
    let custom = settled(&mut stage, FEW);
    let dark = settled(&mut stage, GiSettings { probes: 0, ..FEW });
    let [all, custom, dark] = [&expected, &custom, &dark].map(Picture::mean_luminance);
    println!("standard {all}, custom {custom}, without probes {dark}");
    assert!(all > 1.05 * dark && (custom / all - 1.0).abs() < 0.001, "{custom} for {all}, {dark} without probes");
}

/// The light of a frame is that of the lamps in that frame.
#[test]
fn a_light_that_is_switched_on_shows_in_that_frame() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    let lit = settled(&mut stage, FEW);
    let lamp = stage.only::<SpotLight>();
    let mut switch = |on: bool| {
        let intensity = if on { CornellBox::LAMP_CANDELA * 4.0 * std::f32::consts::PI } else { 0.0 };
        if let Some(mut lamp) = stage.world().get_mut::<SpotLight>(lamp) {
            lamp.intensity = intensity;
        }
        stage.picture()
    };
    assert_eq!(switch(false).mean_luminance(), 0.0, "light of the last frame");
    assert!(switch(true) == lit, "the first frame is another than those after it");
}

fn volumes(stage: &mut Stage) -> usize {
    let world = stage.world();
    world.query_filtered::<Entity, (With<IrradianceVolume>, With<LightProbe>)>().iter(world).count()
}

fn held(stage: &mut Stage) -> u64 {
    let memory = gpu_memory(stage.render_world_mut());
    memory.iter().filter(|(name, _)| name.starts_with("probes")).map(|(_, bytes)| bytes).sum()
}

/// The volume is there while a camera asks for it, and takes what is said of it.
#[test]
fn the_volume_goes_with_the_last_camera_that_asks_for_it() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    settled(&mut stage, FEW);
    let camera = stage.only::<Camera3d>();
    for (name, illumination) in [
        ("no component", None),
        ("no technique", Some(GlobalIllumination { technique: Technique::None, ..illumination(FEW) })),
        ("no virtual lights", Some(GlobalIllumination { technique: Technique::SurfaceRadiosity, ..illumination(FEW) })),
        ("no probes", Some(illumination(SMALL))),
    ] {
        assert_eq!(volumes(&mut stage), 1);
        assert!(held(&mut stage) > 0);
        match illumination {
            Some(illumination) => stage.light_by(illumination),
            None => drop(stage.world().entity_mut(camera).remove::<GlobalIllumination>()),
        }
        stage.frame(Duration::ZERO);
        assert_eq!((volumes(&mut stage), held(&mut stage)), (0, 0), "{name}");
        settled(&mut stage, FEW);
    }
    let cached = GlobalIllumination { technique: Technique::RadianceCache, ..illumination(FEW) };
    stage.light_by(cached);
    stage.frame(Duration::ZERO);
    assert_eq!(volumes(&mut stage), 1, "radiance caches have virtual lights");
}

#[test]
fn memory_is_bounded() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    for probes in [4, 16, 1000] {
        settled(&mut stage, GiSettings { probes, vpls: 16, visibility: VplVisibility::None, ..FEW });
        let entity = stage.only::<ProbeVolume>();
        let dims = stage.world().get::<ProbeVolume>(entity).map(|volume| volume.dims).unwrap_or_default();
        let edge = probes.min(64);
        assert!(dims.max_element() <= edge && dims.max_element() + 3 > edge.min(16), "{dims} of {probes}");
        // A texel of 8 bytes, a place and a light of 16 for each face.
        assert_eq!(held(&mut stage), u64::from(dims.element_product()) * 6 * (8 + 16 + 16));
        assert_eq!(volumes(&mut stage), 1);
    }
}

/// Deferred surfaces of cameras with bounced light have it by pixels, and nothing from probes; other cameras see none of it.
#[test]
fn no_light_is_counted_twice() {
    let mut stage = stage(FEW_SIZE, SMALL, false);
    let without = settled(&mut stage, SMALL);
    let place = Transform::from_translation(CornellBox::EYE);
    let plain = Eye::open(&mut stage, FEW_SIZE, Exposure { ev100: 8.0 }, place);
    for _ in 0..4 {
        stage.frame(Duration::ZERO);
    }
    let plain_without = plain.picture(&stage);
    stage.frame(Duration::ZERO);
    let with = {
        stage.world().query::<&mut GlobalIllumination>();
        let world = stage.world();
        for mut gi in world.query::<&mut GlobalIllumination>().iter_mut(world) {
            *gi = illumination(FEW);
        }
        for _ in 0..3 {
            stage.frame(Duration::ZERO);
        }
        assert_eq!(volumes(&mut stage), 1);
        stage.picture()
    };
    assert!(with == without, "deferred surfaces are lit by probes, too");
    assert!(plain.picture(&stage) == plain_without, "a camera without bounced light is lit by probes");
}

/// The ambient light that each app of Bevy's has stands for bounced light, and is left out everywhere.
#[test]
fn default_ambient_light_is_left_out() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    let expected = settled(&mut stage, FEW);
    stage.world().insert_resource(GlobalAmbientLight::default());
    assert!(stage.settled_picture() == expected, "ambient light beside bounced light");
}

#[test]
fn the_number_of_probes_changes_the_picture() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    let expected = settled(&mut stage, FEW);
    let finer = settled(&mut stage, GiSettings { probes: 12, ..FEW });
    assert!(finer != expected, "the number of probes has no effect");
    assert!(settled(&mut stage, FEW) == expected, "a setting left something behind");
}

/// Irradiance volumes of the game win where they are.
#[test]
fn volumes_of_the_game_win() {
    let mut stage = stage(FEW_SIZE, FEW, true);
    let dark = settled(&mut stage, SMALL);
    let mut images = stage.world().resource_mut::<Assets<Image>>();
    let texel = [half::f16::from_f32(1.0); 4].map(half::f16::to_le_bytes).concat();
    let size = Extent3d { width: 2, height: 4, depth_or_array_layers: 6 };
    let usages = RenderAssetUsages::default();
    let voxels = images.add(Image::new_fill(size, TextureDimension::D3, &texel, TextureFormat::Rgba16Float, usages));
    let volume = IrradianceVolume { voxels, intensity: 500.0, ..default() };
    stage.world().spawn((LightProbe::default(), volume, Transform::from_scale(Vec3::splat(24.0))));
    let theirs = minus(&settled(&mut stage, SMALL), &dark).mean_luminance();
    let both = minus(&settled(&mut stage, FEW), &dark).mean_luminance();
    println!("theirs {theirs}, both {both}");
    assert!(theirs > 0.0 && (both / theirs - 1.0).abs() < 0.01, "{both} beside a volume of {theirs}");
}

/// Between walls that emit evenly, every place is lit alike, by probes as by pixels.
#[test]
fn a_furnace_is_even() {
    let (emitted, albedo) = (10.0, 0.5);
    let furnace = move |app: &mut App| {
        app.add_systems(Startup, move |mut build: Builder| {
            let paint = build.materials.add(StandardMaterial {
                base_color: Color::linear_rgb(albedo, albedo, albedo),
                perceptual_roughness: 1.0,
                reflectance: 0.0,
                emissive: LinearRgba::rgb(emitted, emitted, emitted),
                emissive_exposure_weight: 1.0,
                ..default()
            });
            let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| paint.clone());
            build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &Walls { floor, ceiling, back, front, left, right });
            let place = Transform::from_xyz(0.3, 0.2, 1.2).looking_at(Vec3::new(-0.2, -0.1, -1.5), Vec3::Y);
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 4.0 }, place));
        });
    };
    // Nothing hides anything within a box.
    let visibility = VplVisibility::None;
    let settings = GiSettings { grid: 64, vpls: 1024, bounces: 12, probes: 12, visibility, ..SMALL };
    let mut forward = stage_of(FEW_SIZE, settings, true, furnace);
    let lit = settled(&mut forward, settings);
    let light = minus(&lit, &settled(&mut forward, SMALL));
    let mean = light.mean_luminance();
    let spread = light.pixels.iter().map(|pixel| (luminance(*pixel) / mean - 1.0).powi(2)).sum::<f64>();
    let spread = (spread / light.pixels.len() as f64).sqrt();
    let expected = f64::from(emitted * albedo / (1.0 - albedo));
    println!("{:.4} of the closed form; spread {spread:.4}", mean / expected);
    assert!((mean / expected - 1.0).abs() < 0.05, "{mean} by probes instead of {expected}");
    assert!(spread < 0.1, "{spread} of the light is uneven");
}
