//! Volumetric fog in games: on split screens, and beside temporal anti-aliasing, which runs at the same place of a frame.

use std::time::Duration;

use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::camera::{Exposure, RenderTarget, Viewport};
use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::prelude::*;
use bevy::tasks::{ComputeTaskPool, TaskPoolBuilder};
use bevy_bounce::{GiIsolate, GiSettings};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::eye::Eye;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};

const SIZE: UVec2 = UVec2::new(64, 36);
const HALF: UVec2 = UVec2::new(32, 36);
const EXPOSURE: Exposure = Exposure { ev100: 7.0 };
/// `GiSettings::probes` with which fog is lit, and without: then there is Bevy's fog alone.
const LIT: u32 = 8;
const DARK: u32 = 0;

/// A Cornell box in fog, cameras included, with a light that makes Bevy draw it.
fn foggy_box() -> Stage {
    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_plugins(CornellPlugin);
    });
    let main = stage.only::<Camera3d>();
    let world = stage.world();
    world.entity_mut(main).insert(Camera { is_active: false, ..default() });
    world.spawn((PointLight { intensity: 0.0, ..default() }, VolumetricLight));
    let (absorption, scattering, scattering_asymmetry) = (0.5, 1.0, 0.0);
    let fog = FogVolume { density_factor: 0.05, absorption, scattering, scattering_asymmetry, ..default() };
    world.spawn((fog, Transform::from_xyz(0.0, 2.0, 2.5).with_scale(Vec3::new(5.0, 5.0, 10.0))));
    stage
}

fn front() -> Transform {
    Transform::from_xyz(0.0, 2.0, 6.5).looking_at(Vec3::new(0.0, 2.0, 0.0), Vec3::Y)
}

fn aside() -> Transform {
    Transform::from_xyz(1.5, 2.5, 4.0).looking_at(Vec3::new(-1.0, 1.0, -1.0), Vec3::Y)
}

fn foggy(probes: u32) -> impl Bundle {
    let fog = VolumetricFog { ambient_intensity: 0.0, ..default() };
    (illumination(GiSettings { probes, ..SMALL }), GiIsolate::All, fog)
}

fn settle(stage: &mut Stage) {
    for _ in 0..4 {
        stage.frame(Duration::ZERO);
    }
}

fn alone(stage: &mut Stage, place: Transform, probes: u32) -> Picture {
    let eye = Eye::open(stage, HALF, EXPOSURE, (foggy(probes), place));
    settle(stage);
    let picture = eye.picture(stage);
    eye.close(stage);
    picture
}

/// Both halves of a target, each a camera's.
fn split(stage: &mut Stage, probes: u32) -> [Picture; 2] {
    let side = |x: u32, order: isize| {
        let viewport = Viewport { physical_position: UVec2::new(x, 0), physical_size: HALF, ..default() };
        Camera { viewport: Some(viewport), order, ..default() }
    };
    let left = Eye::open(stage, SIZE, EXPOSURE, (foggy(probes), front(), side(0, 0)));
    let over = RenderTarget::Image(left.target.clone().into());
    let keep = Camera { clear_color: ClearColorConfig::None, ..side(HALF.x, 1) };
    let right = Eye::open(stage, SIZE, EXPOSURE, (foggy(probes), aside(), keep));
    stage.world().entity_mut(right.camera).insert(over);
    settle(stage);
    let both = left.picture(stage);
    left.close(stage);
    right.close(stage);
    [0, HALF.x].map(|from| Picture::from_fn(HALF.x as usize, HALF.y as usize, |x, y| both.at(x + from as usize, y)))
}

/// Two cameras beside each other, each with a target and with fog: each as by itself.
#[test]
fn two_foggy_cameras_do_not_disturb_each_other() {
    let mut stage = foggy_box();
    let expected = [front(), aside()].map(|place| alone(&mut stage, place, LIT));
    let dark = [front(), aside()].map(|place| alone(&mut stage, place, DARK));
    assert!(expected != dark, "the fog is not lit");
    let eyes = [front(), aside()].map(|place| Eye::open(&mut stage, HALF, EXPOSURE, (foggy(LIT), place)));
    settle(&mut stage);
    for (eye, expected) in eyes.iter().zip(&expected) {
        assert_eq!(expected.nonfinite(), 0);
        assert!(eye.picture(&stage) == *expected, "another picture beside another camera");
    }
}

/// What bounced light adds to fog.
fn added(lit: &Picture, dark: &Picture) -> Picture {
    Picture::from_fn(lit.width, lit.height, |x, y| std::array::from_fn(|c| lit.at(x, y)[c] - dark.at(x, y)[c]))
}

/// The halves of a target are what two cameras see by themselves. Of fog that a camera is outside of, Bevy draws the
/// box as if it had the whole target; what bounced light adds is at its place there, too.
#[test]
fn a_split_screen_has_fog_in_both_halves() {
    let mut stage = foggy_box();
    let fog = stage.only::<FogVolume>();
    for around in [true, false] {
        if !around {
            let before = Transform::from_xyz(0.0, 2.0, 0.0).with_scale(Vec3::splat(3.0));
            stage.world().entity_mut(fog).insert(before);
        }
        let [lit, dark] = [LIT, DARK].map(|probes| {
            let alone = [front(), aside()].map(|place| alone(&mut stage, place, probes));
            (alone, split(&mut stage, probes))
        });
        for half in 0..2 {
            let metrics = |test: &Picture, reference: &Picture| Metrics::new(test, reference).expect("sizes are equal");
            let whole = metrics(&lit.1[half], &lit.0[half]);
            let bevys = metrics(&dark.1[half], &dark.0[half]);
            let ours = metrics(&added(&lit.1[half], &dark.1[half]), &added(&lit.0[half], &dark.0[half]));
            println!(
                "around {around}, half {half}: whole {:.5}, Bevy's {:.5}, ours {:.5}",
                whole.nrmse, bevys.nrmse, ours.nrmse
            );
            assert!(!around || whole.nrmse < 1e-4, "half {half} is another picture: {whole:?}");
            assert!(ours.nrmse < 0.01 && whole.nonfinite == 0, "half {half}: {ours:?}");
        }
    }
}

/// Bevy draws no volume that is flat, as when it grows from nothing: none of it is lit, either.
#[test]
fn fog_without_a_size_is_none() {
    let mut stage = foggy_box();
    let fog = stage.only::<FogVolume>();
    stage.world().entity_mut(fog).insert(FogVolume { density_factor: 0.0, ..default() });
    let without = alone(&mut stage, front(), LIT);
    stage.world().entity_mut(fog).insert(FogVolume { density_factor: 0.5, ..default() });
    for scale in [Vec3::ZERO, Vec3::new(5.0, 0.0, 5.0), Vec3::new(0.0, 5.0, 5.0)] {
        stage.world().entity_mut(fog).insert(Transform::from_xyz(0.0, 2.0, 0.0).with_scale(scale));
        let [lit, dark] = [LIT, DARK].map(|probes| alone(&mut stage, front(), probes));
        assert!(dark == without, "{scale}: Bevy draws it: {:?}", Metrics::new(&dark, &without));
        assert!(lit == without, "{scale}: it is lit: {:?}", Metrics::new(&lit, &without));
    }
}

/// Temporal anti-aliasing takes the picture with its fog, in each frame: beside the same camera without bounced light
/// in its fog, none is lost.
#[test]
fn fog_is_lit_in_each_frame_beside_temporal_antialiasing() {
    // As games have it: systems that have no order run at once.
    ComputeTaskPool::get_or_init(|| TaskPoolBuilder::new().num_threads(4).build());
    let mut stage = foggy_box();
    let eyes = [LIT, DARK].map(|probes| {
        let bundle = (foggy(probes), front(), TemporalAntiAliasing::default());
        Eye::open(&mut stage, SIZE, EXPOSURE, bundle)
    });
    (0..16).for_each(|_| stage.frame(Duration::ZERO));
    let mut last: Option<f64> = None;
    for frame in 0..32 {
        stage.frame(Duration::ZERO);
        let [lit, dark] = [0, 1].map(|i| eyes[i].picture(&stage).mean_luminance());
        let ratio = lit / dark;
        println!("frame {frame}: {ratio:.4} of the light without");
        assert!(ratio > 1.05, "frame {frame}: no bounced light in fog");
        let step = last.map_or(1.0, |last| ratio / last);
        // What is gathered over frames grows slowly.
        assert!((step - 1.0).abs() < 0.003, "frame {frame}: {step} of the light before");
        last = Some(ratio);
    }
}
