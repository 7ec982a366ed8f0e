//! The nave of a church: a barrel vault on ribs and columns, and sun through its windows, which lights all the rest by what the
//! floor and the benches send on. After the Cornell Church of Ritschel et al. 2008.

use std::f32::consts::{PI, TAU};

use bevy::camera::Exposure;
use bevy::light::CascadeShadowConfigBuilder;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;
use bevy_bounce_bake::BakeSettings;
use bevy_bounce_cssm::CssmAsset;

use super::{BakedObject, Builder, Piece, Solid, report};
use crate::Error;
use crate::headless::Failed;

/// The nave, the sun, and a camera near the door.
pub struct ChurchPlugin;

impl Plugin for ChurchPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<Failed>()
            .insert_resource(ClearColor(Color::srgb(0.55, 0.72, 0.95)))
            .add_systems(Startup, spawn);
    }
}

/// Half the width of the nave between its walls, metres.
const WIDTH: f32 = 4.0;
/// Half its length.
const LENGTH: f32 = 11.0;
/// Where the vault begins.
const HEIGHT: f32 = 5.0;
const WALL: f32 = 0.5;
/// Bays, each with a window on both sides.
const BAYS: u32 = 5;
const BAY: f32 = 2.0 * LENGTH / BAYS as f32;
/// Half the width of a window, its sill and its top.
const WINDOW: [f32; 3] = [0.75, 1.6, 4.3];
/// Pieces of a round arch.
const ARCH: u32 = 14;
const BAKE: BakeSettings =
    BakeSettings { atlas: 192, depth: 32, strategy: bevy_bounce_bake::Strategy::Tiles, unwrap: false };

/// Where a bay begins.
fn bay(number: u32) -> f32 {
    -LENGTH + BAY * number as f32
}

/// A wall along z with a window in each bay.
fn side_wall(solid: &mut Solid, side: f32) {
    let [inner, outer] = [side * WIDTH, side * (WIDTH + WALL)];
    let [low_x, high_x] = [inner.min(outer), inner.max(outer)];
    let [half, sill, top] = WINDOW;
    let mut block = |y: [f32; 2], z: [f32; 2]| {
        solid.block(Vec3::new(low_x, y[0], z[0]), Vec3::new(high_x, y[1], z[1]));
    };
    block([0.0, sill], [-LENGTH, LENGTH]);
    block([top, HEIGHT], [-LENGTH, LENGTH]);
    for number in 0..=BAYS {
        let [from, to] = [bay(number) - 0.5 * BAY + half, bay(number) + 0.5 * BAY - half];
        block([sill, top], [from.max(-LENGTH), to.min(LENGTH)]);
    }
}

/// A wall across z, up to the vault's top; the one behind the altar has three tall windows.
fn end_wall(solid: &mut Solid, [back, front]: [f32; 2], windows: bool) {
    let top = HEIGHT + WIDTH + WALL;
    let mut block = |x: [f32; 2], y: [f32; 2]| solid.block(Vec3::new(x[0], y[0], back), Vec3::new(x[1], y[1], front));
    let edge = WIDTH + WALL;
    if !windows {
        block([-edge, edge], [0.0, top]);
        return;
    }
    block([-edge, edge], [0.0, 2.0]);
    block([-edge, edge], [6.2, top]);
    for x in [[-edge, -1.9], [-1.1, -0.4], [0.4, 1.1], [1.9, edge]] {
        block(x, [2.0, 6.2]);
    }
}

/// A point of a round arch.
fn arch(step: u32, radius: f32) -> Vec2 {
    let (sin, cos) = (PI * step as f32 / ARCH as f32).sin_cos();
    Vec2::new(radius * cos, HEIGHT + radius * sin)
}

/// An upright prism of eight sides with a plate on it.
fn column(solid: &mut Solid, x: f32, z: f32) {
    const RADIUS: f32 = 0.32;
    let corner = |side: u32, y: f32| {
        let (sin, cos) = (TAU * (side as f32 + 0.5) / 8.0).sin_cos();
        Vec3::new(x + RADIUS * cos, y, z - RADIUS * sin)
    };
    let top = HEIGHT - 0.3;
    for side in 0..8 {
        solid.quad([corner(side, 0.0), corner(side + 1, 0.0), corner(side + 1, top), corner(side, top)], Vec3::ONE);
    }
    let plate = Vec3::new(0.42, 0.0, 0.42);
    solid.block(Vec3::new(x, top, z) - plate, Vec3::new(x, HEIGHT, z) + plate);
    solid.block(Vec3::new(x, 0.0, z) - plate, Vec3::new(x, 0.25, z) + plate);
}

fn stone() -> Solid {
    let mut solid = Solid::default();
    side_wall(&mut solid, -1.0);
    side_wall(&mut solid, 1.0);
    end_wall(&mut solid, [-LENGTH - WALL, -LENGTH], true);
    end_wall(&mut solid, [LENGTH, LENGTH + WALL], false);
    let shell = |step: u32| [arch(step, WIDTH), arch(step, WIDTH + WALL)];
    solid.arch(ARCH, shell, [-LENGTH, LENGTH]);
    let rib = |step: u32| [arch(step, WIDTH - 0.35), arch(step, WIDTH + 0.1)];
    for number in 1..BAYS {
        solid.arch(ARCH, rib, [bay(number) - 0.22, bay(number) + 0.22]);
        column(&mut solid, -WIDTH + 0.3, bay(number));
        column(&mut solid, WIDTH - 0.3, bay(number));
    }
    // The altar on its steps.
    for (half, depth, low, high) in [(2.6, 3.0, 0.0, 0.18), (2.2, 2.6, 0.18, 0.36), (0.9, 2.0, 0.36, 1.3)] {
        solid.block(Vec3::new(-half, low, -LENGTH + 0.6), Vec3::new(half, high, -LENGTH + 0.6 + depth));
    }
    solid
}

fn tiles() -> Solid {
    let mut solid = Solid::default();
    let low = Vec3::new(-WIDTH - WALL, -0.3, -LENGTH - WALL);
    solid.block(low, Vec3::new(WIDTH + WALL, 0.0, LENGTH + WALL));
    solid
}

fn benches() -> Solid {
    let mut solid = Solid::default();
    for row in 0..8 {
        let z = -4.5 + 1.5 * row as f32;
        for side in [-1.0, 1.0] {
            let [from, to] = [0.7, 3.0].map(|x: f32| side * x);
            let [low, high] = [from.min(to), from.max(to)];
            solid.block(Vec3::new(low, 0.42, z - 0.2), Vec3::new(high, 0.48, z + 0.22));
            solid.block(Vec3::new(low, 0.48, z + 0.16), Vec3::new(high, 0.95, z + 0.22));
            for x in [low, high - 0.08] {
                solid.block(Vec3::new(x, 0.0, z - 0.18), Vec3::new(x + 0.08, 0.42, z + 0.2));
            }
        }
    }
    solid
}

fn spawn(mut build: Builder, bakes: Option<ResMut<Assets<CssmAsset>>>, mut failed: ResMut<Failed>) {
    report(try_spawn(&mut build, bakes), &mut failed);
}

fn try_spawn(build: &mut Builder, bakes: Option<ResMut<Assets<CssmAsset>>>) -> Result<(), Error> {
    let pieces = [
        Piece { name: "stone", solid: stone(), albedo: [0.68, 0.63, 0.55] },
        Piece { name: "tiles", solid: tiles(), albedo: [0.5, 0.34, 0.24] },
        Piece { name: "benches", solid: benches(), albedo: [0.36, 0.2, 0.1] },
    ];
    let church = BakedObject::new("church", &pieces, &BAKE, build, bakes.map(ResMut::into_inner))?;
    church.spawn(&mut build.commands, Transform::IDENTITY);
    build.commands.spawn((
        DirectionalLight { illuminance: 80_000.0, shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { maximum_distance: 40.0, ..default() }.build(),
        Transform::IDENTITY.looking_to(Vec3::new(-0.75, -0.62, -0.22), Vec3::Y),
    ));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 10.8 },
        Projection::Perspective(PerspectiveProjection { fov: 1.0, ..default() }),
        Transform::from_xyz(0.6, 2.2, 9.6).looking_at(Vec3::new(-0.2, 3.1, -6.0), Vec3::Y),
    ));
    Ok(())
}
