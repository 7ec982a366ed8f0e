//! Whole frames lit by radiance caches.

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy::render::renderer::RenderDevice;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, Technique, VoxelizedMesh};
use bevy_bounce_examples::Run;
use bevy_bounce_examples::scenes::{Builder, CornellPlugin, ShowroomPlugin, Walls};
use bevy_bounce_tests::balls::ball_ratios;
use bevy_bounce_tests::gpu::webgpu_limits;
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::{committed_file, save_if_asked};
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(64, 36);

pub fn cached(settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique: Technique::RadianceCache, quality: Quality::Custom(settings), ..default() }
}

fn with(radiance_cache: RadianceCacheSettings) -> GiSettings {
    GiSettings { radiance_cache, ..SMALL }
}

fn stage(settings: GiSettings, scene: impl FnOnce(&mut App)) -> Stage {
    Stage::with_run(run(SIZE, Some(cached(settings))), scene)
}

fn cornell(settings: GiSettings) -> Stage {
    stage(settings, |app| {
        app.add_plugins(CornellPlugin);
    })
}

/// `tests/data/cornell_box.indirect.exr` is path-traced from `assets/cornell_box.glb`; the scene is the same by its numbers.
#[test]
fn cornell_box_equals_its_reference() {
    let reference = Picture::load(&committed_file("cornell_box.indirect.exr")).expect("is committed");
    let bounds = Bounds { energy: Some((0.85, 1.15)), low: Some(0.25), flip: Some(0.16), nrmse: None };
    let mut stage = cornell(GiSettings { grid: 64, vpls: 1024, bounces: 12, ..SMALL });
    let metrics = compare(&stage.picture(), &reference, &bounds).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    // The bounds would notice: one bounce is too little light.
    stage.light_by(cached(GiSettings { bounces: 1, ..SMALL }));
    compare(&stage.settled_picture(), &reference, &bounds).expect_err("the bounds are too wide to tell");
}

#[test]
fn frames_are_the_same_to_the_byte_and_follow_every_change() {
    let mut stage = cornell(SMALL);
    let first = stage.picture();
    assert!(first.nonfinite() == 0 && first.mean_luminance() > 0.0, "there is bounced light");
    assert!(first == stage.picture(), "two frames of a scene that does not change differ");
    assert!(first == cornell(SMALL).picture(), "the same scene started afresh differs");
    let changed = [
        ("grid", GiSettings { grid: 24, ..SMALL }),
        ("vpls", GiSettings { vpls: 512, ..SMALL }),
        ("bounces", GiSettings { bounces: 2, ..SMALL }),
        ("reach", with(RadianceCacheSettings { reach: 3.0, ..default() })),
        ("further bounces", with(RadianceCacheSettings { further_bounces: false, ..default() })),
    ];
    for (name, settings) in changed {
        stage.light_by(cached(settings));
        let picture = stage.settled_picture();
        let metrics = Metrics::new(&picture, &first).expect("sizes are equal");
        assert!(picture.nonfinite() == 0 && metrics.nrmse > 0.005, "{name} has no effect: {metrics:?}");
    }
    stage.light_by(cached(SMALL));
    assert!(first == stage.settled_picture(), "a setting left something behind");

    let lamp = stage.only::<SpotLight>();
    let intensity = stage.world().get::<SpotLight>(lamp).map_or(0.0, |light| light.intensity);
    let set = |stage: &mut Stage, value: f32| {
        if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
            light.intensity = value;
        }
    };
    set(&mut stage, 0.0);
    assert_eq!(stage.picture().mean_luminance(), 0.0, "a light that is switched off bounces on");
    set(&mut stage, 2.0 * intensity);
    assert!((stage.picture().mean_luminance() / first.mean_luminance() - 2.0).abs() < 0.01, "twice the light");
    set(&mut stage, intensity);
    assert!(first == stage.picture(), "a light that is back differs");

    stage.light_by(illumination(SMALL));
    assert!(first != stage.settled_picture());
    stage.light_by(cached(SMALL));
    assert!(first == stage.settled_picture(), "another technique left something behind");
}

/// The limits change no pixel by more than can be seen.
#[test]
fn webgpu_limits_give_the_same_picture() {
    let settings = GiSettings { grid: 64, ..with(RadianceCacheSettings { glossy: true, ..default() }) };
    if webgpu_limits() {
        // No adapter has more then.
        return;
    }
    for light in [cached(settings), illumination(settings)] {
        let technique = light.technique;
        let [low, adapters] = [true, false].map(|webgpu_limits| {
            let run = Run { webgpu_limits, ..run(SIZE, Some(light.clone())) };
            let mut stage = Stage::with_run(run, |app| {
                app.add_plugins(ShowroomPlugin);
            });
            let limits = stage.render_world().resource::<RenderDevice>().limits();
            assert_eq!(limits.max_storage_buffers_per_shader_stage == 8, webgpu_limits, "{limits:?}");
            stage.picture()
        });
        let metrics = Metrics::new(&low, &adapters).expect("sizes are equal");
        println!("{technique:?}: {metrics:?}");
        assert!(low.mean_luminance() > 0.0 && metrics.flip <= 0.01, "{technique:?}: {metrics:?}");
    }
}

/// Three metres a side; walls emit as much and reflect nothing.
fn shining_box(build: &mut Builder, emitted: f32) {
    let wall = build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        emissive: LinearRgba::rgb(emitted, emitted, emitted),
        emissive_exposure_weight: 1.0,
        ..default()
    });
    let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| wall.clone());
    build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &Walls { floor, ceiling, back, front, left, right });
}

/// A closed box that emits and reflects nothing, with white balls in it, half of them of metal, the other half lacquered: light is the same
/// from everywhere, and so is what they send, at every roughness.
#[test]
fn a_white_furnace_is_white_at_every_roughness() {
    let emitted = 10.0;
    for roughness in [0.1, 0.3, 0.5, 0.8, 1.0] {
        let mut furnace = stage(GiSettings { grid: 64, ..SMALL }, |app| {
            app.add_systems(Startup, move |mut build: Builder| {
                shining_box(&mut build, emitted);
                for (x, metallic) in [(-0.5, 1.0), (0.5, 0.0)] {
                    let paint = build.materials.add(StandardMaterial {
                        base_color: Color::WHITE,
                        perceptual_roughness: roughness,
                        metallic,
                        ..default()
                    });
                    let mut ball = build.place(Sphere::new(0.4), Transform::from_xyz(x, 0.0, 0.0), &paint);
                    // Balls that light each other would need all bounces.
                    ball.insert(bevy_bounce::VoxelizedMesh::OFF);
                }
                build.commands.spawn((
                    Camera3d::default(),
                    Exposure { ev100: 4.0 },
                    Transform::from_xyz(0.0, 0.0, 1.45),
                ));
            });
        });
        let picture = furnace.picture();
        // Black walls reflect nothing.
        let lit: Vec<f32> =
            picture.pixels.iter().map(|pixel| pixel[1] / emitted).filter(|light| *light > 0.05).collect();
        let mean = lit.iter().sum::<f32>() / lit.len() as f32;
        let worst = lit.iter().map(|light| (light - 1.0).abs()).fold(0.0, f32::max);
        println!("roughness {roughness}: mean {mean:.4}, worst {worst:.4} off, {} pixels", lit.len());
        assert!(lit.len() > 200, "the balls are seen");
        assert!(worst < 0.02, "roughness {roughness}: mean {mean}, worst {worst}");
    }
}

/// A black ball with a clearcoat in a box that shines reflects of it what Fresnel says; beneath a coat what is white stays white.
#[test]
fn clearcoats_reflect_what_is_around() {
    let emitted = 10.0;
    let lit = |color: Color, reflectance: f32, clearcoat: f32| {
        let mut furnace = stage(GiSettings { grid: 24, ..SMALL }, move |app| {
            app.add_systems(Startup, move |mut build: Builder| {
                shining_box(&mut build, emitted);
                let coated = build.materials.add(StandardMaterial {
                    base_color: color,
                    reflectance,
                    perceptual_roughness: 0.8,
                    clearcoat,
                    clearcoat_perceptual_roughness: 0.2,
                    ..default()
                });
                let black = VoxelizedMesh { albedo: Some(Color::BLACK), ..default() };
                build.place(Sphere::new(0.4), Transform::from_xyz(0.0, 0.0, -0.3), &coated).insert(black);
                let camera = Transform::from_xyz(0.0, 0.0, 1.3);
                build.commands.spawn((Camera3d::default(), Exposure { ev100: 4.0 }, camera));
            });
        });
        // Around the middle of the ball, which faces the camera.
        furnace.picture().mean_of(30..34, 16..20)[1] / f64::from(emitted)
    };
    let bare = lit(Color::BLACK, 0.0, 0.0);
    let [coated, half] = [1.0, 0.5].map(|clearcoat| lit(Color::BLACK, 0.0, clearcoat));
    println!("black: {bare:.4}, {half:.4} and {coated:.4} with a coat");
    assert!(bare < 1e-3 && (coated / 0.04 - 1.0).abs() < 0.05, "{coated} of the light, {bare} without a coat");
    // Bevy stores strength in fifteenths.
    assert!((half / coated - 8.0 / 15.0).abs() < 0.01, "{half} of {coated}");
    let white = lit(Color::WHITE, 0.5, 1.0);
    println!("white beneath a coat: {white:.4}");
    assert!((white - 1.0).abs() < 0.03, "white beneath a coat sends {white}");
}

/// A box that shines, a metal ball and a metal block askew that reflect everything and are black to others: what is convex does not
/// stand in its own light.
#[test]
fn what_is_convex_does_not_shade_itself() {
    let emitted = 10.0;
    let mut furnace = stage(GiSettings { grid: 64, ..SMALL }, |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            shining_box(&mut build, emitted);
            let metal = build.materials.add(StandardMaterial {
                base_color: Color::WHITE,
                perceptual_roughness: 0.5,
                metallic: 1.0,
                ..default()
            });
            let black = VoxelizedMesh { albedo: Some(Color::BLACK), ..default() };
            // The ball is above the block's plane of reflection, so that neither sees much of the other.
            build.place(Sphere::new(0.35), Transform::from_xyz(-0.7, 0.7, -0.3), &metal).insert(black);
            build.block(Vec3::new(0.6, -0.9, -0.3), Vec3::splat(0.6), 0.6, &metal).insert(black);
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 4.0 }, Transform::from_xyz(0.0, 0.0, 1.45)));
        });
    });
    let picture = furnace.picture();
    let mean = |left: bool| {
        let columns = if left { 0..32 } else { 32..64 };
        let pixels = columns.flat_map(|x| (0..36).map(move |y| y * 64 + x));
        // Black walls reflect nothing.
        let lit: Vec<f32> = pixels.map(|i| picture.pixels[i][1] / emitted).filter(|light| *light > 0.2).collect();
        assert!(lit.len() > 50, "it is seen");
        lit.iter().sum::<f32>() / lit.len() as f32
    };
    let (ball, block) = (mean(true), mean(false));
    println!("ball {ball:.3}, block {block:.3}");
    assert!(ball > 0.95 && block > 0.95 && ball.max(block) < 1.02, "ball {ball}, block {block}");
}

/// A ball of metal in the Cornell box reflects what is lit only with glossy light; what is not metal stays as it was.
#[test]
fn glossy_light_stands_beside_virtual_lights() {
    let scene = |app: &mut App| {
        app.add_plugins(CornellPlugin).add_systems(Startup, |mut build: Builder| {
            let metal = build.materials.add(StandardMaterial {
                base_color: Color::WHITE,
                metallic: 1.0,
                perceptual_roughness: 0.3,
                ..default()
            });
            build.place(Sphere::new(0.6), Transform::from_xyz(0.75, 1.9, 0.5), &metal);
        });
    };
    let mut stage = Stage::new(SIZE, SMALL, scene);
    let without = stage.picture();
    let glossy = with(RadianceCacheSettings { glossy: true, ..default() });
    stage.light_by(illumination(glossy));
    let with = stage.settled_picture();
    let ball = |picture: &Picture| picture.mean_of(35..39, 17..21)[1];
    assert!(ball(&without) < 1e-3 * without.mean_luminance(), "metal is lit without glossy light: {}", ball(&without));
    assert!(ball(&with) > 0.2 * with.mean_luminance(), "{} of {}", ball(&with), with.mean_luminance());
    let wall = |picture: &Picture| picture.mean_of(14..20, 4..30)[0];
    assert!((wall(&with) / wall(&without) - 1.0).abs() < 0.1, "the wall: {} not {}", wall(&with), wall(&without));
    stage.light_by(illumination(SMALL));
    assert!(without == stage.settled_picture(), "glossy light left something behind");
}

/// Two rooms that share a wall of 10 cm in a scene of 8 m: light in one, none in the other.
#[test]
fn a_sealed_room_stays_dark() {
    let look = |side: f32| Transform::from_xyz(3.7 * side, 1.5, 1.2).looking_at(Vec3::new(0.0, 1.5, -0.4), Vec3::Y);
    let mut stage = stage(GiSettings { grid: 64, ..SMALL }, move |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            let white = build.paint([0.7; 3]);
            let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| white.clone());
            let walls = Walls { floor, ceiling, back, front, left, right };
            build.room(Vec3::new(-4.0, 0.0, -2.0), Vec3::new(-0.05, 3.0, 2.0), &walls);
            build.room(Vec3::new(0.05, 0.0, -2.0), Vec3::new(4.0, 3.0, 2.0), &walls);
            build.commands.spawn((
                PointLight { intensity: 500_000.0, range: 100.0, ..default() },
                Transform::from_xyz(-2.0, 2.0, 0.3),
            ));
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 6.0 }, look(-1.0)));
        });
    });
    let bright = stage.picture().mean_luminance();
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(look(1.0));
    let dark = stage.picture().mean_luminance();
    assert!(bright > 1.0 && dark < 0.01 * bright, "{:.2} % of the light is in the dark room", 100.0 * dark / bright);
}

/// `tests/data/glossy_box.large.indirect.exr` is path-traced from `assets/glossy_box.glb`.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn glossy_balls_equal_their_reference() {
    let reference = Picture::load(&committed_file("glossy_box.large.indirect.exr")).expect("is committed");
    let size = UVec2::new(reference.width as u32, reference.height as u32);
    let radiance_cache = RadianceCacheSettings { glossy: true, ..default() };
    // Of the default's 2048 lights chance alone makes a ball of plastic 5 % brighter or darker.
    let settings = GiSettings { history: 0, vpls: 4096, radiance_cache, ..Quality::default().settings() };
    let mut stage = Stage::of_asset("glossy_box.glb", run(size, Some(illumination(settings))), false, None);
    let picture = stage.picture();
    save_if_asked(&picture, "glossy_box.exr");
    let ratios = ball_ratios(&picture, &reference);
    println!("{ratios:?}");
    let wrong: Vec<_> = ratios.iter().filter(|ball| (ball.ratio - 1.0).abs() > 0.12).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
    // The bounds would notice: without glossy light metal is black.
    stage.light_by(illumination(GiSettings { radiance_cache: RadianceCacheSettings::DEFAULT, ..settings }));
    let dull = ball_ratios(&stage.settled_picture(), &reference);
    assert!(dull.iter().all(|ball| ball.metallic == 0.0 || ball.ratio < 0.05), "{dull:?}");
}
