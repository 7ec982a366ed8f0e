//! A village under a sky that turns from noon to night and back: sun, sky, lamps and lit windows.

use std::f32::consts::{PI, TAU};

use bevy::camera::Exposure;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::Builder;
use super::chance::Chance;

/// Houses round a green, a sky, a sun, lamps.
pub struct VillagePlugin;

#[derive(Component)]
struct Sun;

#[derive(Component)]
struct StreetLamp;

/// What shines at night.
#[derive(Resource)]
struct Windows(Handle<StandardMaterial>);

/// Seconds from noon to noon.
const DAY: f32 = 48.0;
/// Of the clear sky at noon, cd/m^2: overhead, at the horizon; and of the ground beyond the village.
const ZENITH: Vec3 = Vec3::new(1500.0, 2800.0, 6000.0);
const HORIZON: Vec3 = Vec3::new(5200.0, 6000.0, 6800.0);
const BEYOND: Vec3 = Vec3::new(1800.0, 1900.0, 1300.0);
/// What is left of it at night.
const NIGHT: f32 = 2e-5;
/// Of the sun overhead, lux.
const SUNLIGHT: f32 = 90_000.0;
/// Of a lamp, lumens, and of a window, cd/m^2.
const LAMP: f32 = 6_000.0;
const WINDOW: f32 = 120.0;
/// Radius of the green, metres.
const GREEN: f32 = 9.0;
const HOUSES: u8 = 11;

/// Where the sun is after that many seconds: unit vector towards it.
fn sun_at(seconds: f32) -> Vec3 {
    let angle = TAU * seconds / DAY;
    Vec3::new(angle.sin(), angle.cos(), 0.35).normalize()
}

/// How much of the day there is, 0 to 1: light goes over some degrees.
fn daylight(sun: Vec3) -> f32 {
    let x = ((sun.y + 0.12) / 0.5).clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl VillagePlugin {
    /// After so many seconds it is darkest.
    pub const MIDNIGHT: f32 = 0.5 * DAY;
}

impl Plugin for VillagePlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, turn);
    }
}

fn spawn(mut build: Builder) {
    let grass = build.paint([0.16, 0.27, 0.08]);
    let gravel = build.paint([0.45, 0.42, 0.37]);
    let stem = build.paint([0.05, 0.05, 0.06]);
    build.place(Circle::new(40.0), flat(0.0), &grass);
    build.place(Annulus::new(GREEN - 2.2, GREEN), flat(0.02), &gravel);
    let windows = build.materials.add(StandardMaterial { base_color: Color::linear_rgb(0.1, 0.12, 0.15), ..default() });
    build.commands.insert_resource(Windows(windows.clone()));

    let mut chance = Chance(0x51ab);
    let plaster = [[0.8, 0.76, 0.66], [0.75, 0.5, 0.34], [0.62, 0.66, 0.7], [0.78, 0.68, 0.36]];
    let plaster = plaster.map(|albedo| build.paint(albedo));
    let tiles = [[0.42, 0.13, 0.07], [0.3, 0.12, 0.08], [0.2, 0.2, 0.22]].map(|albedo| build.paint(albedo));
    for house in 0..HOUSES {
        // The camera looks in where there is none.
        let angle = 0.5 * PI + TAU * (f32::from(house) + 0.9) / (f32::from(HOUSES) + 0.8);
        let away = Vec3::new(angle.cos(), 0.0, angle.sin());
        let size = Vec3::new(chance.between(4.0, 6.0), chance.between(2.8, 4.8), chance.between(4.0, 5.5));
        let at = away * (GREEN + 0.5 * size.z + chance.between(0.5, 1.5));
        let walls = &plaster[usize::from(house) % plaster.len()];
        raise(&mut build, at, size, away, [walls, &tiles[usize::from(house) % tiles.len()], &windows]);
    }
    for lamp in 0..3_u8 {
        let angle = TAU * (f32::from(lamp) + 0.2) / 3.0;
        let at = Vec3::new(angle.cos(), 0.0, angle.sin()) * (GREEN - 2.6);
        build.block(at, Vec3::new(0.12, 3.0, 0.12), angle, &stem);
        let light = PointLight {
            color: Color::linear_rgb(1.0, 0.72, 0.42),
            intensity: 0.0,
            range: 40.0,
            shadow_maps_enabled: true,
            ..default()
        };
        build.commands.spawn((StreetLamp, light, Transform::from_translation(at + Vec3::Y * 3.2)));
    }
    build.commands.spawn((Sun, DirectionalLight { shadow_maps_enabled: true, ..default() }, Transform::default()));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        EnvironmentMapLight::default(),
        Transform::from_xyz(1.0, 2.6, 13.5).looking_at(Vec3::new(-0.5, 2.0, -4.0), Vec3::Y),
    ));
}

fn flat(height: f32) -> Transform {
    Transform::from_xyz(0.0, height, 0.0).with_rotation(Quat::from_rotation_x(-0.5 * PI))
}

/// A house with a roof and with windows to the green, which is where `away` comes from.
fn raise(
    build: &mut Builder,
    at: Vec3,
    size: Vec3,
    away: Vec3,
    [walls, tiles, windows]: [&Handle<StandardMaterial>; 3],
) {
    let place = Transform::from_translation(at).looking_to(away, Vec3::Y);
    let on = |x: f32, y: f32, z: f32| place * Transform::from_xyz(x, y, z);
    build.place(Cuboid::from_size(size), on(0.0, 0.5 * size.y, 0.0), walls);
    let roof = Cone::new(0.5, 1.9).mesh().resolution(4).build().rotated_by(Quat::from_rotation_y(0.25 * PI));
    let eaves = Vec3::new(size.x + 0.7, 1.0, size.z + 0.7) * Vec3::new(2.0_f32.sqrt(), 1.0, 2.0_f32.sqrt());
    build.place(roof, on(0.0, size.y + 0.95, 0.0).with_scale(eaves), tiles);
    for row in 0..=u8::from(size.y > 3.8) {
        for x in [-0.27, 0.27] {
            let window = Cuboid::new(0.8, 0.9, 0.06);
            build.place(window, on(x * size.x, 1.5 + 1.9 * f32::from(row), 0.5 * size.z), windows);
        }
    }
}

fn linear(color: Vec3) -> Color {
    Color::linear_rgb(color.x, color.y, color.z)
}

/// The time of day: sun, sky, what shines at night, and the exposure of an eye that gets used to it.
fn turn(
    time: Res<Time>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
    windows: Res<Windows>,
    mut sun: Single<(&mut DirectionalLight, &mut Transform), With<Sun>>,
    mut lamps: Query<&mut PointLight, With<StreetLamp>>,
    mut camera: Single<(Entity, &mut EnvironmentMapLight), With<Camera3d>>,
    mut commands: Commands,
) {
    // It begins in the afternoon.
    let way = sun_at(time.elapsed_secs() + 0.15 * DAY);
    let (light, place) = &mut *sun;
    let high = way.y.max(0.0);
    // Blue and green are scattered on the long way through the air.
    let left = Vec3::new(0.1, 0.25, 0.6).map(|thickness| (-thickness / (high + 0.05)).exp());
    light.color = linear(left);
    light.illuminance = SUNLIGHT * (way.y / 0.05).clamp(0.0, 1.0);
    place.look_to(-way, Vec3::X);

    let day = daylight(way);
    let dusk = (1.0 - (way.y / 0.3).abs()).clamp(0.0, 1.0);
    let brightness = NIGHT + (1.0 - NIGHT) * day;
    let red = Vec3::new(1.5, 0.75, 0.45).lerp(Vec3::ONE, 1.0 - dusk);
    let sky = [ZENITH, HORIZON * red, BEYOND * red].map(|radiance| linear(radiance / HORIZON.max_element()));
    let intensity = HORIZON.max_element() * brightness;
    let map = EnvironmentMapLight::hemispherical_gradient(&mut images, sky[0], sky[1], sky[2]);
    let background = Skybox { image: Some(map.specular_map.clone()), brightness: intensity, ..default() };
    let (camera, environment) = &mut *camera;
    **environment = EnvironmentMapLight { intensity, ..map };
    let ev100 = 3.6 + 9.9 * (brightness.log10() / -NIGHT.log10() + 1.0).clamp(0.0, 1.0);
    commands.entity(*camera).insert((background, Exposure { ev100 }));

    let night = 1.0 - (day * 6.0).min(1.0);
    for mut lamp in &mut lamps {
        lamp.intensity = LAMP * night;
    }
    if let Some(mut glass) = materials.get_mut(&windows.0) {
        let shown = WINDOW * night * Exposure { ev100 }.exposure();
        glass.emissive = LinearRgba::rgb(1.0, 0.68, 0.34) * shown;
    }
}
