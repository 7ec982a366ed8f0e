//! A town of one square kilometre, and a drive along its streets: a world too large for a single grid, whose blocks come and go.

use std::time::Duration;

use bevy::camera::Exposure;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::Builder;
use super::chance::Chance;

/// Blocks of houses, a sun, a sky, and a camera that drives.
pub struct TownPlugin;

/// Edge of a block with the street on two of its sides, metres; of the street; and blocks along an edge of the town.
const BLOCK: f32 = 50.0;
const STREET: f32 = 14.0;
const BLOCKS: u16 = 20;
/// Metres a second.
const SPEED: f32 = 50.0;
/// Of the camera, and how far it drives before it begins anew, metres.
const EYE: f32 = 2.4;
const WAY: f32 = 800.0;
/// Of the sun, lux.
const SUNLIGHT: f32 = 60_000.0;
/// Of the picture, at ISO 100.
const EV100: f32 = 13.3;
/// Of the sky overhead, at the horizon, and of what is below it, cd/m^2.
const SKY: [Vec3; 3] =
    [Vec3::new(1500.0, 2800.0, 6000.0), Vec3::new(5200.0, 6000.0, 6800.0), Vec3::new(1500.0, 1500.0, 1400.0)];

/// Metres from the camera within which blocks are there, and beyond which they no longer are.
const SEEN: f32 = 420.0;
const FORGOTTEN: f32 = 450.0;

impl TownPlugin {
    /// Animation time until the drive begins anew.
    pub const LAP: Duration = Duration::from_secs((WAY / SPEED) as u64);
}

impl Plugin for TownPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn).add_systems(Update, (drive, stream).chain());
    }
}

/// What houses are made of, and which blocks are there, by row and column.
#[derive(Resource)]
struct Town {
    house: Handle<Mesh>,
    facades: [Handle<StandardMaterial>; 5],
    blocks: Vec<Option<Entity>>,
}

fn center_of(block: usize) -> Vec3 {
    let (row, column) = (block / usize::from(BLOCKS), block % usize::from(BLOCKS));
    let half = 0.5 * f32::from(BLOCKS);
    Vec3::new(column as f32 + 0.5 - half, 0.0, row as f32 + 0.5 - half) * BLOCK
}

/// Blocks come and go with the camera.
fn stream(mut commands: Commands, mut town: ResMut<Town>, camera: Single<&Transform, With<Camera3d>>) {
    let Town { house, facades, blocks } = &mut *town;
    for (index, block) in blocks.iter_mut().enumerate() {
        let center = center_of(index);
        let distance = camera.translation.xz().distance(center.xz());
        if distance > FORGOTTEN {
            if let Some(block) = block.take() {
                commands.entity(block).despawn();
            }
        } else if distance < SEEN && block.is_none() {
            let root = (Transform::from_translation(center), Visibility::default());
            let mut root = commands.spawn(root);
            root.with_children(|parent| {
                for (place, facade) in houses(index) {
                    parent.spawn((Mesh3d(house.clone()), MeshMaterial3d(facades[facade].clone()), place));
                }
            });
            *block = Some(root.id());
        }
    }
}

/// The houses of a block, from its middle, each with its facade; the same whenever they come.
fn houses(block: usize) -> impl Iterator<Item = (Transform, usize)> {
    let mut chance = Chance(0x70c1 + 7919 * block as u32);
    let lot = 0.5 * (BLOCK - STREET);
    [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)].into_iter().map(move |(x, z)| {
        let size = Vec3::new(lot - chance.between(0.5, 5.0), chance.between(6.0, 22.0), lot - chance.between(0.5, 5.0));
        let place = Vec3::new(x * 0.5 * lot, 0.5 * size.y, z * 0.5 * lot);
        (Transform::from_translation(place).with_scale(size), (chance.next() * 5.0) as usize % 5)
    })
}

fn spawn(mut build: Builder, mut images: ResMut<Assets<Image>>) {
    let edge = BLOCK * f32::from(BLOCKS);
    let street = build.paint([0.22, 0.22, 0.23]);
    build.block(Vec3::NEG_Y, Vec3::new(edge, 1.0, edge), 0.0, &street);
    let facades = [[0.7, 0.66, 0.58], [0.72, 0.3, 0.16], [0.2, 0.42, 0.66], [0.75, 0.62, 0.2], [0.34, 0.55, 0.28]];
    let town = Town {
        house: build.meshes.add(Cuboid::default()),
        facades: facades.map(|albedo| build.paint(albedo)),
        blocks: vec![None; usize::from(BLOCKS) * usize::from(BLOCKS)],
    };
    build.commands.insert_resource(town);
    let way = Vec3::new(0.75, 1.0, 0.35);
    build.commands.spawn((
        DirectionalLight { illuminance: SUNLIGHT, shadow_maps_enabled: true, ..default() },
        Transform::from_translation(way).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let brightest = SKY[1].max_element();
    let [zenith, horizon, below] = SKY.map(|radiance| radiance / brightest);
    let linear = |color: Vec3| Color::linear_rgb(color.x, color.y, color.z);
    let map = EnvironmentMapLight::hemispherical_gradient(&mut images, linear(zenith), linear(horizon), linear(below));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Skybox { image: Some(map.specular_map.clone()), brightness: brightest, ..default() },
        EnvironmentMapLight { intensity: brightest, ..map },
        Exposure { ev100: EV100 },
        seen_after(0.0),
    ));
}

/// Where the camera is after so many seconds: in the middle of a street.
fn seen_after(seconds: f32) -> Transform {
    let eye = Vec3::new(0.0, EYE, 0.5 * WAY - (seconds * SPEED) % WAY);
    Transform::from_translation(eye).looking_to(Vec3::new(0.25, 0.08, -1.0), Vec3::Y)
}

fn drive(time: Res<Time>, mut camera: Single<&mut Transform, With<Camera3d>>) {
    **camera = seen_after(time.elapsed_secs());
}
