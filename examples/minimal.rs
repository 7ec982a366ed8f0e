//! The whole set-up of a game: a camera with [`GlobalIllumination`], meshes and a light.
//!
//! A window by default; `--output FILE.png` renders without one, `--help` lists the options. `launch` adds Bevy's default
//! plugins and `GlobalIlluminationPlugins`.

use std::process::ExitCode;

use bevy::prelude::*;
use bevy_bounce::prelude::*;

fn main() -> ExitCode {
    bevy_bounce_examples::launch("minimal", |app| {
        app.add_systems(Startup, setup);
    })
}

fn setup(mut commands: Commands, mut meshes: ResMut<Assets<Mesh>>, mut materials: ResMut<Assets<StandardMaterial>>) {
    commands.spawn((
        Camera3d::default(),
        GlobalIllumination::default(),
        Transform::from_xyz(1.2, 2.2, 6.0).looking_at(Vec3::new(-0.3, 1.0, 0.0), Vec3::Y),
    ));
    commands.spawn((
        PointLight { intensity: 800_000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.5, 3.5, 2.0),
    ));
    for (mesh, color, place) in [
        (meshes.add(Plane3d::default().mesh().size(8.0, 8.0)), Color::srgb(0.8, 0.8, 0.8), Transform::default()),
        (meshes.add(Cuboid::new(8.0, 3.0, 0.2)), Color::srgb(0.8, 0.8, 0.8), Transform::from_xyz(0.0, 1.5, -2.0)),
        (meshes.add(Cuboid::new(0.2, 3.0, 4.0)), Color::srgb(0.9, 0.2, 0.1), Transform::from_xyz(-2.5, 1.5, 0.0)),
        (meshes.add(Sphere::new(0.8)), Color::srgb(0.85, 0.85, 0.85), Transform::from_xyz(-1.4, 0.8, 0.2)),
        (meshes.add(Cuboid::new(1.2, 1.2, 1.2)), Color::srgb(0.2, 0.4, 0.9), Transform::from_xyz(1.4, 0.6, -0.4)),
    ] {
        let material = StandardMaterial { base_color: color, perceptual_roughness: 0.9, ..default() };
        commands.spawn((Mesh3d(mesh), MeshMaterial3d(materials.add(material)), place));
    }
}
