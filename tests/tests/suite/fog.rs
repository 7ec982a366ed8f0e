//! Bounced light in volumetric fog, beside closed forms, path tracing and Bevy's own fog.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::camera::{Exposure, ScalingMode};
use bevy::ecs::system::RunSystemOnce;
use bevy::image::ImageSampler;
use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{GiIsolate, GiSettings, GlobalIllumination, Quality, Technique, VplVisibility, gpu_memory};
use bevy_bounce_examples::scenes::{Builder, CornellBox, CornellPlugin, Walls};
use bevy_bounce_tests::cornell::{self, PointInAir};
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};
use bevy_bounce_tests::twins::random::Random;

const SIZE: UVec2 = UVec2::new(64, 36);
const FEW: GiSettings = GiSettings { probes: 8, ..SMALL };
/// The fog of most tests: what it scatters has no preferred direction.
const FOG: f32 = 0.2;

fn fog(density: f32) -> FogVolume {
    FogVolume { density_factor: density, absorption: 0.5, scattering: 1.0, scattering_asymmetry: 0.0, ..default() }
}

fn camera_fog() -> VolumetricFog {
    VolumetricFog { ambient_intensity: 0.0, ..default() }
}

/// Fog in one place and of one size, which Bevy draws only beside a light that is volumetric.
fn spawn_fog(stage: &mut Stage, fog: FogVolume, place: Transform) -> Entity {
    stage.world().spawn((fog, place)).id()
}

fn stage_of(size: UVec2, settings: GiSettings, forward: bool, scene: impl FnOnce(&mut App)) -> Stage {
    let mut run = run(size, Some(illumination(settings)));
    run.forward = forward;
    run.isolate = GiIsolate::All;
    let mut stage = Stage::with_run(run, scene);
    stage.world().spawn((PointLight { intensity: 0.0, ..default() }, VolumetricLight));
    stage
}

fn cornell_stage(size: UVec2, settings: GiSettings) -> Stage {
    stage_of(size, settings, false, |app| {
        app.add_plugins(CornellPlugin);
    })
}

fn show(stage: &mut Stage, fog: Option<VolumetricFog>) {
    let camera = stage.only::<GlobalIllumination>();
    let mut camera = stage.world().entity_mut(camera);
    match fog {
        Some(fog) => drop(camera.insert(fog)),
        None => drop(camera.remove::<VolumetricFog>()),
    }
}

fn settled(stage: &mut Stage, settings: GiSettings) -> Picture {
    let camera = stage.only::<GlobalIllumination>();
    stage.world().entity_mut(camera).insert(illumination(settings));
    stage.settle();
    stage.picture()
}

/// Pixel by pixel: bounced light without fog, and what share of the light behind it fog takes.
struct Taken {
    without: Picture,
    shares: Vec<f64>,
}

/// Drawn without fog and with it, by Bevy alone; without it also with bounced light in what is not in the G-buffer. Which way the fog
/// scatters does not matter.
fn taken(stage: &mut Stage, settings: GiSettings) -> Taken {
    let dark = GiSettings { probes: 0, ..settings };
    show(stage, Some(camera_fog()));
    let world = stage.world();
    let mut volumes = world.query::<&mut FogVolume>();
    let densities: Vec<_> = volumes.iter(world).map(|volume| volume.density_factor).collect();
    for mut volume in volumes.iter_mut(world) {
        volume.density_factor = 0.0;
    }
    let clear = settled(stage, dark);
    let without = settled(stage, settings);
    let world = stage.world();
    for (mut volume, density) in volumes.iter_mut(world).zip(densities) {
        volume.density_factor = density;
    }
    let bevys = settled(stage, dark);
    let share = |(with, without): (&[f32; 3], &[f32; 3])| 1.0 - luminance(*with) / luminance(*without).max(1e-9);
    let shares = bevys.pixels.iter().zip(&clear.pixels).map(share).collect();
    Taken { without, shares }
}

/// What fog scatters of bounced light, pixel by pixel.
fn scattered(stage: &mut Stage, settings: GiSettings, taken: &Taken) -> Picture {
    let lit = settled(stage, settings);
    assert!(lit.pixels.as_flattened().iter().all(|value| value.is_finite() && *value >= 0.0), "no light");
    let light = |((with, without), share): ((&[f32; 3], &[f32; 3]), &f64)| {
        std::array::from_fn(|c| with[c] - without[c] * (1.0 - share) as f32)
    };
    let pixels = lit.pixels.iter().zip(&taken.without.pixels).zip(&taken.shares).map(light).collect();
    Picture { pixels, ..lit }
}

/// What a volume takes of the light that comes to it, as Bevy has it.
fn on_the_way(fog: &FogVolume, place: &Transform) -> f64 {
    f64::from((-fog.density_factor * (fog.absorption + fog.scattering) * 0.5 * place.scale.length()).exp())
}

const EMITTED: f32 = 10.0;
const ALBEDO: f32 = 0.5;

/// A closed room of walls that emit evenly: from everywhere comes `EMITTED / (1 - ALBEDO)`.
fn furnace(app: &mut App) {
    app.add_systems(Startup, |mut build: Builder| {
        let exposure = Exposure { ev100: 4.0 };
        let paint = build.materials.add(StandardMaterial {
            base_color: Color::linear_rgb(ALBEDO, ALBEDO, ALBEDO),
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            emissive: LinearRgba::rgb(EMITTED, EMITTED, EMITTED) * exposure.exposure(),
            ..default()
        });
        let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| paint.clone());
        build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &Walls { floor, ceiling, back, front, left, right });
        let place = Transform::from_xyz(0.3, 0.2, 1.2).looking_at(Vec3::new(-0.2, -0.1, -1.5), Vec3::Y);
        build.commands.spawn((Camera3d::default(), GlobalIllumination::default(), exposure, place));
    });
}

const FURNACE: GiSettings =
    GiSettings { grid: 64, vpls: 1024, bounces: 12, probes: 12, visibility: VplVisibility::None, ..SMALL };

/// A texture of densities, one half of it empty.
fn half_full(stage: &mut Stage) -> Handle<Image> {
    let texels: Vec<_> = (0..8).flat_map(|i| half::f16::from_f32((i % 2) as f32).to_le_bytes()).collect();
    let size = Extent3d { width: 2, height: 2, depth_or_array_layers: 2 };
    let usages = RenderAssetUsages::default();
    let mut image = Image::new(size, TextureDimension::D3, texels, TextureFormat::R16Float, usages);
    image.sampler = ImageSampler::nearest();
    stage.world().resource_mut::<Assets<Image>>().add(image)
}

/// As much comes from fog in the furnace as its walls send, at each pixel but for `tolerance` of it, and in the mean.
fn assert_is_even(
    stage: &mut Stage,
    name: &str,
    volumes: Vec<(FogVolume, Transform)>,
    settings: GiSettings,
    tolerance: f64,
) {
    let way = on_the_way(&volumes[0].0, &volumes[0].1);
    let (absorption, scattering) = (volumes[0].0.absorption, volumes[0].0.scattering);
    let entities: Vec<_> = volumes.into_iter().map(|(fog, place)| spawn_fog(stage, fog, place)).collect();
    let taken = taken(stage, settings);
    let light = scattered(stage, settings, &taken);
    let whole = f64::from(EMITTED / (1.0 - ALBEDO) * scattering / (absorption + scattering)) * way;
    let mut errors: Vec<_> = light
        .pixels
        .iter()
        .zip(&taken.shares)
        .enumerate()
        .filter(|(_, (_, taken))| **taken > 0.1)
        .map(|(i, (light, taken))| (luminance(*light) / (taken * whole) - 1.0, i, *taken))
        .collect();
    errors.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let (count, mean) = (errors.len(), errors.iter().map(|error| error.0).sum::<f64>() / errors.len() as f64);
    println!("{name}: mean {mean:+.4} of {count} pixels; worst:");
    for (error, i, taken) in errors.iter().take(8) {
        println!("  {error:+.3} at {}, {}, which takes {taken:.3}", i % SIZE.x as usize, i / SIZE.x as usize);
    }
    let worst = errors.first().map_or(1.0, |error| error.0.abs());
    assert!(count >= 50 && mean.abs() < 0.03 && worst < tolerance, "{name}: mean {mean}, worst {worst} of {count}");
    for entity in entities {
        stage.world().despawn(entity);
    }
}

/// The share of light that fog takes and does not absorb, it scatters: as much comes from it as its walls send. From within and from
/// outside, through several volumes, with a texture and without, in whatever direction it scatters; at fifty points and in the mean.
/// `names`: of the cases that are tried.
fn furnace_is_even(forward: bool, names: &[&str]) {
    let mut stage = stage_of(SIZE, FURNACE, forward, furnace);
    let within = Transform::from_scale(Vec3::splat(2.9));
    let before = Transform { scale: Vec3::new(1.2, 0.9, 0.7), ..Transform::from_xyz(-0.1, 0.1, -0.6) };
    let turned = before.with_rotation(Quat::from_rotation_y(0.7));
    let texture = half_full(&mut stage);
    let textured = FogVolume { density_texture: Some(texture), ..fog(3.0 * FOG) };
    let forwards = FogVolume { scattering_asymmetry: 0.8, ..fog(3.0 * FOG) };
    // Where one direction counts, few of the lights do.
    let many = GiSettings { vpls: 8192, ..FURNACE };
    let mut tried = 0;
    for (name, volumes, settings, tolerance) in [
        ("within", vec![(fog(FOG), within)], FURNACE, 0.04),
        ("outside, turned, forwards", vec![(forwards, turned)], many, 0.08),
        ("a texture", vec![(textured, before)], FURNACE, 0.06),
        // As much is lost on the way to each.
        (
            "two",
            vec![(fog(FOG), within), (fog(FOG), within.with_translation(Vec3::new(0.05, 0.0, 0.1)))],
            FURNACE,
            0.04,
        ),
    ]
    .into_iter()
    .filter(|(name, ..)| names.contains(name))
    {
        assert_is_even(&mut stage, name, volumes, settings, tolerance);
        tried += 1;
    }
    assert_eq!(tried, names.len());
}

#[test]
fn fog_in_a_furnace_is_as_bright_as_its_walls() {
    furnace_is_even(false, &["within", "outside, turned, forwards", "a texture", "two"]);
}

/// The same with MSAA, of two of these.
#[test]
fn fog_in_a_forward_app_is_lit_too() {
    furnace_is_even(true, &["a texture", "two"]);
}

/// Where rays are parallel, too, before and behind the plane of the eye: by the closed form, as all of them go through as much fog.
#[test]
fn fog_is_even_in_an_orthographic_view() {
    let mut stage = stage_of(SIZE, FURNACE, false, furnace);
    let camera = stage.only::<GlobalIllumination>();
    let lens = OrthographicProjection {
        near: -1.0,
        far: 4.0,
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 1.2 },
        ..OrthographicProjection::default_3d()
    };
    stage.world().entity_mut(camera).insert((Projection::Orthographic(lens), Transform::from_xyz(0.1, 0.1, 0.0)));
    for (name, z) in [("before", -0.8), ("behind", 0.4)] {
        let place = Transform { scale: Vec3::new(2.7, 2.7, 0.7), ..Transform::from_xyz(0.0, 0.0, z) };
        let fog = fog(3.0 * FOG);
        let extinction = fog.absorption + fog.scattering;
        let taken = 1.0 - f64::from(-fog.density_factor * extinction * place.scale.z).exp();
        let whole = f64::from(EMITTED / (1.0 - ALBEDO) * fog.scattering / extinction) * on_the_way(&fog, &place);
        let volume = spawn_fog(&mut stage, fog, place);
        let through = self::taken(&mut stage, FURNACE);
        let found = scattered(&mut stage, FURNACE, &through);
        stage.world().despawn(volume);
        let shares: Vec<f64> = found.pixels.iter().map(|light| luminance(*light) / (whole * taken)).collect();
        let (least, most) = shares.iter().fold((f64::MAX, 0.0f64), |(least, most), x| (least.min(*x), most.max(*x)));
        println!("{name} the eye: {least:.3} to {most:.3} of what a closed form says");
        assert!(least > 0.92 && most < 1.08, "{name} the eye: {least} to {most}");
    }
}

/// Under a sky that is bright above, fog that scatters forwards is brighter where one looks up, and fog that scatters backwards as much
/// brighter where one looks down.
#[test]
fn fog_is_brighter_towards_the_light_where_it_scatters_forwards() {
    let settings = GiSettings { grid: 32, sky: 256, ..FEW };
    let mut stage = stage_of(SIZE, settings, false, |app| {
        app.add_systems(Startup, |mut build: Builder, mut images: ResMut<Assets<Image>>| {
            let paint = build.paint([0.0; 3]);
            build.block(Vec3::new(2.0, 0.0, -2.0), Vec3::splat(0.1), 0.0, &paint);
            let (above, below) = (Color::WHITE, Color::BLACK);
            let sky = EnvironmentMapLight::hemispherical_gradient(&mut images, above, below, below);
            let sky = EnvironmentMapLight { intensity: 200.0, ..sky };
            build.commands.spawn((Camera3d::default(), GlobalIllumination::default(), sky, Exposure { ev100: 8.0 }));
        });
    });
    show(&mut stage, Some(camera_fog()));
    let camera = stage.only::<GlobalIllumination>();
    let mut towards = |asymmetry: f32, direction: Vec3| {
        let eye = Transform::from_xyz(0.0, 2.0, 0.0).looking_to(direction, Vec3::X);
        let place = Transform::from_translation(eye.translation + 2.0 * direction);
        stage.world().entity_mut(camera).insert(eye);
        let volume = spawn_fog(&mut stage, FogVolume { scattering_asymmetry: asymmetry, ..fog(0.5) }, place);
        let picture = settled(&mut stage, settings);
        stage.world().despawn(volume);
        // Without the sky behind the fog, which is not drawn.
        luminance(picture.at(SIZE.x as usize / 2, SIZE.y as usize / 2))
    };
    let [even, forwards, backwards] = [0.0, 0.8, -0.8].map(|g| [Vec3::Y, Vec3::NEG_Y].map(|to| towards(g, to)));
    println!("up and down: even {even:?}, forwards {forwards:?}, backwards {backwards:?} cd/m^2");
    assert!((even[0] / even[1] - 1.0).abs() < 0.05, "even fog: {even:?}");
    assert!(forwards[0] > 3.0 * forwards[1], "forwards: {forwards:?}");
    assert!((backwards[1] / forwards[0] - 1.0).abs() < 0.1, "backwards {backwards:?}, forwards {forwards:?}");
}

/// In the open fog is as bright as an even sky, whatever way it scatters; in a closed room it is dark.
#[test]
fn fog_under_an_even_sky_is_as_bright_as_that() {
    const RADIANCE: f32 = 200.0;
    let settings = GiSettings { grid: 32, sky: 256, ..FEW };
    let mut stage = stage_of(SIZE, settings, false, |app| {
        app.add_systems(Startup, |mut build: Builder, mut images: ResMut<Assets<Image>>| {
            let paint = build.paint([0.0; 3]);
            build.block(Vec3::new(2.0, 0.0, -2.0), Vec3::splat(0.1), 0.0, &paint);
            let sky = EnvironmentMapLight::solid_color(&mut images, Color::WHITE);
            let sky = EnvironmentMapLight { intensity: RADIANCE, ..sky };
            let eye = (Exposure { ev100: 8.0 }, Transform::from_xyz(0.0, 2.0, 2.0));
            build.commands.spawn((Camera3d::default(), GlobalIllumination::default(), sky, eye));
        });
    });
    show(&mut stage, Some(camera_fog()));
    let place = Transform::from_xyz(0.0, 2.0, 0.0);
    for asymmetry in [0.0, -0.5, 0.8, 1.0] {
        let fog = FogVolume { scattering_asymmetry: asymmetry, ..fog(0.5) };
        // A ray through it is one unit long.
        let extinction = fog.density_factor * (fog.absorption + fog.scattering);
        let scattered = fog.scattering / (fog.absorption + fog.scattering) * (1.0 - (-extinction).exp());
        let expected = f64::from(RADIANCE * scattered) * on_the_way(&fog, &place);
        let volume = spawn_fog(&mut stage, fog, place);
        let picture = settled(&mut stage, settings);
        let found = luminance(picture.at(SIZE.x as usize / 2, SIZE.y as usize / 2));
        println!("asymmetry {asymmetry}: {found:.3} cd/m^2, expected {expected:.3}");
        assert!((found / expected - 1.0).abs() < 0.05, "asymmetry {asymmetry}: {found}, expected {expected}");
        stage.world().despawn(volume);
    }
    spawn_fog(&mut stage, fog(0.5), place);
    stage.world().run_system_once(|mut build: Builder| super::sky::closed_room(&mut build)).expect("runs");
    let lit = settled(&mut stage, settings);
    let dark = settled(&mut stage, GiSettings { probes: 0, ..settings });
    let scattered = |(lit, dark): (&[f32; 3], &[f32; 3])| luminance(*lit) - luminance(*dark);
    let brightest = lit.pixels.iter().zip(&dark.pixels).map(scattered).fold(0.0, f64::max);
    println!("in a closed room: {brightest:.4} cd/m^2");
    assert!(brightest < 0.005 * f64::from(RADIANCE), "{brightest} cd/m^2 in a closed room");
}

/// Paths a point.
const PATHS: u32 = 16384;

/// What fog scatters at points in a room is what comes there on traced paths, whatever way it scatters; but for what
/// comes from dim and near surfaces, where few lights lie.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn fog_at_a_point_scatters_the_light_of_that_point() {
    assert_scatters_what_is_there(Quality::High, [50, 48, 46]);
}

/// More lights come closer, forwards before dim surfaces, too.
#[test]
#[ignore = "takes minutes without a GPU"]
fn fog_at_a_point_scatters_the_light_of_that_point_at_ultra_quality() {
    assert_scatters_what_is_there(Quality::Ultra, [50, 50, 49]);
}

fn assert_scatters_what_is_there(quality: Quality, at_least: [usize; 3]) {
    let size = UVec2::new(192, 108);
    let settings = quality.settings();
    let mut stage = cornell_stage(size, settings);
    let eye = Transform::from_translation(CornellBox::EYE);
    let points = cornell::points_in_air(&eye, CornellBox::FIELD_OF_VIEW, size);
    let whole: Vec<_> = points
        .iter()
        .map(|point| {
            let place = Transform::from_translation(point.at).with_scale(Vec3::splat(cornell::PIECE));
            spawn_fog(&mut stage, fog(1.0), place);
            on_the_way(&fog(1.0), &place) * 2.0 / 3.0
        })
        .collect();
    let taken = taken(&mut stage, settings);
    for (asymmetry, at_least) in [0.0, 0.5, 0.8].into_iter().zip(at_least) {
        let world = stage.world();
        for mut volume in world.query::<&mut FogVolume>().iter_mut(world) {
            volume.scattering_asymmetry = asymmetry;
        }
        let light = scattered(&mut stage, settings, &taken);
        let mut random = Random::new(17);
        let mut errors: Vec<_> = points
            .iter()
            .zip(&whole)
            .map(|(&PointInAir { at, x, y }, whole)| {
                let view = (at - CornellBox::EYE).normalize();
                let expected = cornell::scattered(at, view, asymmetry, PATHS, &mut random);
                let expected = luminance(expected.to_array());
                let share = whole * taken.shares[y * light.width + x];
                (luminance(light.at(x, y)) / share / expected - 1.0, at, expected)
            })
            .collect();
        errors.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
        let mean = errors.iter().map(|error| error.0).sum::<f64>() / errors.len() as f64;
        println!("asymmetry {asymmetry}: mean {mean:+.3}; worst:");
        for (error, at, expected) in errors.iter().take(8) {
            println!("  {error:+.3} of {expected:.1} at {at}");
        }
        let within = errors.iter().filter(|error| error.0.abs() < 0.15).count();
        println!("asymmetry {asymmetry}: {within} within 15 %");
        assert!(within >= at_least && mean.abs() < 0.05, "asymmetry {asymmetry}: {within} within 15 %, mean {mean}");
    }
}

/// Without fog nothing changes to the bit, nor does fog of no density.
#[test]
fn a_picture_without_fog_stays_as_it_is() {
    let mut stage = cornell_stage(SIZE, FEW);
    let without = settled(&mut stage, FEW);
    show(&mut stage, Some(camera_fog()));
    assert!(settled(&mut stage, FEW) == without, "a camera that may show fog");
    let empty = spawn_fog(&mut stage, fog(0.0), Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(3.0)));
    assert!(settled(&mut stage, FEW) == without, "fog of no density");
    stage.world().entity_mut(empty).insert(fog(FOG));
    assert!(settled(&mut stage, FEW) != without, "fog shows");
    stage.world().despawn(empty);
    assert!(settled(&mut stage, FEW) == without, "fog left something behind");
}

fn held(stage: &mut Stage) -> u64 {
    gpu_memory(stage.render_world_mut()).get("fog: light").copied().unwrap_or_default()
}

/// The ambient term of Bevy's fog stands for bounced light: it is left out where this is, and there where this is not.
#[test]
fn ambient_light_of_fog_is_not_counted_beside_bounced_light() {
    let mut stage = cornell_stage(SIZE, FEW);
    spawn_fog(&mut stage, fog(FOG), Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(3.0)));
    let ambient = VolumetricFog { ambient_intensity: 0.5, ..default() };
    let plain =
        Eye::open(&mut stage, SIZE, Exposure { ev100: 8.0 }, (Transform::from_translation(CornellBox::EYE), ambient));
    show(&mut stage, Some(camera_fog()));
    let dark = settled(&mut stage, SMALL);
    let lit = settled(&mut stage, FEW);
    let plain_beside = plain.picture(&stage);
    assert_eq!(held(&mut stage), u64::from(SIZE.element_product()) * 8);
    show(&mut stage, Some(ambient));
    assert!(settled(&mut stage, FEW) == lit, "the ambient term is counted beside bounced light");
    let bevys = settled(&mut stage, SMALL);
    assert_eq!(held(&mut stage), 0);
    assert!(plain.picture(&stage) == plain_beside, "the fog of a camera without bounced light is lit");
    let [dark, lit, bevys] = [dark, lit, bevys].map(|picture| picture.mean_luminance());
    println!("dark {dark}, lit {lit}, with Bevy's ambient term {bevys}");
    assert!(lit > 1.01 * dark && bevys > 1.01 * dark, "both show: {dark}, {lit}, {bevys}");
}

/// The light of a frame is that of the lamps in that frame, and goes with the component.
#[test]
fn fog_is_lit_by_the_lamps_of_its_frame() {
    let mut stage = cornell_stage(SIZE, FEW);
    show(&mut stage, Some(camera_fog()));
    spawn_fog(&mut stage, fog(FOG), Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(3.0)));
    let dark = settled(&mut stage, SMALL).mean_luminance();
    let lit = settled(&mut stage, FEW);
    assert!(lit.mean_luminance() > 1.01 * dark, "no bounced light in fog");
    let lamp = stage.only::<SpotLight>();
    let mut switch = |candela: f32| {
        if let Some(mut lamp) = stage.world().get_mut::<SpotLight>(lamp) {
            lamp.intensity = candela * 4.0 * std::f32::consts::PI;
        }
        stage.picture()
    };
    assert_eq!(switch(0.0).mean_luminance(), 0.0, "light of the last frame");
    assert!(switch(CornellBox::LAMP_CANDELA) == lit, "the first frame is another than those after it");
    stage.light_by(GlobalIllumination { technique: Technique::None, ..default() });
    stage.frame(Duration::ZERO);
    assert_eq!(held(&mut stage), 0, "a camera without bounced light holds its fog's");
}
