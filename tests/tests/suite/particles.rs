//! Bounced light on particles: blended quads in the air, beside opaque ones in the G-buffer.

use bevy::light::NotShadowCaster;
use bevy::prelude::*;
use bevy_bounce::{GiIsolate, GiSettings, Quality, VoxelizedMesh};
use bevy_bounce_examples::scenes::{Builder, CornellBox, CornellPlugin, Surface};
use bevy_bounce_tests::cornell::{self, PointInAir};
use bevy_bounce_tests::picture::{Picture, luminance};
use bevy_bounce_tests::stage::{Stage, illumination};

use crate::probes::{SIZE, minus, show, stage_of};

/// Small quads in the air.
#[derive(Component)]
struct Particle;

/// Puts one at each point.
fn spawn_particles(stage: &mut Stage, points: &[PointInAir]) -> Handle<StandardMaterial> {
    let world = stage.world();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::from_length(cornell::PIECE));
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        base_color: Color::linear_rgb(0.8, 0.8, 0.8),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    });
    for point in points {
        let look = (Mesh3d(mesh.clone()), MeshMaterial3d(paint.clone()), Transform::from_translation(point.at));
        world.spawn((look, Particle, VoxelizedMesh::OFF, NotShadowCaster));
    }
    paint
}

/// How particles are turned.
#[derive(Clone, Copy, Debug)]
enum Turned {
    /// As the camera is.
    AsTheEye,
    /// Each to the camera.
    ToTheEye,
}

/// Particles as a camera sees them.
struct Sight {
    eye: Transform,
    field_of_view: f32,
    turned: Turned,
    /// Whether a wall closes the box.
    closed: bool,
}

/// A camera outside, that looks into the box.
const FROM_OUTSIDE: Sight = Sight {
    eye: Transform::from_translation(CornellBox::EYE),
    field_of_view: CornellBox::FIELD_OF_VIEW,
    turned: Turned::AsTheEye,
    closed: false,
};

/// How far off blended particles are from opaque ones in the G-buffer, point by point: a list for each way of blending.
fn particle_errors(sight: &Sight, modes: &[AlphaMode]) -> Vec<Vec<f64>> {
    let &Sight { eye, field_of_view, turned, closed } = sight;
    let settings = Quality::High.settings();
    let mut stage = stage_of(SIZE, settings, false, |app| {
        app.add_plugins(CornellPlugin);
        if closed {
            app.add_systems(Startup, |mut build: Builder| {
                let paint = build.paint(Surface::White.albedo());
                build.panel(Vec3::new(2.0, 0.0, 2.0), Vec3::NEG_X * 4.0, Vec3::Y * 4.0, &paint);
            });
        }
    });
    let camera = stage.only::<Camera3d>();
    let lens = Projection::Perspective(PerspectiveProjection { fov: field_of_view, ..default() });
    stage.world().entity_mut(camera).insert((eye, lens));
    let points = cornell::points_in_air(&eye, field_of_view, SIZE);
    let paint = spawn_particles(&mut stage, &points);
    let world = stage.world();
    for mut place in world.query_filtered::<&mut Transform, With<Particle>>().iter_mut(world) {
        match turned {
            Turned::AsTheEye => place.rotation = eye.rotation,
            Turned::ToTheEye => place.rotation = eye.looking_at(place.translation, Vec3::Y).rotation,
        }
    }
    let blend = |stage: &mut Stage, mode| {
        if let Some(mut paint) = stage.world().resource_mut::<Assets<StandardMaterial>>().get_mut(&paint) {
            paint.alpha_mode = mode;
        }
        stage.settled_picture()
    };
    show(&mut stage, GiIsolate::Indirect);
    let deferred = blend(&mut stage, AlphaMode::Opaque);
    show(&mut stage, GiIsolate::All);
    let with: Vec<_> = modes.iter().map(|mode| blend(&mut stage, *mode)).collect();
    stage.light_by(illumination(GiSettings { probes: 0, ..settings }));
    let without: Vec<_> = modes.iter().map(|mode| blend(&mut stage, *mode)).collect();
    let error = |light: &Picture, point: &PointInAir| {
        let [found, expected] = [light, &deferred].map(|picture| luminance(picture.at(point.x, point.y)));
        found / expected - 1.0
    };
    let lights = with.iter().zip(&without).map(|(with, without)| minus(with, without));
    lights.map(|light| points.iter().map(|point| error(&light, point)).collect()).collect()
}

/// Asserts that so many are within 15 %.
fn assert_particles_are_alike(name: &str, mut errors: Vec<f64>, at_least: usize) {
    errors.sort_by(|a, b| b.abs().total_cmp(&a.abs()));
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let within = errors.iter().filter(|error| error.abs() < 0.15).count();
    println!("{name}: {within} of {} within 15 %, mean {mean:+.3}, worst {:+.3?}", errors.len(), &errors[..6]);
    assert!(within >= at_least, "{name}: {within} within 15 %, mean {mean}");
}

/// Particles that float in a room, turned as a camera that looks along an axis, are lit as opaque ones are.
#[test]
fn particles_in_the_air_are_lit_like_what_is_in_the_g_buffer() {
    assert_lit_alike(&[AlphaMode::Blend]);
}

/// However they are blended.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn particles_are_lit_alike_however_they_are_blended() {
    assert_lit_alike(&[AlphaMode::Add, AlphaMode::Premultiplied]);
}

fn assert_lit_alike(modes: &[AlphaMode]) {
    let errors = particle_errors(&FROM_OUTSIDE, modes);
    for (mode, errors) in modes.iter().zip(errors) {
        assert_particles_are_alike(&format!("{mode:?}"), errors, 50);
    }
}

/// Turned to a camera, aslant, they get what Bevy's shaders make of six directions: most are within the bound in a
/// closed room, fewer where they look into the dark outside, which light changes fast to.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn particles_aslant_are_lit_as_far_as_six_directions_tell() {
    let within = Transform::from_xyz(1.7, 3.5, 1.7).looking_at(Vec3::new(-0.6, 1.3, -0.6), Vec3::Y);
    let closed = Sight { eye: within, field_of_view: 1.3, turned: Turned::ToTheEye, closed: true };
    let into_the_dark = Sight { turned: Turned::ToTheEye, ..FROM_OUTSIDE };
    for (name, sight, at_least) in [("a closed room", closed, 40), ("into the dark", into_the_dark, 25)] {
        for errors in particle_errors(&sight, &[AlphaMode::Blend]) {
            assert_particles_are_alike(name, errors, at_least);
        }
    }
}
