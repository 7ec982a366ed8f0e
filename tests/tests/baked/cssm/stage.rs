//! Whole frames lit by baked visibility.

use std::time::Duration;

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::mesh::PrimitiveTopology;
use bevy::prelude::*;
use bevy_bounce::cssm::times_lit;
use bevy_bounce::{
    CssmFilter, CssmObject, CssmPart, CssmReceivers, CssmSettings, GiSettings, GlobalIllumination, Quality, Technique,
};
use bevy_bounce_bake as bake;
use bevy_bounce_cssm::{CssmAsset, CssmFile};
use bevy_bounce_tests::baked::cornell_box;
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::committed_file;
use bevy_bounce_tests::scene::cuboid;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const SIZE: UVec2 = UVec2::new(64, 36);

fn radiosity(settings: GiSettings) -> GlobalIllumination {
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// The project's own Cornell box.
fn cornell() -> Stage {
    Stage::of_asset("cornell_box.glb", run(SIZE, Some(radiosity(SMALL))), true, Some(cornell_box().clone()))
}

fn lamp(stage: &mut Stage) -> Entity {
    stage.only::<SpotLight>()
}

/// `tests/data/cornell_box.indirect.exr` is path-traced from the same file.
#[test]
fn cornell_box_equals_its_reference() {
    let reference = Picture::load(&committed_file("cornell_box.indirect.exr")).expect("is committed");
    let bounds = Bounds { energy: Some((0.92, 1.05)), low: Some(0.14), flip: Some(0.12), nrmse: None };
    let mut stage = cornell();
    let fine = GiSettings { cssm: CssmSettings { error: 2.0, ..CssmSettings::DEFAULT }, ..SMALL };
    stage.light_by(radiosity(GiSettings { bounces: 8, ..fine }));
    let picture = stage.settled_picture();
    let metrics = compare(&picture, &reference, &bounds).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    // The bounds would notice: too few bounces are too little light.
    for bounces in [1, 3] {
        stage.light_by(radiosity(GiSettings { bounces, ..fine }));
        let picture = stage.settled_picture();
        compare(&picture, &reference, &bounds).expect_err("the bounds are too wide to tell");
    }
}

/// `tests/data/cornell_box.N.indirect.exr` are path-traced with so many bounces.
#[test]
fn every_bounce_equals_its_reference() {
    let bounds = Bounds { energy: Some((0.95, 1.05)), low: Some(0.12), flip: Some(0.08), nrmse: None };
    let mut stage = cornell();
    let references = [1, 2, 3].map(|bounces| {
        let file = committed_file(&format!("cornell_box.{bounces}.indirect.exr"));
        Picture::load(&file).unwrap_or_else(|error| panic!("{error}"))
    });
    let by = |bounces, receivers| {
        let cssm = CssmSettings { error: 2.0, receivers, ..CssmSettings::DEFAULT };
        radiosity(GiSettings { bounces, cssm, ..SMALL })
    };
    let cases = [CssmReceivers::Pixels, CssmReceivers::Texels].map(|receivers| (1..=3).map(move |n| (n, receivers)));
    for (bounces, receivers) in cases.into_iter().flatten() {
        let reference = &references[bounces as usize - 1];
        stage.light_by(by(bounces, receivers));
        let picture = stage.settled_picture();
        let name = format!("{bounces} bounces at {receivers:?}");
        let metrics = compare(&picture, reference, &bounds).unwrap_or_else(|error| panic!("{name}: {error}"));
        println!("{name}: {metrics:?}");
        for other in references.iter().filter(|other| *other != reference) {
            compare(&picture, other, &bounds).expect_err("the bounds are too wide to tell");
        }
    }
}

#[test]
fn frames_are_the_same_to_the_byte_and_follow_every_change() {
    let mut stage = cornell();
    let first = stage.picture();
    assert!(first.nonfinite() == 0 && first.mean_luminance() > 0.0, "there is bounced light");
    let times = times_lit(stage.render_world());
    assert!(first == stage.picture(), "two frames of a scene that does not change differ");
    assert_eq!(times_lit(stage.render_world()), times, "texels are lit again though nothing has changed");
    assert!(first == cornell().picture(), "the same scene started afresh differs");

    let changed = [
        ("bounces", GiSettings { bounces: 2, ..SMALL }),
        ("error", GiSettings { cssm: CssmSettings { error: 64.0, ..CssmSettings::DEFAULT }, ..SMALL }),
        (
            "receivers",
            GiSettings { cssm: CssmSettings { receivers: CssmReceivers::Texels, ..CssmSettings::DEFAULT }, ..SMALL },
        ),
        ("filter", GiSettings { cssm: CssmSettings { filter: CssmFilter::Pixels, ..CssmSettings::DEFAULT }, ..SMALL }),
    ];
    for (name, settings) in changed {
        stage.light_by(radiosity(settings));
        let picture = stage.settled_picture();
        assert!(picture.nonfinite() == 0 && picture != first, "{name} has no effect");
    }
    stage.light_by(radiosity(SMALL));
    assert!(first == stage.settled_picture(), "a setting left something behind");

    // In the frame in which the light changes.
    let lamp = lamp(&mut stage);
    let intensity = stage.world().get::<SpotLight>(lamp).map_or(0.0, |light| light.intensity);
    let set = |stage: &mut Stage, value: f32| {
        if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
            light.intensity = value;
        }
    };
    set(&mut stage, 0.0);
    assert_eq!(stage.picture().mean_luminance(), 0.0, "a light that is switched off bounces on");
    set(&mut stage, intensity);
    assert!(first == stage.picture(), "light that is back differs");

    // What a material emits, in the frame in which it does.
    let mut handles = stage.world().query::<&MeshMaterial3d<StandardMaterial>>();
    let handle = handles.iter(stage.world()).next().expect("there are meshes").0.clone();
    let glow = |stage: &mut Stage, emissive: LinearRgba| {
        let mut materials = stage.world().resource_mut::<Assets<StandardMaterial>>();
        if let Some(mut material) = materials.get_mut(&handle) {
            (material.emissive, material.emissive_exposure_weight) = (emissive, 1.0);
        }
    };
    glow(&mut stage, LinearRgba::rgb(500.0, 500.0, 500.0));
    assert!(stage.picture().mean_luminance() > 1.1 * first.mean_luminance(), "emission does not bounce");
    glow(&mut stage, LinearRgba::BLACK);
    assert!(first == stage.settled_picture(), "emission left something behind");
}

/// While everything rests the mean of many frames is shown, which is closer to the light than each; then nothing changes any more.
#[test]
fn what_rests_is_averaged() {
    let settings = |error, history| GiSettings {
        cssm: CssmSettings { error, ..CssmSettings::DEFAULT },
        history,
        bounces: 1,
        ..SMALL
    };
    let mut stage = cornell();
    stage.light_by(radiosity(settings(0.5, 0)));
    let exact = stage.settled_picture();
    let coarse = settings(64.0, 8);
    stage.light_by(radiosity(coarse));
    stage.settled_picture();
    let first = |stage: &mut Stage| {
        stage.light_by(GlobalIllumination { reset: true, ..radiosity(coarse) });
        stage.picture()
    };
    let one = first(&mut stage);
    (0..240).for_each(|_| stage.frame(Duration::ZERO));
    let mean = stage.picture();
    let [noise, left] = [&one, &mean].map(|picture| Metrics::new(picture, &exact).expect("sizes are equal"));
    println!("one frame {noise:?}, many {left:?}");
    assert!(left.nrmse < 0.4 * noise.nrmse && (left.energy - 1.0).abs() < 0.01, "{left:?} is no better than {noise:?}");
    assert!(mean == stage.picture(), "it does not come to rest");
    assert!(first(&mut stage) == one, "a reset leaves something of the last frames");
    // Light that changes is not averaged with what it was.
    (0..8).for_each(|_| stage.frame(Duration::ZERO));
    let lamp = lamp(&mut stage);
    if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
        light.intensity = 0.0;
    }
    assert_eq!(stage.picture().mean_luminance(), 0.0, "light of the last frames is left");
}

/// A closed box of a size and albedo, seen from within.
pub(super) fn box_bake(albedo: f32, atlas: u32) -> CssmFile {
    let corners = cuboid(Vec3::splat(-1.5), Vec3::splat(1.5)).map(|[a, b, c]| [a, c, b]);
    let indices = (0..12).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect();
    let positions = corners.as_flattened().iter().map(|p| p.to_array().into()).collect();
    let mut scene = bake::Scene::from_mesh("box", positions, indices).unwrap_or_else(|error| panic!("{error}"));
    scene.materials[0].factor = Vec3::splat(albedo).extend(1.0);
    let settings = bake::BakeSettings { atlas, depth: 32, ..Default::default() };
    bake::bake(&scene, &settings, &()).unwrap_or_else(|error| panic!("{error}")).0
}

/// The camera within such a box.
pub(super) fn furnace_eye() -> Transform {
    Transform::from_xyz(0.3, 0.2, 1.2).looking_at(Vec3::new(-0.2, -0.1, -1.5), Vec3::Y)
}

/// A box whose walls emit and reflect, with that place in the world.
pub(super) fn furnace(emitted: f32, albedo: f32, place: Transform, atlas: u32, bounces: u32) -> Stage {
    let file = box_bake(albedo, atlas);
    let settings = GiSettings { bounces, ..SMALL };
    Stage::with_run(run(SIZE, Some(radiosity(settings))), move |app| {
        app.add_systems(
            Startup,
            move |mut commands: Commands,
                  mut meshes: ResMut<Assets<Mesh>>,
                  mut materials: ResMut<Assets<StandardMaterial>>,
                  mut bakes: ResMut<Assets<CssmAsset>>| {
                let corners = cuboid(Vec3::splat(-1.5), Vec3::splat(1.5)).map(|[a, b, c]| [a, c, b]);
                let positions: Vec<[f32; 3]> = corners.as_flattened().iter().map(Vec3::to_array).collect();
                let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
                    .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
                    .with_computed_flat_normals();
                let material = StandardMaterial {
                    base_color: Color::linear_rgb(albedo, albedo, albedo),
                    perceptual_roughness: 1.0,
                    reflectance: 0.0,
                    emissive: LinearRgba::rgb(emitted, emitted, emitted),
                    emissive_exposure_weight: 1.0,
                    ..default()
                };
                commands.spawn((
                    Mesh3d(meshes.add(mesh)),
                    MeshMaterial3d(materials.add(material)),
                    CssmObject { bake: bakes.add(CssmAsset { file: file.clone() }) },
                    CssmPart(0),
                    place,
                ));
                commands.spawn((Camera3d::default(), Exposure { ev100: 4.0 }, place * furnace_eye()));
            },
        );
    })
}

/// Light goes on for ever, and has a closed form.
#[test]
fn a_furnace_has_its_closed_form() {
    for (emitted, albedo) in [(10.0, 0.5), (40.0, 0.2)] {
        // Ten bounces leave out the tenth power of the albedo.
        let picture = furnace(emitted, albedo, Transform::IDENTITY, 64, 10).picture();
        let expected = emitted * albedo / (1.0 - albedo);
        let mean = picture.mean_luminance() as f32;
        let within = |share: f32| {
            let near = picture.pixels.iter().filter(|pixel| (pixel[1] / expected - 1.0).abs() < share).count();
            near as f32 / picture.pixels.len() as f32
        };
        println!("albedo {albedo}: {:.4} of the closed form, {:.3} within 5 %", mean / expected, within(0.05));
        assert!((mean / expected - 1.0).abs() < 0.02, "mean {mean} cd/m^2, expected {expected}");
        assert!(within(0.1) > 0.95, "{} of the pixels are within 10 %", within(0.1));
    }
}

#[test]
fn an_object_may_stand_anywhere() {
    let still = furnace(10.0, 0.5, Transform::IDENTITY, 24, 2).picture();
    let turned = Transform::from_xyz(30.0, -4.0, 7.0).with_rotation(Quat::from_rotation_y(1.0));
    for place in [turned, Transform::from_scale(Vec3::splat(0.25))] {
        let mut stage = furnace(10.0, 0.5, place, 24, 2);
        let metrics = Metrics::new(&stage.picture(), &still).expect("sizes are equal");
        assert!(metrics.flip < 0.01 && (metrics.energy - 1.0).abs() < 0.005, "{place:?}: {metrics:?}");
        // Stretched, it is no longer what was baked.
        let object = stage.only::<CssmObject>();
        stage.world().entity_mut(object).insert(place.with_scale(place.scale * Vec3::new(1.0, 1.2, 1.0)));
        assert_eq!(stage.picture().mean_luminance(), 0.0, "a stretched object is lit");
    }
}

#[test]
fn without_a_bake_nothing_bounces() {
    let mut stage = cornell();
    let lit = stage.picture();
    let object = stage.only::<CssmObject>();
    let bake = stage.world().entity_mut(object).take::<CssmObject>().expect("is baked");
    assert_eq!(stage.picture().mean_luminance(), 0.0, "a bake that is gone lights on");
    stage.world().entity_mut(object).insert(bake);
    stage.frame(Duration::ZERO);
    assert!(lit == stage.picture(), "a bake that is back differs");
}

/// What texels receive is shown by pixels alone while the camera moves, and by what stands beside the bake not at all: that gathers.
#[test]
fn texels_are_lit_once_for_every_eye() {
    let cssm = CssmSettings { receivers: CssmReceivers::Texels, ..CssmSettings::DEFAULT };
    let at_texels = radiosity(GiSettings { cssm, history: 1, ..SMALL });
    let mut stage = cornell();
    let world = stage.world();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::from_length(0.5));
    let paint = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    world.spawn((Mesh3d(mesh), MeshMaterial3d(paint), Transform::from_xyz(0.0, 3.5, 2.5)));
    stage.light_by(radiosity(GiSettings { history: 1, ..SMALL }));
    let pixels = stage.settled_picture();
    stage.light_by(at_texels);
    let texels = stage.settled_picture();
    let bounds = Bounds { energy: Some((0.95, 1.05)), low: Some(0.12), flip: Some(0.06), nrmse: None };
    let metrics = compare(&texels, &pixels, &bounds).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    let times = times_lit(stage.render_world());
    let camera = stage.only::<Camera3d>();
    if let Some(mut place) = stage.world().get_mut::<Transform>(camera) {
        place.translation.x += 0.3;
    }
    let moved = Metrics::new(&stage.picture(), &texels).expect("sizes are equal");
    assert!(moved.nrmse > 0.05 && (moved.energy - 1.0).abs() < 0.1, "{moved:?}");
    assert_eq!(times_lit(stage.render_world()), times, "texels are lit anew for another eye");
}
