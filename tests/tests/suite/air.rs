//! Light through Bevy's atmosphere: what bounces of a sun beside what Bevy shows of it directly, and the sky that it makes.

use bevy::light::atmosphere::ScatteringMedium;
use bevy::light::{Atmosphere, AtmosphereEnvironmentMapLight};
use bevy::pbr::AtmosphereSettings;
use bevy::prelude::*;
use bevy::shader::Source;
use bevy_bounce::{GiIsolate, GiLight, GiSettings};
use bevy_bounce_examples::scenes::Builder;
use bevy_bounce_tests::gpu::webgpu_limits;
use bevy_bounce_tests::stage::{SMALL, Stage};

const SIZE: UVec2 = UVec2::new(48, 32);
/// Pixels of the floor, and of the wall: columns, then rows.
const FLOOR: [std::ops::Range<usize>; 2] = [8..40, 24..30];
const WALL: [std::ops::Range<usize>; 2] = [8..40, 4..20];
const ALBEDO: f32 = 0.8;
/// Of the planet in the world: a unit is a centimetre, so that there is next to no air between scene and camera.
const SCALE: f32 = 100.0;

/// Lines of the shaders of Bevy's atmosphere that crash Mesa 22.3's software driver, and what stands there instead: nothing that a
/// condition depends on may come from the fourth uniform buffer of a shader, here the view. It keeps a list of such values in a table
/// with room for four a buffer, and writes as if there were 32. Without them Bevy's atmosphere is that of a camera at the origin,
/// there is no air before surfaces, and the sky behind them has a single colour.
const CHANGES: [(&str, &str); 3] = [
    ("vec4(view.world_position, 1.0)", "vec4(0.0, 0.0, 0.0, 1.0)"),
    ("uv_to_ray_direction(in.uv);", "vec3(0.0, 1.0, 0.0);"),
    ("ndc_to_camera_dist(vec3(uv_to_ndc(in.uv), depth));", "0.0;"),
];

fn change_shaders(mut events: MessageReader<AssetEvent<Shader>>, mut shaders: ResMut<Assets<Shader>>) {
    for event in events.read() {
        let AssetEvent::Added { id } = *event else { continue };
        if !shaders.get(id).is_some_and(|shader| shader.path.contains("bevy_pbr/atmosphere/")) {
            continue;
        }
        let Some(mut shader) = shaders.get_mut(id) else { continue };
        let text = CHANGES.iter().fold(shader.source.as_str().to_owned(), |text, (from, to)| text.replace(from, to));
        shader.source = Source::Wgsl(text.into());
    }
}

/// Towards the sun.
fn sun(degrees: f32) -> Transform {
    let (sin, cos) = degrees.to_radians().sin_cos();
    Transform::default().looking_to(Vec3::new(-cos, -sin, 0.0), Vec3::Z)
}

fn planet(medium: Handle<ScatteringMedium>) -> impl Bundle {
    let planet = Atmosphere::earth(medium);
    let place = Transform::from_xyz(0.0, -SCALE * planet.inner_radius, 0.0).with_scale(Vec3::splat(SCALE));
    (planet, GlobalTransform::from(place))
}

/// Whether Bevy's atmosphere can run: it filters textures of 32-bit floats, which WebGPU leaves to an optional feature.
fn has_atmosphere() -> bool {
    if webgpu_limits() {
        println!("without Bevy's atmosphere, which filters 32-bit floats");
    }
    !webgpu_limits()
}

/// A floor under a sun and Earth's air, seen from above its edge, with what else `more` builds.
fn stage(settings: GiSettings, more: fn(&mut Builder)) -> Stage {
    Stage::new(SIZE, settings, move |app| {
        app.add_systems(Last, change_shaders);
        app.add_systems(Startup, move |mut build: Builder, mut media: ResMut<Assets<ScatteringMedium>>| {
            let paint = build.paint([ALBEDO; 3]);
            build.panel(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0, &paint);
            more(&mut build);
            let light = DirectionalLight { illuminance: light_consts::lux::RAW_SUNLIGHT, ..default() };
            build.commands.spawn((light, sun(60.0)));
            build.commands.spawn(planet(media.add(ScatteringMedium::default())));
            let eye = Transform::from_xyz(0.0, 2.0, 3.0).looking_at(Vec3::new(0.0, 1.0, -4.0), Vec3::Y);
            build.commands.spawn((Camera3d::default(), AtmosphereSettings::default(), eye));
        });
    })
}

/// Along the way of the sun's light, which reaches it from the floor alone.
fn wall(build: &mut Builder) {
    let paint = build.paint([ALBEDO; 3]);
    build.panel(Vec3::new(-4.0, 0.0, -4.0), Vec3::X * 8.0, Vec3::Y * 4.0, &paint);
}

fn turn_sun(stage: &mut Stage, degrees: f32) {
    let light = stage.only::<DirectionalLight>();
    stage.world().entity_mut(light).insert(sun(degrees));
}

fn mean_of(stage: &mut Stage, isolate: GiIsolate, [x, y]: [std::ops::Range<usize>; 2]) -> Vec3 {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(isolate);
    stage.settled_picture().mean_of(x, y).map(|channel| channel as f32).into()
}

/// Light of the floor that Bevy shows, and what bounces from there onto the wall.
fn floor_and_wall(stage: &mut Stage, degrees: f32) -> [Vec3; 2] {
    turn_sun(stage, degrees);
    [mean_of(stage, GiIsolate::Direct, FLOOR), mean_of(stage, GiIsolate::Indirect, WALL)]
}

#[test]
fn what_bounces_of_a_sun_goes_with_its_direct_light() {
    if !has_atmosphere() {
        return;
    }
    let heights = [60.0, 20.0, 5.0];
    let mut stage = stage(GiSettings { sky: 0, ..SMALL }, wall);
    let through_air = heights.map(|degrees| floor_and_wall(&mut stage, degrees));
    let set = floor_and_wall(&mut stage, -2.0);
    println!("2 degrees below it: {set:?}");
    assert!(set[1].max_element() < 1e-4 * through_air[2][1].max_element(), "a sun below the horizon bounces");
    let planet = stage.only::<Atmosphere>();
    stage.world().despawn(planet);
    let plain = heights.map(|degrees| floor_and_wall(&mut stage, degrees));
    for (degrees, (air, plain)) in heights.iter().zip(through_air.iter().zip(&plain)) {
        let (direct, bounced) = (air[0] / plain[0], air[1] / plain[1]);
        println!("{degrees} degrees above the horizon: {direct:.4} of the direct light, {bounced:.4} of what bounces");
        assert!((bounced / direct - 1.0).abs().max_element() < 0.03, "{bounced} bounces where {direct} is seen");
        assert!(direct.z < 0.9 * direct.x && plain[1].min_element() > 0.0, "the air takes too little to tell");
    }
}

/// On an open floor, where nothing shadows Bevy's own light by environment maps either.
#[test]
fn the_sky_that_an_atmosphere_makes_is_a_sky() {
    if !has_atmosphere() {
        return;
    }
    let mut stage = stage(GiSettings { sky: 256, ..SMALL }, |_| {});
    let (camera, light) = (stage.only::<Camera3d>(), stage.only::<DirectionalLight>());
    stage.world().entity_mut(light).insert(GiLight::OFF);
    for degrees in [60.0, 5.0] {
        turn_sun(&mut stage, degrees);
        let sun = mean_of(&mut stage, GiIsolate::Direct, FLOOR);
        let map = AtmosphereEnvironmentMapLight { size: UVec2::splat(128), ..default() };
        stage.world().entity_mut(camera).insert((map, GiLight::OFF));
        // Bevy makes the map in some frames.
        stage.settled_picture();
        let by_bevy = mean_of(&mut stage, GiIsolate::Direct, FLOOR) - sun;
        stage.world().entity_mut(camera).remove::<GiLight>();
        let ours = mean_of(&mut stage, GiIsolate::Indirect, FLOOR);
        println!("{degrees} degrees above the horizon: {ours:.1} cd/m^2 of the sky, {by_bevy:.1} by Bevy");
        assert!((ours / by_bevy - 1.0).abs().max_element() < 0.05, "{ours} cd/m^2, {by_bevy} by Bevy");
        stage.world().entity_mut(camera).remove::<(AtmosphereEnvironmentMapLight, EnvironmentMapLight)>();
    }
}
