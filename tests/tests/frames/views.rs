//! Cameras of all kinds: beside each other, parallel, into textures, parts of a view, with multisampling, switched at run time.

use std::time::Duration;

use bevy::camera::{Exposure, MainPassResolutionOverride, RenderTarget, ScalingMode, SubCameraView, Viewport};
use bevy::core_pipeline::prepass::DeferredPrepass;
use bevy::ecs::system::RunSystemOnce;
use bevy::prelude::*;
use bevy::render::sync_world::RenderEntity;
use bevy_bounce::{GiIsolate, GiSettings, GlobalIllumination, Resolution, SsbcSettings, Technique};
use bevy_bounce_examples::scenes::{Builder, CornellPlugin};
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};

const SIZE: UVec2 = UVec2::new(64, 36);
const EXPOSURE: Exposure = Exposure { ev100: 7.0 };

/// A Cornell box whose own camera sleeps.
fn cornell() -> Stage {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_plugins(CornellPlugin);
    });
    let main = stage.only::<Camera3d>();
    if let Some(mut camera) = stage.world().get_mut::<Camera>(main) {
        camera.is_active = false;
    }
    stage
}

fn front() -> Transform {
    Transform::from_xyz(0.0, 2.0, 6.5).looking_at(Vec3::new(0.0, 2.0, 0.0), Vec3::Y)
}

fn aside() -> Transform {
    Transform::from_xyz(1.5, 2.5, 4.0).looking_at(Vec3::new(-1.0, 1.0, -1.0), Vec3::Y)
}

fn bounced() -> impl Bundle {
    (illumination(SMALL), GiIsolate::Indirect)
}

fn settle(stage: &mut Stage) {
    for _ in 0..4 {
        stage.frame(Duration::ZERO);
    }
}

/// What a camera with `bundle` sees, which is gone afterwards.
fn seen(stage: &mut Stage, size: UVec2, bundle: impl Bundle) -> Picture {
    let eye = Eye::open(stage, size, EXPOSURE, bundle);
    settle(stage);
    let picture = eye.picture(stage);
    eye.close(stage);
    picture
}

fn part(picture: &Picture, from: UVec2, size: UVec2) -> Picture {
    Picture::from_fn(size.x as usize, size.y as usize, |x, y| picture.at(x + from.x as usize, y + from.y as usize))
}

/// Two halves of a target are what two cameras see by themselves, but for how numbers are rounded away from the corner.
#[test]
fn a_split_screen_shows_two_cameras() {
    let mut stage = cornell();
    let half = UVec2::new(SIZE.x / 2, SIZE.y);
    let alone = [front(), aside()].map(|place| seen(&mut stage, half, (bounced(), place)));
    assert!(alone[0] != alone[1] && alone.iter().all(|picture| picture.mean_luminance() > 0.0));
    let side = |x: u32, order: isize| {
        let viewport = Viewport { physical_position: UVec2::new(x, 0), physical_size: half, ..default() };
        Camera { viewport: Some(viewport), order, ..default() }
    };
    let left = Eye::open(&mut stage, SIZE, EXPOSURE, (bounced(), front(), side(0, 0)));
    let over = RenderTarget::Image(left.target.clone().into());
    let keep = Camera { clear_color: ClearColorConfig::None, ..side(half.x, 1) };
    let right = Eye::open(&mut stage, SIZE, EXPOSURE, (bounced(), aside(), keep));
    stage.world().entity_mut(right.camera).insert(over);
    settle(&mut stage);
    let both = left.picture(&stage);
    for (x, alone) in [0, half.x].into_iter().zip(&alone) {
        let seen = part(&both, UVec2::new(x, 0), half);
        let metrics = Metrics::new(&seen, alone).expect("sizes are equal");
        assert!(metrics.nrmse < 1e-4, "the half at {x} is another picture: {metrics:?}");
    }
}

/// Two cameras with targets of their own and settings of their own: the world follows the more demanding one, and each has
/// its own resolution and technique.
#[test]
fn cameras_with_other_settings_do_not_disturb_each_other() {
    let mut stage = cornell();
    let alone = seen(&mut stage, SIZE, (bounced(), front()));
    let settings = GiSettings { resolution: Resolution::Half, ..SMALL };
    for other in [
        illumination(settings),
        GlobalIllumination { technique: Technique::None, ..default() },
        GlobalIllumination { technique: Technique::SurfaceRadiosity, ..default() },
    ] {
        let name = format!("{other:?}");
        let first = Eye::open(&mut stage, SIZE, EXPOSURE, (bounced(), front()));
        let second = Eye::open(&mut stage, SIZE / 2, EXPOSURE, (other, GiIsolate::Indirect, aside()));
        settle(&mut stage);
        assert!(first.picture(&stage) == alone, "beside {name}");
        assert_eq!(second.picture(&stage).nonfinite(), 0, "{name}");
        first.close(&mut stage);
        second.close(&mut stage);
    }
}

/// A parallel view shows the same light at the same place as one in perspective.
#[test]
fn a_parallel_view_shows_the_same_light() {
    let mut stage = cornell();
    // From between the blocks and the back wall, two metres of which fill both pictures.
    let distance = 0.5;
    let place = Transform::from_xyz(0.0, 2.0, -2.0 + distance).looking_at(Vec3::new(0.0, 2.0, -2.0), Vec3::Y);
    let height = 2.0;
    let fov = 2.0 * (0.5 * height / distance).atan();
    let perspective = Projection::Perspective(PerspectiveProjection { fov, ..default() });
    let parallel = Projection::Orthographic(OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: height },
        ..OrthographicProjection::default_3d()
    });
    let size = UVec2::new(36, 36);
    for visibility in [SMALL.visibility, bevy_bounce::VplVisibility::Atlas] {
        let light = || (illumination(GiSettings { visibility, ..SMALL }), GiIsolate::Indirect);
        let central = seen(&mut stage, size, (light(), place, perspective.clone()));
        let parallel = seen(&mut stage, size, (light(), place, parallel.clone()));
        let metrics = Metrics::new(&parallel, &central).expect("sizes are equal");
        println!("{visibility:?}: {metrics:?}");
        assert!((metrics.energy - 1.0).abs() < 1e-3 && metrics.nrmse < 0.01, "{metrics:?}");
    }
}

/// Every technique knows parallel views.
#[test]
fn every_technique_lights_a_parallel_view() {
    let mut stage = cornell();
    let parallel = Projection::Orthographic(OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 4.0 },
        ..OrthographicProjection::default_3d()
    });
    let ssbc = SsbcSettings { iterations: 1, ..default() };
    let compensated = GiSettings { resolution: Resolution::Half, ssbc, ..SMALL };
    for technique in [Technique::InstantRadiosity, Technique::RadianceCache] {
        let light = (GlobalIllumination { technique, ..illumination(compensated) }, GiIsolate::Indirect, front());
        let central = seen(&mut stage, SIZE, light.clone());
        let parallel = seen(&mut stage, SIZE, (light, parallel.clone()));
        let ratio = parallel.mean_luminance() / central.mean_luminance();
        println!("{technique:?}: {ratio}");
        assert!(parallel.nonfinite() == 0 && (0.5..2.0).contains(&ratio), "{technique:?}: {ratio}");
    }
}

/// A picture with bounced light on a screen in the scene: another camera sees it there, and its light there in turn.
#[test]
fn a_screen_shows_what_a_camera_sees() {
    let mut stage = cornell();
    let size = UVec2::splat(16);
    let filmed = Eye::open(&mut stage, size, EXPOSURE, (bounced(), front(), Camera { order: -1, ..default() }));
    let target = filmed.target.clone();
    // Far away from the box, alone and unlit, filling the view.
    let screen = move |mut build: Builder| {
        let paint = build.materials.add(StandardMaterial {
            base_color_texture: Some(target.clone()),
            unlit: true,
            cull_mode: None,
            ..default()
        });
        build.place(Rectangle::new(2.0, 2.0), Transform::from_xyz(100.0, 0.0, 0.0), &paint);
    };
    stage.world().run_system_once(screen).expect("the screen is there");
    let fov = std::f32::consts::FRAC_PI_2;
    let whole = Projection::Perspective(PerspectiveProjection { fov, ..default() });
    let place = Transform::from_xyz(100.0, 0.0, 1.0);
    let shown = seen(&mut stage, size, (illumination(SMALL), GiIsolate::Direct, place, whole));
    // Of the same frame: the screen is part of the scene, whose grid it makes coarser.
    let picture = filmed.picture(&stage);
    let metrics = Metrics::new(&shown, &picture).expect("sizes are equal");
    println!("{metrics:?}");
    // Bevy's G-buffer keeps colours in eight bits.
    assert!(picture.mean_luminance() > 0.0 && metrics.nrmse < 0.03, "{metrics:?}");
}

/// A part of a view is that part of its picture.
#[test]
fn a_part_of_a_view_is_a_part_of_its_picture() {
    let mut stage = cornell();
    let whole = seen(&mut stage, SIZE, (bounced(), front()));
    let (from, size) = (UVec2::new(16, 8), UVec2::new(32, 20));
    let view = SubCameraView { full_size: SIZE, offset: from.as_vec2(), size };
    let camera = Camera { sub_camera_view: Some(view), ..default() };
    let sub = seen(&mut stage, size, (bounced(), front(), camera));
    // Filters know less at the border.
    let inner = |picture: &Picture, from: UVec2| part(picture, from + 4, size - 8);
    let metrics = Metrics::new(&inner(&sub, UVec2::ZERO), &inner(&whole, from)).expect("sizes are equal");
    println!("{metrics:?}");
    assert!((metrics.energy - 1.0).abs() < 1e-3 && metrics.nrmse < 1e-3, "{metrics:?}");
}

/// A main pass of half the size, as upscalers ask for it: in its corner of the target is what a camera of that size sees.
#[test]
fn a_smaller_main_pass_shows_a_smaller_picture() {
    assert_smaller(Technique::InstantRadiosity);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn a_smaller_main_pass_shows_a_smaller_picture_by_caches() {
    assert_smaller(Technique::RadianceCache);
}

fn assert_smaller(technique: Technique) {
    let mut stage = cornell();
    let half = SIZE / 2;
    let light = GlobalIllumination { technique, ..illumination(GiSettings { history: 0, ..default() }) };
    let light = || (light.clone(), GiIsolate::Indirect, front());
    let alone = seen(&mut stage, half, light());
    let eye = Eye::open(&mut stage, SIZE, EXPOSURE, light());
    settle(&mut stage);
    let whole = eye.picture(&stage);
    let rendered = stage.world().get::<RenderEntity>(eye.camera).expect("is rendered").id();
    stage.render_world_mut().entity_mut(rendered).insert(MainPassResolutionOverride(half));
    settle(&mut stage);
    let metrics = Metrics::new(&part(&eye.picture(&stage), UVec2::ZERO, half), &alone).expect("sizes are equal");
    println!("{metrics:?}");
    assert!((metrics.energy - 1.0).abs() < 0.02 && metrics.nrmse < 0.02, "{metrics:?}");
    stage.render_world_mut().entity_mut(rendered).remove::<MainPassResolutionOverride>();
    settle(&mut stage);
    assert!(eye.picture(&stage) == whole, "an override left something behind");
    eye.close(&mut stage);
}

/// Opaque materials are deferred in the whole app: a camera that asks for multisampling loses that, and is lit as any other.
/// Without bounced light it goes without as well, and shows Bevy's deferred picture.
#[test]
fn multisampling_gives_way() {
    let mut stage = cornell();
    let plain = seen(&mut stage, SIZE, (bounced(), front()));
    assert!(plain == seen(&mut stage, SIZE, (bounced(), front(), Msaa::Sample4)), "from the start");
    let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (bounced(), front()));
    settle(&mut stage);
    stage.world().entity_mut(eye.camera).insert(Msaa::Sample4);
    settle(&mut stage);
    assert!(plain == eye.picture(&stage), "at run time");
    assert_eq!(stage.world().get::<Msaa>(eye.camera), Some(&Msaa::Off));
    stage.world().entity_mut(eye.camera).remove::<GlobalIllumination>().insert(Msaa::Sample4);
    settle(&mut stage);
    assert_eq!(stage.world().get::<Msaa>(eye.camera), Some(&Msaa::Off));
    assert!(stage.world().get::<DeferredPrepass>(eye.camera).is_some());
    assert!(eye.picture(&stage).mean_luminance() > 0.0);
}

/// Targets of another size from one frame to the next, down to a pixel: each picture is as that of a camera that never changed.
#[test]
fn targets_change_their_size() {
    let mut stage = cornell();
    let sizes = [UVec2::new(40, 24), UVec2::ONE, UVec2::new(7, 33), SIZE];
    let expected = sizes.map(|size| seen(&mut stage, size, (bounced(), front())));
    let mut eye = Eye::open(&mut stage, SIZE, EXPOSURE, (bounced(), front()));
    settle(&mut stage);
    for (size, expected) in sizes.into_iter().zip(expected) {
        eye.resize(&mut stage, size);
        settle(&mut stage);
        assert!(eye.picture(&stage) == expected, "{size}");
    }
}

/// Off and on again, by component and by technique: the picture is that of before.
#[test]
fn bounced_light_is_switched_at_run_time() {
    let mut stage = cornell();
    let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (illumination(SMALL), front()));
    settle(&mut stage);
    let lit = eye.picture(&stage);
    let off = GlobalIllumination { technique: Technique::None, ..default() };
    let mut dark = Vec::new();
    for by_component in [true, false] {
        let mut camera = stage.world().entity_mut(eye.camera);
        match by_component {
            true => camera.remove::<GlobalIllumination>(),
            false => camera.insert(off.clone()),
        };
        settle(&mut stage);
        dark.push(eye.picture(&stage));
        stage.world().entity_mut(eye.camera).insert(illumination(SMALL));
        // In the very next frame.
        stage.frame(Duration::ZERO);
        assert!(eye.picture(&stage) == lit, "light that is back differs");
    }
    assert!(dark[0] == dark[1] && dark[0] != lit, "off is off");
}
