//! Whole frames with and without history.

use std::time::Duration;

use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::camera::{Exposure, ScalingMode, SubCameraView, Viewport};
use bevy::core_pipeline::prepass::MotionVectorPrepass;
use bevy::diagnostic::FrameCount;
use bevy::prelude::*;
use bevy_bounce::{
    GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, Resolution, SsbcSettings, Technique,
    gpu_memory,
};
use bevy_bounce_examples::scenes::{Builder, CornellPlugin};
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(64, 36);
const EXPOSURE: Exposure = Exposure { ev100: 7.0 };
const FRAMES: u32 = 8;
/// What a pixel of a frame is off its own light at most, as `history/average.wgsl` has it.
const MOST: f64 = 0.041;
/// The same where light is even: the mean of a picture.
const EVEN: f64 = 0.024;

fn with_history(settings: GiSettings) -> GiSettings {
    GiSettings { history: FRAMES, ..settings }
}

fn lit(technique: Technique, settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique, quality: Quality::Custom(settings), ..default() }
}

fn cornell(settings: GiSettings) -> Stage {
    Stage::new(SIZE, settings, |app| {
        app.add_plugins(CornellPlugin);
    })
}

fn place(stage: &mut Stage) -> (Entity, Transform) {
    let camera = stage.only::<Camera3d>();
    (camera, *stage.world().get::<Transform>(camera).expect("has a place"))
}

fn metrics(picture: &Picture, expected: &Picture) -> Metrics {
    Metrics::new(picture, expected).expect("sizes are equal")
}

/// By how much pixels differ, as a share of what is expected and a little of the mean; the given share of them differs by less.
fn differs_by(picture: &Picture, expected: &Picture, share: f64) -> f64 {
    let little = 0.05 * expected.mean_luminance();
    let off = |(a, b): (&[f32; 3], &[f32; 3])| {
        let channel = |c: usize| f64::from((a[c] - b[c]).abs()) / (f64::from(b[c]) + little);
        (0..3).map(channel).fold(0.0, f64::max)
    };
    let mut all: Vec<f64> = picture.pixels.iter().zip(&expected.pixels).map(off).collect();
    all.sort_by(f64::total_cmp);
    all[((all.len() - 1) as f64 * share) as usize]
}

/// At half resolution, compensated.
fn halved() -> GiSettings {
    GiSettings { resolution: Resolution::Half, ssbc: SsbcSettings { iterations: 1, ..default() }, ..SMALL }
}

#[test]
fn still_frames_are_as_without_history() {
    assert_still_is_the_same([(Technique::InstantRadiosity, SMALL), (Technique::InstantRadiosity, halved())]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn still_frames_of_caches_are_as_without_history() {
    let glossy = RadianceCacheSettings { glossy: true, ..default() };
    assert_still_is_the_same([
        (Technique::InstantRadiosity, GiSettings { radiance_cache: glossy, ..halved() }),
        (Technique::RadianceCache, SMALL),
    ]);
}

/// What does not change is the same to the bit, whatever lights it; what does, shows that there is a history.
fn assert_still_is_the_same(cases: [(Technique, GiSettings); 2]) {
    let mut stage = cornell(SMALL);
    let (camera, home) = place(&mut stage);
    for (technique, settings) in cases {
        stage.light_by(lit(technique, settings));
        let without = stage.settled_picture();
        stage.light_by(lit(technique, with_history(settings)));
        // Bevy's prepass has other pipelines with motion vectors.
        (0..2 * FRAMES).for_each(|_| stage.frame(Duration::ZERO));
        for frame in 0..2 * FRAMES {
            let with = stage.picture();
            assert!(with == without, "{technique:?}, frame {frame}: {:?}", metrics(&with, &without));
        }
        let aside = home.with_translation(home.translation + Vec3::new(0.02, 0.0, 0.0));
        stage.world().entity_mut(camera).insert(aside);
        let moved = stage.picture();
        stage.light_by(lit(technique, settings));
        let expected = stage.settled_picture();
        assert!(moved != expected, "{technique:?}: there is no history");
        let off = differs_by(&moved, &expected, 0.99);
        println!("{technique:?}: {off}");
        assert!(off < MOST, "{technique:?}: {off} off");
        stage.world().entity_mut(camera).insert(home);
        stage.settled_picture();
    }
}

/// In the frame in which lamps are switched, dimmed or moved, the picture is that of a fresh start, but for a few percent at most.
#[test]
fn light_that_changes_shows_in_its_frame() {
    let [mut with, mut without] = [with_history(SMALL), SMALL].map(cornell);
    let changed = |stage: &mut Stage, change: &dyn Fn(&mut World, Entity)| {
        let lamp = stage.only::<SpotLight>();
        let before = stage.world().get::<SpotLight>(lamp).copied().unwrap_or_default();
        (0..FRAMES).for_each(|_| stage.frame(Duration::ZERO));
        change(stage.world(), lamp);
        let picture = stage.picture();
        stage.world().entity_mut(lamp).insert(before);
        picture
    };
    for by in [0.0, 0.5, 0.9, 0.95, 0.97, 1.03, 1.06, 1.2, 3.0] {
        let change = |world: &mut World, lamp: Entity| {
            if let Some(mut light) = world.get_mut::<SpotLight>(lamp) {
                light.intensity *= by;
            }
        };
        let (with, without) = (changed(&mut with, &change), changed(&mut without, &change));
        if by == 0.0 {
            assert!(with == without && with.mean_luminance() == 0.0, "a lamp that is switched off bounces on");
            continue;
        }
        let energy = with.mean_luminance() / without.mean_luminance();
        let worst = differs_by(&with, &without, 0.99);
        println!("{by}: energy {energy:.4}, 99 % within {worst:.4}");
        assert!((energy - 1.0).abs() < MOST && worst < MOST, "{by}: energy {energy}, 99 % within {worst}");
    }
    let second = |world: &mut World, _: Entity| {
        let lamp = PointLight { intensity: 200_000.0, shadow_maps_enabled: true, ..default() };
        world.spawn((lamp, Transform::from_xyz(-1.0, 1.0, 1.5)));
    };
    let (with, without) = (changed(&mut with, &second), changed(&mut without, &second));
    let (energy, worst) = (metrics(&with, &without).energy, differs_by(&with, &without, 0.99));
    println!("another lamp: energy {energy:.4}, 99 % within {worst:.4}");
    assert!((energy - 1.0).abs() < EVEN && worst < MOST, "another lamp: energy {energy}, 99 % within {worst}");
}

/// A ball that was in front of the wall and is gone in the next frame leaves nothing behind; nor does one that passes by.
#[test]
fn what_moves_away_leaves_no_ghost() {
    let ball = |stage: &mut Stage| {
        let mut named = stage.world().query::<(Entity, &Name)>();
        let found = named.iter(stage.world()).find(|(_, name)| name.as_str() == "ball").map(|(entity, _)| entity);
        found.expect("there is a ball")
    };
    let scene = |settings| {
        Stage::new(SIZE, settings, |app| {
            app.add_plugins(CornellPlugin).add_systems(Startup, |mut build: Builder| {
                let dark = build.paint([0.1, 0.1, 0.1]);
                build.place(Sphere::new(0.5), Transform::from_xyz(-0.5, 2.2, 1.5), &dark).insert(Name::new("ball"));
            });
        })
    };
    let frames = |settings: GiSettings| -> Vec<Picture> {
        let mut stage = scene(settings);
        let ball = ball(&mut stage);
        for _ in 0..FRAMES {
            stage.picture();
        }
        let mut pictures = Vec::new();
        for x in [-0.1, 0.3, 0.7, 1.1, 20.0] {
            stage.world().entity_mut(ball).insert(Transform::from_xyz(x, 2.2, 1.5));
            pictures.push(stage.picture());
        }
        pictures
    };
    for (with, without) in frames(with_history(SMALL)).iter().zip(&frames(SMALL)) {
        let (most, worst) = (differs_by(with, without, 0.99), differs_by(with, without, 1.0));
        println!("energy {:.4}, 99 % within {most:.4}, all within {worst:.4}", metrics(with, without).energy);
        assert!(with != without && most < MOST && worst < 3.0 * MOST, "99 % within {most}, all within {worst}");
    }
}

/// Between two views of the room, frame by frame: each is as it would be alone.
#[test]
fn a_cut_needs_nothing() {
    let views = [Vec3::new(0.0, 2.0, 6.5), Vec3::new(1.5, 2.5, 4.0), Vec3::new(-1.0, 1.0, 0.5)]
        .map(|at| Transform::from_translation(at).looking_at(Vec3::new(-0.5, 1.0, -1.0), Vec3::Y));
    let mut stage = cornell(with_history(SMALL));
    let (camera, _) = place(&mut stage);
    let look = |stage: &mut Stage, view: Transform, settings| {
        stage.light_by(illumination(settings));
        stage.world().entity_mut(camera).insert(view);
        stage.picture()
    };
    let alone = views.map(|view| {
        look(&mut stage, view, SMALL);
        look(&mut stage, view, SMALL)
    });
    for turn in 0..2 {
        for (i, view) in views.into_iter().enumerate() {
            let cut = look(&mut stage, view, with_history(SMALL));
            let (most, worst) = (differs_by(&cut, &alone[i], 0.99), differs_by(&cut, &alone[i], 1.0));
            println!("view {i}: 99 % within {most:.4}, all within {worst:.4}");
            assert!(turn == 0 && i == 0 || cut != alone[i], "nothing is recalled");
            assert!(most < MOST && worst < 3.0 * MOST, "view {i}: 99 % within {most}, all within {worst}");
        }
    }
}

/// The camera loses its history and gets it back: memory and motion vectors go and come.
#[test]
fn nothing_is_held_without_history() {
    let mut stage = cornell(SMALL);
    let (camera, _) = place(&mut stage);
    let held = |stage: &mut Stage| -> u64 {
        let memory = gpu_memory(stage.render_world_mut());
        memory.iter().filter(|(name, _)| name.starts_with("history")).map(|(_, bytes)| bytes).sum()
    };
    let off = lit(Technique::None, with_history(SMALL));
    let caches = lit(Technique::RadianceCache, with_history(SMALL));
    let pixels = u64::from(SIZE.x * SIZE.y);
    for (light, bytes) in [
        (illumination(SMALL), 0),
        (illumination(with_history(SMALL)), 12),
        (caches, 20),
        (illumination(GiSettings { history: 1, ..SMALL }), 0),
        (illumination(with_history(SMALL)), 12),
        (off, 0),
    ] {
        stage.light_by(light.clone());
        stage.frame(Duration::ZERO);
        stage.frame(Duration::ZERO);
        assert_eq!(held(&mut stage), bytes * pixels, "{light:?}");
        assert_eq!(stage.world().get::<MotionVectorPrepass>(camera).is_some(), bytes > 0, "{light:?}");
    }
    stage.light_by(illumination(with_history(SMALL)));
    let first = stage.settled_picture();
    stage.world().entity_mut(camera).remove::<GlobalIllumination>();
    stage.frame(Duration::ZERO);
    assert_eq!(held(&mut stage), 0, "a camera that lost bounced light");
    stage.light_by(illumination(with_history(SMALL)));
    assert!(first == stage.settled_picture(), "a camera that got it back");
    stage.world().despawn(camera);
    stage.frame(Duration::ZERO);
    assert_eq!(held(&mut stage), 0, "a camera that is gone");
}

/// How much light trembles as a camera creeps: what two steps in a row change it by, less what is common to both.
fn unrest(stage: &mut Stage, size: UVec2, camera: impl Bundle + Clone, place: Transform, settings: GiSettings) -> f64 {
    let light = (illumination(settings), GiIsolate::Indirect);
    let eye = Eye::open(stage, size, EXPOSURE, (light, camera, place));
    (0..6).for_each(|_| stage.frame(Duration::ZERO));
    let step = |stage: &mut Stage, frame: u32| {
        let moved = place.translation + place.right() * (0.004 * frame as f32);
        stage.world().entity_mut(eye.camera).insert(place.with_translation(moved));
        stage.frame(Duration::ZERO);
        eye.picture(stage)
    };
    let pictures: Vec<Picture> = (1..=14).map(|frame| step(stage, frame)).collect();
    assert!(pictures.iter().all(|picture| picture.nonfinite() == 0));
    let bend = |p: &[Picture]| {
        let middle = Picture::from_fn(p[0].width, p[0].height, |x, y| {
            let (a, b) = (p[0].at(x, y), p[2].at(x, y));
            std::array::from_fn(|c| 0.5 * (a[c] + b[c]))
        });
        // Edges move however calm light is.
        differs_by(&p[1], &middle, 0.9)
    };
    let sum: f64 = pictures.windows(3).map(bend).sum();
    eye.close(stage);
    sum / 12.0
}

/// Views find their last frame: what creeps is calmer with history.
fn views_are_calmer(kinds: &[(&str, Projection, Camera)]) {
    let mut stage = cornell(SMALL);
    let (camera, _) = place(&mut stage);
    if let Some(mut camera) = stage.world().get_mut::<Camera>(camera) {
        camera.is_active = false;
    }
    let front = Transform::from_xyz(0.0, 2.0, 6.5).looking_at(Vec3::new(0.0, 2.0, 0.0), Vec3::Y);
    for (name, projection, camera) in kinds {
        let [without, with] = [SMALL, with_history(SMALL)]
            .map(|settings| unrest(&mut stage, SIZE, (projection.clone(), camera.clone()), front, settings));
        println!("{name}: {without:.5} without, {with:.5} with");
        assert!(with < 0.7 * without, "{name}: {without} without history, {with} with it");
    }
}

#[test]
fn views_of_other_kinds_are_calmer() {
    let parallel = Projection::Orthographic(OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 4.0 },
        ..OrthographicProjection::default_3d()
    });
    let viewport = Viewport { physical_position: UVec2::new(10, 4), physical_size: UVec2::new(50, 30), ..default() };
    let viewport = Camera { viewport: Some(viewport), ..default() };
    views_are_calmer(&[
        ("perspective", Projection::default(), Camera::default()),
        ("parallel", parallel, Camera::default()),
        ("a viewport", Projection::default(), viewport),
    ]);
}

#[test]
fn a_part_of_a_view_is_calmer() {
    let part = SubCameraView { full_size: 2 * SIZE, offset: Vec2::new(40.0, 20.0), size: SIZE };
    let part = Camera { sub_camera_view: Some(part), ..default() };
    views_are_calmer(&[("a part of a view", Projection::default(), part)]);
}

/// Jitter of temporal anti-aliasing is not taken for motion: pictures are as bright, as sharp and as calm as without history.
#[test]
fn temporal_anti_aliasing_goes_beside() {
    let pictures = |settings: GiSettings| -> Vec<Picture> {
        let run = run(SIZE, Some(illumination(settings)));
        let mut stage = Stage::with_run(run, |app| {
            app.add_plugins(CornellPlugin);
        });
        let (camera, _) = place(&mut stage);
        stage.world().entity_mut(camera).insert(TemporalAntiAliasing::default());
        // Which jitter a frame has follows from its number, and how many it took to compile everything does not matter here.
        stage.world().insert_resource(FrameCount(0));
        (0..16).for_each(|_| stage.frame(Duration::ZERO));
        (0..8).map(|_| stage.picture()).collect()
    };
    let (with, without) = (pictures(with_history(SMALL)), pictures(SMALL));
    for (with, without) in with.iter().zip(&without) {
        let metrics = metrics(with, without);
        println!("{metrics:?}");
        assert!((metrics.energy - 1.0).abs() < EVEN && metrics.nrmse < MOST, "{metrics:?}");
    }
    let restless = |pictures: &[Picture]| pictures.windows(2).map(|p| metrics(&p[1], &p[0]).nrmse).fold(0.0, f64::max);
    let (with, without) = (restless(&with), restless(&without));
    println!("from frame to frame: {without:.5} without history, {with:.5} with");
    assert!(with <= 1.05 * without, "{with} with history, {without} without");
}

/// A target that changes its size, and an exposure that changes, from one frame to the next.
#[test]
fn sizes_and_exposures_change() {
    let mut stage = cornell(SMALL);
    let front = Transform::from_xyz(0.0, 2.0, 6.5).looking_at(Vec3::new(0.0, 2.0, 0.0), Vec3::Y);
    let light = (illumination(with_history(SMALL)), GiIsolate::Indirect);
    let mut eye = Eye::open(&mut stage, SIZE, EXPOSURE, (light, front));
    (0..3 * FRAMES).for_each(|_| stage.frame(Duration::ZERO));
    let first = eye.picture(&stage);
    for size in [UVec2::new(40, 24), UVec2::ONE, SIZE] {
        eye.resize(&mut stage, size);
        (0..FRAMES).for_each(|_| stage.frame(Duration::ZERO));
    }
    let back = eye.picture(&stage);
    assert!(back == first, "another size left something behind: {:?}", metrics(&back, &first));
    // Two stops: four times what is stored.
    let brighter = Exposure { ev100: EXPOSURE.ev100 - 2.0 };
    stage.world().entity_mut(eye.camera).insert(brighter);
    stage.frame(Duration::ZERO);
    let off = differs_by(&eye.picture(&stage), &first.map(|pixel| pixel.map(|c| 4.0 * c)), 1.0);
    println!("another exposure: {off}");
    assert!(off < 0.002, "another exposure: {off}");
}
