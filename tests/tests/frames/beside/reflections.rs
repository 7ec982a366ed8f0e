//! Bounced light beside Bevy's screen-space reflections: what they show is counted once.

use std::ops::Range;

use bevy::asset::RenderAssetUsages;
use bevy::pbr::ScreenSpaceReflections;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy_bounce::{GiIsolate, GiSettings, GlobalIllumination, RadianceCacheSettings, Technique, VoxelizedMesh};
use bevy_bounce_examples::scenes::{Builder, Walls};
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};

use super::{EXPOSURE, SIZE};

/// A closed room with a ball of metal before the camera, and a floor that may be of metal, too.
fn polished_room(mut build: Builder) {
    let white = build.paint([0.7; 3]);
    let red = build.paint([0.7, 0.2, 0.2]);
    let [ceiling, back, front, right] = std::array::from_fn(|_| white.clone());
    let floor = build.paint([0.8; 3]);
    build.commands.insert_resource(Polished(floor.clone()));
    let walls = Walls { floor, ceiling, back, front, left: red, right };
    build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &walls);
    let metal = build.materials.add(metal(0.3));
    build.place(Sphere::new(0.4), Transform::from_xyz(0.0, -0.2, -0.3), &metal);
    build.commands.insert_resource(Ball(metal));
    build
        .commands
        .spawn((PointLight { intensity: 100_000.0, range: 30.0, ..default() }, Transform::from_xyz(0.6, 1.0, 0.6)));
    build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
}

fn metal(roughness: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::linear_rgb(0.8, 0.8, 0.8),
        metallic: 1.0,
        perceptual_roughness: roughness,
        ..default()
    }
}

/// Paint of the ball.
#[derive(Resource)]
struct Ball(Handle<StandardMaterial>);

/// Paint of the floor.
#[derive(Resource)]
struct Polished(Handle<StandardMaterial>);

fn polished_stage() -> Stage {
    Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, polished_room);
    })
}

fn paint(stage: &mut Stage, paint: &Handle<StandardMaterial>, material: StandardMaterial) {
    stage.world().resource_mut::<Assets<StandardMaterial>>().insert(paint, material).expect("is there");
}

/// Mean light of parts of the picture, columns and rows, by caches and, where asked for, Bevy's reflections.
fn parts<const N: usize>(
    stage: &mut Stage,
    isolate: GiIsolate,
    reflections: bool,
    towards: Vec3,
    parts: [(Range<usize>, Range<usize>); N],
) -> [f64; N] {
    let radiance_cache = RadianceCacheSettings { glossy: true, ..default() };
    let light = illumination(GiSettings { grid: 64, radiance_cache, ..SMALL });
    let place = Transform::from_xyz(0.0, 0.0, 1.3).looking_at(towards, Vec3::Y);
    let eye = Eye::open(stage, SIZE, EXPOSURE, (place, light, isolate));
    if reflections {
        // On mirrors, too.
        let reflections = ScreenSpaceReflections { min_perceptual_roughness: 0.0..0.0, ..default() };
        stage.world().entity_mut(eye.camera).insert(reflections);
    }
    (0..4).for_each(|_| stage.frame(std::time::Duration::ZERO));
    let mut means = [0.0; N];
    // Bevy's reflections are a ray a pixel, another one each frame.
    let frames = if reflections { 8.0 } else { 1.0 };
    for _ in 0..frames as usize {
        stage.frame(std::time::Duration::ZERO);
        let picture = eye.picture(stage);
        assert_eq!(picture.nonfinite(), 0);
        for (mean, (x, y)) in means.iter_mut().zip(&parts) {
            *mean += picture.mean_of(x.clone(), y.clone())[1] / frames;
        }
    }
    eye.close(stage);
    means
}

/// However smooth a metal is, it has about the same light with Bevy's reflections as by caches alone: nothing twice, and no seam where
/// reflections fade or meet nothing, which is most of a ball's front.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn reflections_and_caches_share_the_light() {
    let mut stage = polished_stage();
    let ball = stage.world().resource::<Ball>().0.clone();
    const BALL: Vec3 = Vec3::new(0.0, -0.2, -0.3);
    let quarters = [0, 1, 2, 3].map(|i| (25 + 7 * (i % 2), 11 + 7 * (i / 2))).map(|(x, y)| (x..x + 7, y..y + 7));
    for roughness in [0.1, 0.3, 0.57] {
        paint(&mut stage, &ball, metal(roughness));
        let mut light = |reflections| parts(&mut stage, GiIsolate::All, reflections, BALL, quarters.clone());
        let (by_caches, with) = (light(false), light(true));
        let ratios: [f64; 4] = std::array::from_fn(|i| with[i] / by_caches[i]);
        println!("roughness {roughness}: by caches {by_caches:.2?}, with reflections {ratios:.2?} of it");
        assert!(ratios.iter().all(|ratio| (0.9..1.1).contains(ratio)), "roughness {roughness}: {ratios:?}");
    }
}

/// Where Bevy's reflections do meet something, on a floor of metal, caches leave them its light, and it is about what caches show there.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn what_reflections_meet_is_theirs() {
    let mut stage = polished_stage();
    let floor = stage.world().resource::<Polished>().0.clone();
    paint(&mut stage, &floor, metal(0.2));
    let before_the_wall = [(6..26, 13..18), (38..58, 13..18)];
    let mut light = |isolate, reflections| {
        parts(&mut stage, isolate, reflections, Vec3::new(0.0, -1.5, -0.7), before_the_wall.clone())
    };
    let [by_caches, left] = [false, true].map(|reflections| light(GiIsolate::Glossy, reflections));
    let [whole, with] = [false, true].map(|reflections| light(GiIsolate::All, reflections));
    for i in 0..2 {
        let (left, with) = (left[i] / by_caches[i], with[i] / whole[i]);
        println!("caches keep {left:.2} of their light; with reflections {with:.2} of that without");
        assert!(left < 0.5, "reflections meet the wall, and caches keep {left}");
        // Caches show the wall's foot blurred, and darker than it is; both at once would be twice as much and more.
        assert!((0.6..1.6).contains(&with), "{with} of the light");
    }
}

/// A closed room of walls that shine alike, with a floor of white metal that goes from polished to matt.
fn shining_room(mut build: Builder, mut images: ResMut<Assets<Image>>) {
    let emission = EMITTED * EXPOSURE.exposure();
    let wall = build.materials.add(StandardMaterial {
        base_color: Color::BLACK,
        reflectance: 0.0,
        emissive: LinearRgba::rgb(emission, emission, emission),
        ..default()
    });
    let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| wall.clone());
    build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &Walls { floor, ceiling, back, front, left, right });
    // Green is roughness, blue is metal.
    let texels = (0..=u8::MAX).flat_map(|x| [0, (f32::from(x) * 0.7) as u8, u8::MAX, u8::MAX]).collect();
    let size = Extent3d { width: 256, height: 1, depth_or_array_layers: 1 };
    let usage = RenderAssetUsages::RENDER_WORLD;
    let ramp = images.add(Image::new(size, TextureDimension::D2, texels, TextureFormat::Rgba8Unorm, usage));
    let floor = build.materials.add(StandardMaterial {
        base_color: Color::WHITE,
        metallic_roughness_texture: Some(ramp),
        ..metal(1.0)
    });
    let black = VoxelizedMesh { albedo: Some(Color::BLACK), ..default() };
    build.place(Plane3d::default().mesh().size(3.0, 3.0), Transform::from_xyz(0.0, -1.4, 0.0), &floor).insert(black);
    build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
}

/// Of the walls of [`shining_room`], cd/m^2.
const EMITTED: f32 = 20.0;

/// Where light is the same from everywhere, a mirror shows it as matt metal does: there is no seam where Bevy's reflections begin and end
/// by roughness, nor where they leave the picture, and none of the light is shown twice or lost. Bevy's reflections draw from GGX itself,
/// while what bounces in the relief of metal stays by Bevy's approximation of it: together up to a tenth too much.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn reflections_have_no_seam() {
    const COLUMNS: usize = 8;
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, shining_room);
    });
    let columns: [(Range<usize>, Range<usize>); COLUMNS] = std::array::from_fn(|i| (8 * i..8 * i + 8, 13..19));
    let towards = Vec3::new(0.0, -1.5, -0.7);
    for (reflections, most) in [(false, 0.05), (true, 0.12)] {
        let light = parts(&mut stage, GiIsolate::All, reflections, towards, columns.clone());
        let light = light.map(|light| light / f64::from(EMITTED));
        println!("reflections {reflections}: {light:.3?} of the light");
        assert!(light.iter().all(|light| (light - 1.0).abs() < most), "reflections {reflections}: {light:?}");
    }
    let [whole, left] = [false, true]
        .map(|reflections| parts(&mut stage, GiIsolate::Glossy, reflections, towards, [(24..40, 13..19)])[0]);
    assert!(left < 0.5 * whole, "reflections meet nothing: caches keep {left} of {whole}");
}

/// Under a sky that bounces, what reflections show of a black wall is black: no sky is mirrored there beside it.
#[test]
fn reflections_hide_the_sky() {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let (metal, black) = (build.materials.add(metal(0.2)), build.paint([0.0; 3]));
            build.place(Cuboid::new(6.0, 0.2, 6.0), Transform::from_xyz(0.0, -0.1, 0.0), &metal);
            build.place(Cuboid::new(6.0, 3.0, 0.2), Transform::from_xyz(0.0, 1.5, -1.6), &black);
            build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
        });
    });
    let radiance_cache = RadianceCacheSettings { glossy: true, ..default() };
    let mut floor = |glossy: bool, isolate: GiIsolate, reflections: bool| {
        let settings = if glossy { GiSettings { radiance_cache, ..SMALL } } else { SMALL };
        // The foot of the wall is in the picture's upper half, and its middle below the upper edge.
        let place = Transform::from_xyz(0.0, 1.5, 1.4).looking_at(Vec3::new(0.0, 0.0, -0.7), Vec3::Y);
        let sky = {
            let mut images = stage.world().resource_mut::<Assets<Image>>();
            EnvironmentMapLight { intensity: 1000.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) }
        };
        let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (place, illumination(settings), sky, isolate));
        if reflections {
            stage.world().entity_mut(eye.camera).insert(ScreenSpaceReflections::default());
        }
        eye.settle(&mut stage);
        let mean = eye.picture(&stage).mean_of(20..44, 13..18)[1];
        eye.close(&mut stage);
        mean
    };
    // Beside caches without bounced light: what bounces in the relief of metal is not mirrored, and stays.
    for (glossy, isolate) in [(false, GiIsolate::All), (true, GiIsolate::Direct)] {
        let (without, with) = (floor(glossy, isolate, false), floor(glossy, isolate, true));
        println!("glossy {glossy}, {isolate:?}: {with:.2} with reflections, {without:.2} without");
        assert!(with < 0.3 * without && without > 0.0, "glossy {glossy}, {isolate:?}: {with} of {without}");
    }
}

/// Under a sky that bounces, what metal mirrors of it is there once beside Bevy's reflections, whatever the technique.
#[test]
fn the_sky_is_mirrored_once_beside_reflections() {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let metal = build.materials.add(metal(0.3));
            build.place(Sphere::new(0.7), Transform::IDENTITY, &metal);
            let white = build.paint([0.7; 3]);
            build.place(Cuboid::new(4.0, 0.2, 4.0), Transform::from_xyz(0.0, -1.5, 0.0), &white);
            build.commands.spawn((Camera3d::default(), Camera { is_active: false, ..default() }));
        });
    });
    for technique in [Technique::InstantRadiosity, Technique::RadianceCache] {
        let mut light = |reflections: bool| {
            let place = Transform::from_xyz(0.0, 0.0, 2.0).looking_at(Vec3::ZERO, Vec3::Y);
            let sky = {
                let mut images = stage.world().resource_mut::<Assets<Image>>();
                EnvironmentMapLight { intensity: 1000.0, ..EnvironmentMapLight::solid_color(&mut images, Color::WHITE) }
            };
            let light = GlobalIllumination { technique, ..illumination(SMALL) };
            let eye = Eye::open(&mut stage, SIZE, EXPOSURE, (place, light, sky, GiIsolate::All));
            if reflections {
                stage.world().entity_mut(eye.camera).insert(ScreenSpaceReflections::default());
            }
            eye.settle(&mut stage);
            let mean = eye.picture(&stage).mean_of(28..36, 14..22)[1];
            eye.close(&mut stage);
            mean
        };
        let (without, with) = (light(false), light(true));
        println!("{technique:?}: {with:.1} with reflections, {without:.1} without");
        assert!(without > 0.0 && (with / without - 1.0).abs() < 0.05, "{technique:?}: {with}, {without}");
    }
}
