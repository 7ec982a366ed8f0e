//! The Cornell box with what the deferred pass does not draw: all of it is lit by light probes.

use bevy::material::OpaqueRendererMethod;
use bevy::prelude::*;

use super::{Builder, CornellBox};

/// A blended screen and balls of glass, of blended and of forward-rendered paint, and dust.
pub struct SeeThroughPlugin;

impl Plugin for SeeThroughPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(Startup, spawn);
    }
}

fn spawn(mut build: Builder) {
    CornellBox::spawn_walls(&mut build);
    let white = StandardMaterial {
        base_color: Color::linear_rgb(0.73, 0.73, 0.73),
        perceptual_roughness: 1.0,
        reflectance: 0.2,
        ..default()
    };
    let mut paint = |material: StandardMaterial| build.materials.add(material);
    let deferred = paint(white.clone());
    let forward = paint(StandardMaterial { opaque_render_method: OpaqueRendererMethod::Forward, ..white.clone() });
    let blended = paint(StandardMaterial {
        base_color: Color::linear_rgba(0.73, 0.73, 0.73, 0.7),
        alpha_mode: AlphaMode::Blend,
        ..white.clone()
    });
    let frosted = paint(StandardMaterial {
        base_color: Color::linear_rgba(0.6, 0.75, 0.9, 0.4),
        alpha_mode: AlphaMode::Blend,
        double_sided: true,
        cull_mode: None,
        ..white.clone()
    });
    let glass = paint(StandardMaterial {
        specular_transmission: 0.6,
        thickness: 0.8,
        ior: 1.5,
        perceptual_roughness: 0.1,
        ..white
    });
    let ball = |build: &mut Builder, x: f32, z: f32, material: &Handle<StandardMaterial>| {
        build.place(Sphere::new(0.5).mesh().uv(48, 24), Transform::from_xyz(x, 0.5, z), material);
    };
    for (x, z, material) in
        [(-1.35, -0.7, &deferred), (-0.45, 0.5, &forward), (0.45, -0.7, &blended), (1.35, 0.5, &glass)]
    {
        ball(&mut build, x, z, material);
    }
    let screen = Transform::from_xyz(0.9, 2.4, -1.0).with_rotation(Quat::from_rotation_y(-0.5));
    build.place(Rectangle::new(1.6, 1.4), screen, &frosted);
    for i in 0..40_u32 {
        // Weyl's sequence: even, and the same every time.
        let place = |step: f32| ((i as f32 + 1.0) * step).fract();
        let at = Vec3::new(3.4 * place(0.8192) - 1.7, 1.4 + 2.2 * place(0.6711), 3.0 * place(0.5498) - 1.5);
        build.place(Rectangle::new(0.07, 0.07), Transform::from_translation(at), &frosted);
    }
    CornellBox::spawn_lamp_and_camera(&mut build.commands);
}
