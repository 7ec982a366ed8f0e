//! The U room of Bashford-Rogers et al. 2012: a lamp in one arm, the camera in the other.
//!
//! Nothing the camera sees is lit directly but a strip round the corner: all else is light that bounced.

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_bounce::GlobalIllumination;

use super::{Builder, Walls};

/// The room, three boxes and a ball in the dark arm, a lamp in the other.
pub struct URoomPlugin;

impl Plugin for URoomPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn);
    }
}

fn spawn(mut build: Builder) {
    let white = build.paint([0.75, 0.74, 0.72]);
    let ochre = build.paint([0.72, 0.42, 0.12]);
    let blue = build.paint([0.15, 0.3, 0.62]);
    let walls = Walls {
        floor: build.paint([0.5, 0.47, 0.43]),
        ceiling: white.clone(),
        back: white.clone(),
        front: white.clone(),
        left: blue.clone(),
        right: ochre.clone(),
    };
    build.room(Vec3::new(-3.0, 0.0, -3.5), Vec3::new(3.0, 3.0, 3.5), &walls);
    // Stands between the arms, which meet at -z.
    build.block(Vec3::new(0.0, 0.0, 1.0), Vec3::new(0.2, 3.0, 5.0), 0.0, &white);
    build.block(Vec3::new(-2.3, 0.0, -1.2), Vec3::new(0.7, 1.6, 0.7), 0.3, &white);
    build.block(Vec3::new(-1.0, 0.0, -0.4), Vec3::new(0.6, 0.6, 0.6), -0.4, &ochre);
    build.block(Vec3::new(-2.4, 0.0, 0.8), Vec3::new(0.6, 0.9, 0.6), 0.1, &blue);
    build.place(Sphere::new(0.35).mesh().uv(48, 24), Transform::from_xyz(-1.0, 0.95, -0.4), &white);
    build.commands.spawn((
        SpotLight {
            intensity: 9000.0 * 4.0 * std::f32::consts::PI,
            range: 100.0,
            inner_angle: 0.6,
            outer_angle: 0.75,
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(1.6, 2.7, 1.2).looking_at(Vec3::new(1.4, 0.8, -3.5), Vec3::Y),
    ));
    build.commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Exposure { ev100: 6.5 },
        Projection::Perspective(PerspectiveProjection { fov: 0.95, ..default() }),
        Transform::from_xyz(-1.1, 1.6, 3.3).looking_at(Vec3::new(-1.6, 1.2, -1.5), Vec3::Y),
    ));
}
