//! Light from the sky: the directions that stand for it, and what falls into a scene, against closed forms.

use std::f32::consts::PI;

use bevy::ecs::system::RunSystemOnce;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy_bounce::{GiIsolate, GiLight, GiSettings, GlobalIllumination, Quality, Resolution, Technique};
use bevy_bounce_examples::scenes::{Builder, Walls};
use bevy_bounce_shaders::types::{LIGHT_DIRECTIONAL, Light, SKY_EDGE, Scene, Sky};
use bevy_bounce_tests::compose::compose;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::scene::regions;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};
use bevy_bounce_tests::twins::random::Random;
use half::f16;

/// Edge of the faces of the tested map.
const FACE: u32 = 16;
const BOUNDS: Vec3 = Vec3::new(2.0, 3.0, 5.0);

/// Table and lights of a map of that radiance: of `count` directions, behind one light of Bevy's.
fn chosen(count: u32, sky: Sky, radiance: impl Fn(Vec3) -> Vec3) -> (Vec<Vec4>, Vec<Light>) {
    let mut texels = Vec::new();
    for face in 0..6 {
        for y in 0..FACE {
            for x in 0..FACE {
                let [s, t] = [x, y].map(|i| (i as f32 + 0.5) / FACE as f32 * 2.0 - 1.0);
                // WebGPU's cube maps, whose z points the other way than the world's.
                let way = match face {
                    0 => Vec3::new(1.0, -t, -s),
                    1 => Vec3::new(-1.0, -t, s),
                    2 => Vec3::new(s, 1.0, t),
                    3 => Vec3::new(s, -1.0, -t),
                    4 => Vec3::new(s, -t, 1.0),
                    _ => Vec3::new(-s, -t, -1.0),
                };
                let color = radiance(way.normalize() * Vec3::new(1.0, 1.0, -1.0)).extend(1.0);
                texels.extend(color.to_array().map(|channel| f16::from_f32(channel).to_le_bytes()).concat());
            }
        }
    }
    let gpu = gpu();
    let composed = compose("scene/sky.wgsl", &[]).expect("composes");
    let regions = regions(&[(Vec3::ZERO, BOUNDS)]);
    let scene =
        Scene { light_count: 1, sky_count: count, bounds_max: BOUNDS, regions, region_count: 1, ..Default::default() };
    let resources = Resources::new(gpu)
        .uniform("sky", &Sky { samples: 4, ..sky })
        .uniform("scene", &scene)
        .structs("table", &vec![Vec4::ZERO; (SKY_EDGE * SKY_EDGE) as usize])
        .structs("lights", &vec![Light { range: 7.0, ..Default::default() }; 1 + count as usize])
        .cube("map", wgpu::TextureFormat::Rgba16Float, FACE, &texels)
        .sampler("map_sampler", wgpu::FilterMode::Linear);
    for (entry, groups) in [("measure", SKY_EDGE * SKY_EDGE), ("choose", 1)] {
        let kernel = gpu.kernel(&composed, entry).expect("compiles");
        gpu.dispatch(&kernel, &resources, [groups, 1, 1]).expect("runs");
    }
    let lights: Vec<Light> = resources.read_structs("lights").expect("is a buffer");
    assert_eq!(lights[0], Light { range: 7.0, ..Default::default() }, "a light of Bevy's was overwritten");
    (resources.read_structs("table").expect("is a buffer"), lights[1..].to_vec())
}

fn plain() -> Sky {
    Sky { rotation: Vec4::W, radiance: Vec3::ONE, samples: 0, max_bounces: 5, share: 1.0 }
}

/// Irradiance on a surface that nothing shadows, lux.
fn irradiance(lights: &[Light], normal: Vec3) -> Vec3 {
    lights.iter().map(|light| light.color * (-light.direction).dot(normal).max(0.0)).sum()
}

#[test]
fn an_even_sky_lights_all_sides_alike() {
    let radiance = Vec3::new(3.0, 2.0, 1.0);
    for count in [16, 64, 256] {
        let (table, lights) = chosen(count, Sky { radiance: Vec3::splat(10.0), ..plain() }, |_| radiance);
        let sphere: f32 = table.iter().map(|texel| texel.w).sum();
        assert!((sphere / (4.0 * PI) - 1.0).abs() < 1e-3, "the sphere has {sphere} sr");
        assert!(table.iter().all(|texel| (texel.truncate() / 10.0 - radiance).abs().max_element() < 0.01));
        let mut random = Random::new(7);
        for _ in 0..50 {
            let normal = random.direction();
            let found = irradiance(&lights, normal) / (PI * 10.0 * radiance);
            // A hemisphere holds half the directions.
            assert!((found - 1.0).abs().max_element() < 1.6 / (count as f32).sqrt(), "{count}, {normal}: {found}");
        }
        let mut power = 0.0;
        for light in &lights {
            assert_eq!((light.kind, light.max_bounces), (LIGHT_DIRECTIONAL, 5));
            let area = (light.direction.abs() * BOUNDS.yzx() * BOUNDS.zxy()).element_sum();
            power += luminance(light.color.to_array()) as f32 * area;
            assert!((light.cumulative_power / power - 1.0).abs() < 1e-4);
        }
    }
}

#[test]
fn directions_are_where_the_light_is() {
    let lamp = Vec3::new(0.6, 0.64, -0.48);
    let radiance = |way: Vec3| if way.dot(lamp) > 0.9 { Vec3::new(8.0, 6.0, 4.0) } else { Vec3::splat(0.01) };
    let (_, lights) = chosen(64, plain(), radiance);
    let towards = |lights: &[Light], lamp: Vec3| lights.iter().filter(|light| -light.direction.dot(lamp) > 0.8).count();
    // Three quarters of them, and their part of those that are spread evenly.
    assert!(towards(&lights, lamp) > 45, "{} of 64 directions", towards(&lights, lamp));
    // A cap of the sphere: pi sin^2 of its radius.
    let expected = Vec3::new(8.0, 6.0, 4.0) * PI * (1.0 - 0.81);
    let found = irradiance(&lights, lamp) / expected;
    assert!((found - 1.0).abs().max_element() < 0.08, "{found} of the light");
    // What looks away from the lamp has its part of the sky, too.
    let mut random = Random::new(9);
    for _ in 0..50 {
        let normal = random.direction();
        let faced = lights.iter().filter(|light| -light.direction.dot(normal) > 0.2).count();
        assert!(faced > 2, "{normal} faces {faced} of 64 directions");
    }
    let away = irradiance(&lights, -lamp).x / (0.01 * PI);
    assert!((away - 1.0).abs() < 0.4, "{away} of the light on what looks away from the lamp");
    // Turned, as Bevy turns it.
    let turn = Quat::from_rotation_y(0.9);
    let (_, lights) = chosen(64, Sky { rotation: turn.inverse().into(), ..plain() }, radiance);
    assert!(
        towards(&lights, turn * lamp) > 45,
        "{} of 64 directions of a sky that is turned",
        towards(&lights, turn * lamp)
    );
    assert!(irradiance(&chosen(64, plain(), |_| Vec3::ZERO).1, Vec3::Y) == Vec3::ZERO, "a black sky shines");
}

const SIZE: UVec2 = UVec2::new(48, 32);
const RADIANCE: f32 = 200.0;
const ALBEDO: f32 = 0.6;
const SKY: GiSettings = GiSettings { grid: 48, sky: 256, ..SMALL };

fn even_sky(images: &mut Assets<Image>) -> EnvironmentMapLight {
    EnvironmentMapLight { intensity: RADIANCE, ..EnvironmentMapLight::solid_color(images, Color::WHITE) }
}

/// A floor 8 m square in the x-z-plane, seen from above, with what else `more` builds.
fn stage(settings: GiSettings, more: fn(&mut Builder)) -> Stage {
    Stage::new(SIZE, settings, move |app| {
        app.add_systems(Startup, move |mut build: Builder, mut images: ResMut<Assets<Image>>| {
            let paint = build.paint([ALBEDO; 3]);
            build.panel(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, &paint);
            more(&mut build);
            let sky = even_sky(&mut images);
            let eye = Transform::from_xyz(0.0, 3.0, 0.0).looking_at(Vec3::ZERO, Vec3::NEG_Z);
            build.commands.spawn((Camera3d::default(), sky, eye));
        });
    })
}

fn at(picture: &Picture, x: usize, y: usize) -> f32 {
    luminance(picture.pixels[y * picture.width + x]) as f32
}

#[test]
fn an_open_floor_has_all_of_the_sky() {
    let mut stage = stage(SKY, |_| {});
    let first = stage.settled_picture();
    let lit = ALBEDO * RADIANCE;
    for pixel in &first.pixels {
        assert!((luminance(*pixel) as f32 / lit - 1.0).abs() < 0.03, "{pixel:?}, expected {lit}");
    }

    // Its light follows every change in that frame.
    let camera = stage.only::<Camera3d>();
    let mean = |picture: Picture| picture.mean_luminance() / first.mean_luminance();
    stage.world().entity_mut(camera).insert(GiLight { intensity: 0.5, ..default() });
    assert!((mean(stage.picture()) - 0.5).abs() < 1e-3);
    stage.world().entity_mut(camera).insert(GiLight::OFF);
    assert_eq!(mean(stage.picture()), 0.0, "what is left to Bevy is not bounced light");
    stage.world().entity_mut(camera).remove::<GiLight>();
    assert!(first == stage.picture(), "a sky that is back differs");
    stage.light_by(illumination(GiSettings { sky: 0, ..SKY }));
    assert_eq!(mean(stage.settled_picture()), 0.0);
    stage.light_by(illumination(SKY));
    assert!(first == stage.settled_picture(), "a setting left something behind");

    // A skybox is a sky as well, where there is no environment map.
    let map = stage.world().entity_mut(camera).take::<EnvironmentMapLight>().expect("has one");
    assert_eq!(mean(stage.picture()), 0.0);
    let skybox = Skybox { image: Some(map.specular_map.clone()), brightness: RADIANCE, ..default() };
    stage.world().entity_mut(camera).insert(skybox);
    assert!(first == stage.settled_picture(), "a skybox lights otherwise than an environment map");
}

#[test]
fn a_wall_takes_its_part_of_the_sky() {
    let mut stage = stage(SKY, black_wall);
    let picture = stage.settled_picture();
    let (half_width, height, distance) = (4.0_f32, 2.0_f32, 1.0_f32);
    let top = height.hypot(distance);
    // Of a point to a rectangle perpendicular to its surface. Howell, configuration factor B-4, twice.
    let form_factor = ((half_width / distance).atan() - distance / top * (half_width / top).atan()) / PI;
    let expected = ALBEDO * RADIANCE * (1.0 - form_factor);
    let found = at(&picture, 24, 16);
    assert!((found / expected - 1.0).abs() < 0.04, "{found} cd/m^2, expected {expected}");
    assert!(form_factor > 0.15, "the wall takes too little to tell");
}

/// Around the floor, with a shell outside: what looks inwards lets the sky in.
pub fn closed_room(build: &mut Builder) {
    let white = build.paint([ALBEDO; 3]);
    let paints = Walls {
        floor: white.clone(),
        ceiling: white.clone(),
        back: white.clone(),
        front: white.clone(),
        left: white.clone(),
        right: white,
    };
    build.room(Vec3::new(-4.0, 0.0, -4.0), Vec3::new(4.0, 4.0, 4.0), &paints);
    let shell = build.paint([ALBEDO; 3]);
    build.block(Vec3::new(0.0, -0.1, 0.0), Vec3::new(8.2, 4.2, 8.2), 0.0, &shell);
}

#[test]
fn no_sky_in_a_closed_room_and_its_bounces_in_an_open_one() {
    let room = |build: &mut Builder, height: f32| {
        let white = build.paint([ALBEDO; 3]);
        for (corner, u, v) in [
            (Vec3::new(-4.0, 0.0, -4.0), Vec3::X * 8.0, Vec3::Y * height),
            (Vec3::new(4.0, 0.0, 4.0), Vec3::NEG_X * 8.0, Vec3::Y * height),
            (Vec3::new(-4.0, 0.0, 4.0), Vec3::NEG_Z * 8.0, Vec3::Y * height),
            (Vec3::new(4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::Y * height),
        ] {
            build.panel(corner, u, v, &white);
        }
    };
    let mut closed = stage(SKY, closed_room);
    let inside = closed.settled_picture().mean_luminance() / f64::from(ALBEDO * RADIANCE);
    assert!(inside < 0.005, "{inside} of the sky's light is in a closed room");

    // Four walls without a roof: what the open top sends is reflected between them.
    let one = |bounces| {
        let mut stage = stage(GiSettings { bounces, ..SKY }, move |_| {});
        stage.world().run_system_once(move |mut build: Builder| room(&mut build, 4.0)).expect("runs");
        stage.settled_picture().mean_luminance()
    };
    let (single, many) = (one(1), one(8));
    assert!(many > 1.05 * single, "{single} with one bounce, {many} with eight");
}

#[test]
fn caches_see_the_sky_too() {
    let mut stage = stage(SKY, |_| {});
    let by_lights = stage.settled_picture().mean_luminance();
    stage.light_by(GlobalIllumination {
        technique: Technique::RadianceCache,
        quality: Quality::Custom(SKY),
        ..default()
    });
    let by_caches = stage.settled_picture().mean_luminance();
    assert!((by_caches / by_lights - 1.0).abs() < 0.06, "{by_caches} cd/m^2, by rays {by_lights}");
}

/// The floor as dull metal, and only what it mirrors of the sky.
fn mirrored(perceptual_roughness: f32, settings: GiSettings, more: fn(&mut Builder)) -> Stage {
    let mut stage = stage(settings, more);
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(GiIsolate::Direct);
    for (_, material) in stage.world().resource_mut::<Assets<StandardMaterial>>().iter_mut() {
        if material.base_color.to_linear().red > 0.0 {
            *material = StandardMaterial { metallic: 1.0, perceptual_roughness, ..material.clone() };
        }
    }
    stage
}

/// 8 m wide and 2 m high, 1 m beside the middle of the floor; its back, too.
fn black_wall(build: &mut Builder) {
    let black = build.paint([0.0; 3]);
    build.panel(Vec3::new(-1.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::Y * 2.0, &black);
    build.panel(Vec3::new(-1.0, 0.0, 4.0), Vec3::NEG_Z * 8.0, Vec3::Y * 2.0, &black);
}

/// Share of a lobe cos^power about a floor's normal that goes past the black wall, from the middle of the floor.
fn past_the_wall(power: i32) -> f64 {
    let (mut past, mut all) = (0.0, 0.0);
    let steps = 400;
    for i in 0..steps {
        for k in 0..4 * steps {
            let (polar, turn) = ((f64::from(i) + 0.5) / f64::from(steps), f64::from(k) / f64::from(2 * steps));
            let (sin, cos) = (polar * f64::from(PI) / 2.0).sin_cos();
            let way = [sin * (turn * f64::from(PI)).cos(), cos, sin * (turn * f64::from(PI)).sin()];
            // Where it comes through the wall's plane, 1 m towards -x.
            let (up, aside) = (-way[1] / way[0], -way[2] / way[0]);
            let weight = cos.powi(power) * sin;
            all += weight;
            past += if way[0] < 0.0 && up < 2.0 && aside.abs() < 4.0 { 0.0 } else { weight };
        }
    }
    past / all
}

#[test]
fn what_is_mirrored_of_the_sky_is_shadowed() {
    let by_bevy = mirrored(0.7, GiSettings { sky: 0, ..SKY }, |_| {}).settled_picture();
    let open = mirrored(0.7, SKY, |_| {}).settled_picture();
    assert!(by_bevy.mean_luminance() > 0.2 * f64::from(RADIANCE), "{by_bevy:?} mirrors nothing");
    // At the picture's ends not all of the sky's directions are near.
    let (ends, width, height) = (4, open.width, open.height);
    for (x, y) in (ends..height - ends).flat_map(|y| (ends..width - ends).map(move |x| (x, y))) {
        let ratio = at(&open, x, y) / at(&by_bevy, x, y);
        assert!((ratio - 1.0).abs() < 0.01, "{ratio} of what an open floor mirrors by Bevy, at {x}, {y}");
    }
    let mean = open.mean_luminance() / by_bevy.mean_luminance();
    assert!((mean - 1.0).abs() < 0.005, "{mean} of what an open floor mirrors by Bevy");
    for (roughness, power) in [(1.0, 1), (0.7, 6), (0.3, 6)] {
        let open = if roughness == 0.7 { open.clone() } else { mirrored(roughness, SKY, |_| {}).settled_picture() };
        let beside = mirrored(roughness, SKY, black_wall).settled_picture();
        let (found, expected) = (at(&beside, 24, 16) / at(&open, 24, 16), past_the_wall(power));
        println!("roughness {roughness}: {found:.4} of the lobe goes past the wall, {expected:.4} by quadrature");
        assert!((f64::from(found) / expected - 1.0).abs() < 0.04, "{found}, expected {expected}");
        assert!(expected < 0.97, "the wall takes too little to tell");
    }
    let half = GiSettings { resolution: Resolution::Half, ..SKY };
    let mut closed = mirrored(0.7, half, closed_room);
    let inside = closed.settled_picture().mean_luminance() / open.mean_luminance();
    assert!(inside < 0.005, "{inside} of the sky is mirrored in a closed room");
    // Gone and back with the sky.
    closed.light_by(illumination(GiSettings { sky: 0, ..half }));
    let unshadowed = closed.settled_picture().mean_luminance() / open.mean_luminance();
    assert!(unshadowed > 0.5, "{unshadowed}: Bevy's light by environment maps is lost without a sky of ours");
    closed.light_by(illumination(half));
    assert!(closed.settled_picture().mean_luminance() / open.mean_luminance() < 0.005);
}
