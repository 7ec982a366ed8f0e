//! Ambient light that a game has set, as a sky: beside Bevy's own picture, and against closed forms.

use std::f32::consts::PI;

use bevy::light::{LightProbe, Skybox};
use bevy::prelude::*;
use bevy_bounce::{GiIsolate, GiLight, GiSettings, GlobalIllumination, Technique};
use bevy_bounce_examples::scenes::Builder;
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

use super::sky::closed_room;

const SIZE: UVec2 = UVec2::new(48, 32);
const BRIGHTNESS: f32 = 1000.0;
const ALBEDO: f32 = 0.6;
const SETTINGS: GiSettings = GiSettings { grid: 48, sky: 256, ..SMALL };

/// A floor 8 m square in the x-z-plane, seen from above, with what else `more` builds.
fn stage(settings: GiSettings, forward: bool, more: fn(&mut Builder)) -> Stage {
    let run = bevy_bounce_examples::Run { isolate: GiIsolate::All, forward, ..run(SIZE, Some(illumination(settings))) };
    Stage::with_run(run, move |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            let paint = build.paint([ALBEDO; 3]);
            build.panel(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, &paint);
            more(&mut build);
            let eye = Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::NEG_Z);
            build.commands.spawn((Camera3d::default(), eye));
        });
        // Nothing is mirrored.
        app.add_systems(PostStartup, |mut materials: ResMut<Assets<StandardMaterial>>| {
            for (_, material) in materials.iter_mut() {
                *material = StandardMaterial { reflectance: 0.0, ..material.clone() };
            }
        });
    })
}

fn set(stage: &mut Stage, brightness: f32) {
    stage.world().insert_resource(GlobalAmbientLight { brightness, ..default() });
}

/// On the camera.
fn put(stage: &mut Stage, bundle: impl Bundle) {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(bundle);
}

/// Off the camera.
fn take<B: Bundle>(stage: &mut Stage) {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).remove::<B>();
}

fn without_technique() -> GlobalIllumination {
    GlobalIllumination { technique: Technique::None, ..default() }
}

/// Of all pixels.
fn colour(picture: &Picture) -> Vec3 {
    picture.mean_of(0..picture.width, 0..picture.height).map(|channel| channel as f32).into()
}

/// Less four pixels on each side.
fn without_ends(picture: &Picture) -> Picture {
    Picture::from_fn(picture.width - 8, picture.height - 8, |x, y| picture.at(x + 4, y + 4))
}

fn assert_alike(found: &Picture, expected: &Picture, tolerance: f32) {
    for (found, expected) in found.pixels.iter().zip(&expected.pixels) {
        let ratio = luminance(*found) / luminance(*expected);
        assert!((ratio as f32 - 1.0).abs() < tolerance, "{found:?}, expected {expected:?}");
    }
}

#[test]
fn an_open_floor_is_as_bright_as_bevys() {
    let mut stage = stage(SETTINGS, false, |_| {});
    set(&mut stage, BRIGHTNESS);
    let ours = stage.settled_picture();
    stage.light_by(without_technique());
    let bevys = stage.settled_picture();
    println!("{} cd/m^2, {} by Bevy", colour(&ours), colour(&bevys));
    assert!(bevys.mean_luminance() > 100.0, "{} cd/m^2 are too dark to tell", bevys.mean_luminance());
    assert_alike(&ours, &bevys, 0.03);

    set(&mut stage, 500.0);
    let bevys_half = stage.picture();
    stage.light_by(illumination(SETTINGS));
    assert_alike(&stage.settled_picture(), &bevys_half, 0.03);
    set(&mut stage, BRIGHTNESS);
    assert!(stage.picture() == ours, "another brightness does not show in its first frame");
}

#[test]
fn it_is_the_sky_that_the_game_says() {
    let mut stage = stage(SETTINGS, false, |_| {});
    let none = stage.settled_picture();
    assert_eq!(none.mean_luminance(), 0.0);
    set(&mut stage, BRIGHTNESS);
    let all = stage.settled_picture();
    let share = |stage: &mut Stage| colour(&stage.picture()) / colour(&all);
    let near = |found: Vec3, expected: Vec3| assert!((found - expected).abs().max_element() < 1e-3, "{found}");

    // The camera's own, whose brightness a game sets in place, down to none.
    let color = Color::linear_rgb(1.0, 0.5, 0.25);
    put(&mut stage, AmbientLight { color, brightness: 0.5 * BRIGHTNESS, ..default() });
    near(share(&mut stage), Vec3::new(0.5, 0.25, 0.125));
    near(share(&mut stage), Vec3::new(0.5, 0.25, 0.125));
    let camera = stage.only::<Camera3d>();
    for (tint, expected) in
        [(Color::linear_rgb(0.0, 0.2, 1.0), Vec3::new(0.0, 0.1, 0.5)), (color, Vec3::new(0.5, 0.25, 0.125))]
    {
        stage.world().get_mut::<AmbientLight>(camera).expect("has one").color = tint;
        near(share(&mut stage), expected);
    }
    for (brightness, expected) in [(BRIGHTNESS, Vec3::new(1.0, 0.5, 0.25)), (0.0, Vec3::ZERO)] {
        stage.world().get_mut::<AmbientLight>(camera).expect("has one").brightness = brightness;
        near(share(&mut stage), expected);
        near(share(&mut stage), expected);
    }
    take::<AmbientLight>(&mut stage);
    near(share(&mut stage), Vec3::ONE);

    // As other skies.
    put(&mut stage, GiLight { intensity: 0.5, ..default() });
    near(share(&mut stage), Vec3::splat(0.5));
    put(&mut stage, GiLight::OFF);
    near(share(&mut stage), Vec3::ZERO);
    take::<GiLight>(&mut stage);
    stage.light_by(illumination(GiSettings { sky: 0, ..SETTINGS }));
    assert!(stage.settled_picture() == none, "ambient light without a sky");
    stage.light_by(illumination(SETTINGS));
    assert!(stage.settled_picture() == all, "a sky that is back differs");

    // Behind them.
    let mut images = stage.world().resource_mut::<Assets<Image>>();
    let white = EnvironmentMapLight::solid_color(&mut images, Color::WHITE).specular_map;
    put(&mut stage, Skybox { image: Some(white), brightness: 200.0, ..default() });
    stage.settled_picture();
    put(&mut stage, GiIsolate::Indirect);
    let by_skybox = stage.settled_picture().mean_luminance() as f32 / (ALBEDO * 200.0);
    assert!((by_skybox - 1.0).abs() < 0.03, "{by_skybox} of the light of a skybox");
}

#[test]
fn what_each_app_has_is_no_sky() {
    let lamp = |build: &mut Builder| {
        build.commands.spawn((PointLight { intensity: 20_000.0, ..default() }, Transform::from_xyz(0.5, 2.0, 0.0)));
    };
    let mut stage = stage(SETTINGS, false, lamp);
    let none = stage.settled_picture();
    assert!(none.mean_luminance() > 1.0, "{} cd/m^2 are too dark to tell", none.mean_luminance());
    stage.world().insert_resource(GlobalAmbientLight::default());
    assert!(stage.settled_picture() == none, "the default is a sky");
    set(&mut stage, GlobalAmbientLight::default().brightness + 1.0);
    assert!(stage.settled_picture() != none, "another is none");
}

#[test]
fn a_high_wall_takes_about_half() {
    /// Black, 8 m wide and 4 m high, 0.5 m beside the middle of the floor; its back, too.
    fn wall(build: &mut Builder) {
        let black = build.paint([0.0; 3]);
        build.panel(Vec3::new(-0.5, 0.0, -4.0), Vec3::Z * 8.0, Vec3::Y * 4.0, &black);
        build.panel(Vec3::new(-0.5, 0.0, 4.0), Vec3::NEG_Z * 8.0, Vec3::Y * 4.0, &black);
    }
    let middle = |more| {
        let mut stage = stage(SETTINGS, false, more);
        set(&mut stage, BRIGHTNESS);
        luminance(stage.settled_picture().at(24, 16)) as f32
    };
    let (half_width, height, distance) = (4.0_f32, 4.0_f32, 0.5_f32);
    let top = height.hypot(distance);
    // Howell, configuration factor B-4, twice.
    let form_factor = ((half_width / distance).atan() - distance / top * (half_width / top).atan()) / PI;
    let found = middle(wall) / middle(|_| {});
    println!("{found} of the light beside a wall, expected {}", 1.0 - form_factor);
    assert!((found / (1.0 - form_factor) - 1.0).abs() < 0.05, "{found}, expected {}", 1.0 - form_factor);
    assert!(form_factor > 0.4, "the wall takes too little to tell");
}

#[test]
fn none_in_a_closed_room() {
    for forward in [false, true] {
        let light = |more| {
            let mut stage = stage(GiSettings { probes: 12, ..SETTINGS }, forward, more);
            set(&mut stage, BRIGHTNESS);
            stage.settled_picture();
            stage.settled_picture().mean_luminance()
        };
        let inside = light(closed_room) / light(|_| {});
        println!("{inside} of the light in a closed room, forward: {forward}");
        assert!(inside < 0.01, "{inside} of the light, forward: {forward}");
    }
}

/// As fine as light probes are, on the middle of the floor.
#[test]
fn a_forward_app_has_it_too() {
    let mut stage = stage(GiSettings { probes: 16, ..SETTINGS }, true, |_| {});
    set(&mut stage, BRIGHTNESS);
    stage.settled_picture();
    let ours = luminance(stage.settled_picture().at(24, 16));
    stage.light_by(without_technique());
    let bevys = luminance(stage.settled_picture().at(24, 16));
    println!("{ours} cd/m^2, {bevys} by Bevy");
    assert!((ours / bevys - 1.0).abs() < 0.1, "{ours} cd/m^2, {bevys} by Bevy");
}

/// Dielectrics and metals mirror of ambient light what Bevy has them mirror, as far as the sky is seen.
#[test]
fn what_is_mirrored_is_bevys_too() {
    let shine = |stage: &mut Stage, metallic: f32, perceptual_roughness: f32| {
        for (_, material) in stage.world().resource_mut::<Assets<StandardMaterial>>().iter_mut() {
            *material = StandardMaterial { metallic, perceptual_roughness, reflectance: 0.5, ..material.clone() };
        }
    };
    let mut open = stage(SETTINGS, false, |_| {});
    let mut closed = stage(SETTINGS, false, closed_room);
    for stage in [&mut open, &mut closed] {
        set(stage, BRIGHTNESS);
    }
    for (metallic, roughness) in [(0.0, 0.5), (1.0, 1.0), (1.0, 0.3)] {
        shine(&mut open, metallic, roughness);
        shine(&mut closed, metallic, roughness);
        open.light_by(illumination(SETTINGS));
        let ours = open.settled_picture();
        open.light_by(without_technique());
        let bevys = open.settled_picture();
        let inside = closed.settled_picture().mean_luminance() / bevys.mean_luminance();
        println!(
            "metallic {metallic}: {} cd/m^2, {} by Bevy, {inside} in a closed room",
            colour(&ours),
            colour(&bevys)
        );
        // At the picture's ends not all of the sky's directions are near.
        assert_alike(&without_ends(&ours), &without_ends(&bevys), 0.03);
        let mean = ours.mean_luminance() / bevys.mean_luminance();
        assert!((mean - 1.0).abs() < 0.01, "{mean} of what Bevy mirrors");
        assert!(inside < 0.01, "{inside} of the light in a closed room");
    }
}

/// A reflection probe that the camera sees, and that holds no surface, takes nothing of what is mirrored.
#[test]
fn a_reflection_probe_in_view_leaves_ambient_light_alone() {
    let mut stage = stage(SETTINGS, false, |_| {});
    for (_, material) in stage.world().resource_mut::<Assets<StandardMaterial>>().iter_mut() {
        *material = StandardMaterial { metallic: 1.0, perceptual_roughness: 0.5, ..material.clone() };
    }
    set(&mut stage, BRIGHTNESS);
    let without = stage.settled_picture();
    assert!(without.mean_luminance() > 100.0, "{} cd/m^2 are too dark to tell", without.mean_luminance());
    let mut images = stage.world().resource_mut::<Assets<Image>>();
    let map = EnvironmentMapLight { intensity: 500.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) };
    let place = Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(0.3));
    let probe = stage.world().spawn((LightProbe::default(), map, place)).id();
    assert_alike(&stage.settled_picture(), &without, 0.01);
    stage.world().despawn(probe);
    assert_alike(&stage.picture(), &without, 0.01);
}
