//! Whole frames: against a path-traced reference, against themselves, and with every setting live.

use std::path::Path;
use std::time::Duration;

use bevy::camera::Exposure;
use bevy::prelude::*;
use bevy_bounce::{
    GiIsolate, GiLight, GiSettings, GlobalIllumination, Quality, Resolution, Technique, VoxelizedMesh, VplVisibility,
};
use bevy_bounce_examples::Run;
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_examples::scenes::{AnimalPlugin, Builder, CornellPlugin, DoorsPlugin, Walls};
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::committed_file;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};

const SIZE: UVec2 = UVec2::new(64, 36);

fn cornell(settings: GiSettings) -> Stage {
    Stage::new(SIZE, settings, |app| {
        app.add_plugins(CornellPlugin);
    })
}

fn black(picture: &Picture) -> bool {
    picture.pixels.iter().all(|pixel| *pixel == [0.0; 3])
}

/// `tests/data/cornell_box.indirect.exr` is path-traced from `assets/cornell_box.glb`; the scene is the same by its numbers.
#[test]
fn cornell_box_equals_its_reference() {
    let reference = Picture::load(&committed_file("cornell_box.indirect.exr")).expect("is committed");
    let bounds = Bounds { energy: Some((0.88, 1.08)), low: Some(0.22), flip: Some(0.16), nrmse: None };
    let fine = GiSettings { grid: 64, vpls: 1024, bounces: 12, ..SMALL };
    let mut stage = cornell(fine);
    // At half resolution texels are coarse in so small a picture: of light and its place as much is asked, of sharpness not.
    let blunt = Bounds { flip: None, ..bounds };
    for (resolution, bounds) in [(Resolution::Full, &bounds), (Resolution::Half, &blunt)] {
        stage.light_by(illumination(GiSettings { resolution, ..fine }));
        let picture = stage.settled_picture();
        let metrics = compare(&picture, &reference, bounds).unwrap_or_else(|error| panic!("{resolution:?}: {error}"));
        println!("{resolution:?}: {metrics:?}");
    }
    // The bounds would notice: without shadows there is too much light, with one bounce too little, and not there.
    for wrong in [GiSettings { visibility: VplVisibility::None, ..SMALL }, GiSettings { bounces: 1, ..SMALL }] {
        stage.light_by(illumination(wrong));
        let picture = stage.settled_picture();
        compare(&picture, &reference, &bounds).expect_err("the bounds are too wide to tell");
    }
}

#[test]
fn frames_are_the_same_to_the_byte_and_follow_every_change() {
    let mut stage = cornell(SMALL);
    let first = stage.picture();
    assert!(first.nonfinite() == 0 && !black(&first), "there is bounced light");
    assert!(first == stage.picture(), "two frames of a scene that does not change differ");
    assert!(first == cornell(SMALL).picture(), "the same scene started afresh differs");

    // Every setting is live, and going back gives the first picture again.
    let changed = [
        ("grid", GiSettings { grid: 24, ..SMALL }),
        ("range", GiSettings { range: 1.0, ..SMALL }),
        ("vpls", GiSettings { vpls: 512, ..SMALL }),
        ("bounces", GiSettings { bounces: 2, ..SMALL }),
        ("visibility", GiSettings { visibility: VplVisibility::None, ..SMALL }),
        ("resolution", GiSettings { resolution: Resolution::Half, ..SMALL }),
    ];
    for (name, settings) in changed {
        stage.light_by(illumination(settings));
        let picture = stage.settled_picture();
        let metrics = Metrics::new(&picture, &first).expect("sizes are equal");
        assert!(picture.nonfinite() == 0 && metrics.nrmse > 0.01, "{name} has no effect");
    }
    stage.light_by(illumination(SMALL));
    assert!(first == stage.settled_picture(), "a setting left something behind");

    // Light: off, on, moved, scaled, out of it. In the frame in which it changes.
    let lamp = stage.only::<SpotLight>();
    let intensity = stage.world().get::<SpotLight>(lamp).map_or(0.0, |light| light.intensity);
    let set = |stage: &mut Stage, value: f32| {
        if let Some(mut light) = stage.world().get_mut::<SpotLight>(lamp) {
            light.intensity = value;
        }
    };
    set(&mut stage, 0.0);
    assert!(black(&stage.picture()), "a light that is switched off bounces on");
    set(&mut stage, intensity * 2.0);
    let twice = stage.picture();
    assert!((twice.mean_luminance() / first.mean_luminance() - 2.0).abs() < 0.01, "twice the light");
    set(&mut stage, intensity);
    assert!(first == stage.picture(), "light that is back differs");
    stage.world().entity_mut(lamp).insert(GiLight::OFF);
    assert!(black(&stage.picture()), "GiLight::OFF bounces");
    stage.world().entity_mut(lamp).insert(GiLight { intensity: 0.5, ..default() });
    let half = stage.picture();
    assert!((half.mean_luminance() / first.mean_luminance() - 0.5).abs() < 0.01, "half the light");
    stage.world().entity_mut(lamp).insert(GiLight { bounces: 1, ..default() });
    assert!(stage.picture().mean_luminance() < 0.95 * first.mean_luminance(), "GiLight::bounces");
    stage.world().entity_mut(lamp).remove::<GiLight>();
    assert!(first == stage.picture(), "a marker left something behind");
    let place = *stage.world().get::<Transform>(lamp).expect("has a place");
    stage.world().entity_mut(lamp).insert(place.with_translation(place.translation + Vec3::X));
    assert!(first != stage.picture(), "a light that moved does not show");
    stage.world().entity_mut(lamp).insert(place);
    assert!(first == stage.picture(), "a light that moved back differs");

    meshes_follow(&mut stage, &first);

    // Without the component, then with it again.
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).remove::<GlobalIllumination>();
    stage.frame(Duration::ZERO);
    stage.light_by(illumination(SMALL));
    assert!(first == stage.settled_picture(), "a camera that lost and got bounced light differs");
    stage.light_by(GlobalIllumination { technique: Technique::None, ..default() });
    assert!(first != stage.settled_picture());
}

fn named(stage: &mut Stage, name: &str) -> Entity {
    let mut query = stage.world().query::<(Entity, &Name)>();
    let found = query.iter(stage.world()).find(|(_, n)| n.as_str() == name).map(|(entity, _)| entity);
    found.unwrap_or_else(|| panic!("no {name}"))
}

/// Hidden, moved, repainted, despawned, respawned.
fn meshes_follow(stage: &mut Stage, first: &Picture) {
    let wall = named(stage, "left");
    let reddish = |picture: &Picture| {
        let mean = picture.mean_of(0..64, 0..36);
        mean[0] / mean[1]
    };
    let red = reddish(first);
    stage.world().entity_mut(wall).insert(VoxelizedMesh::OFF);
    let without = stage.picture();
    assert!(reddish(&without) < 0.9 * red, "VoxelizedMesh::OFF reflects");
    stage
        .world()
        .entity_mut(wall)
        .insert(VoxelizedMesh { albedo: Some(Color::linear_rgb(0.0, 0.0, 0.9)), ..default() });
    let blue = stage.picture();
    assert!(reddish(&blue) < 0.9 * red && blue != without, "VoxelizedMesh::albedo");
    stage.world().entity_mut(wall).remove::<VoxelizedMesh>();
    assert!(*first == stage.picture(), "a marker left something behind");

    let block = named(stage, "short block");
    let place = *stage.world().get::<Transform>(block).expect("has a place");
    stage.world().entity_mut(block).insert(place.with_translation(place.translation + Vec3::Y));
    assert!(*first != stage.picture(), "a block that moved does not show");
    stage.world().entity_mut(block).insert(place);
    assert!(*first == stage.picture(), "a block that moved back differs");
    stage.world().entity_mut(block).insert(Visibility::Hidden);
    let hidden = stage.picture();
    assert!(*first != hidden, "a hidden block reflects");
    let mesh = stage.world().get::<Mesh3d>(block).expect("has a mesh").clone();
    let material = stage.world().get::<MeshMaterial3d<StandardMaterial>>(block).expect("has a material").clone();
    stage.world().despawn(block);
    assert!(hidden == stage.picture(), "a block that is gone is not the same as a hidden one");
    stage.world().spawn((mesh, material.clone(), place, Name::new("short block")));
    let back = stage.settled_picture();
    let bounds = Bounds { energy: Some((0.999, 1.001)), nrmse: Some(0.01), ..default() };
    compare(&back, first, &bounds).unwrap_or_else(|error| panic!("a block that came back: {error}"));

    let paint = |stage: &mut Stage, color: LinearRgba| {
        let mut materials = stage.world().resource_mut::<Assets<StandardMaterial>>();
        let mut paint = materials.get_mut(&material.0).expect("is there");
        std::mem::replace(&mut paint.base_color, color.into())
    };
    let was = paint(stage, LinearRgba::BLACK);
    let dark = stage.settled_picture();
    assert!(dark.mean_luminance() < 0.98 * back.mean_luminance(), "a repainted block reflects as before");
    paint(stage, was.into());
    assert!(back == stage.settled_picture(), "paint that is back differs");
}

/// What no scene should have, and what it should not break.
#[test]
fn bad_input_gives_a_sane_picture() {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::{Indices, PrimitiveTopology};

    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Camera3d::default(), Exposure { ev100: 6.0 }, Transform::from_xyz(0.0, 1.0, 4.0)));
        });
    });
    assert!(black(&stage.picture()), "nothing is lit in an empty scene");

    let floor = stage.world().resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(4.0, 4.0));
    let paint = stage.world().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    stage.world().spawn((Mesh3d(floor.clone()), MeshMaterial3d(paint.clone())));
    assert!(black(&stage.settled_picture()), "nothing is lit without a light");
    let light = PointLight { intensity: 50_000.0, ..default() };
    stage.world().spawn((light, Transform::from_xyz(0.5, 1.0, 0.5)));
    let wall = stage.world().resource_mut::<Assets<Mesh>>().add(Cuboid::new(2.0, 2.0, 0.1));
    stage.world().spawn((Mesh3d(wall), MeshMaterial3d(paint.clone()), Transform::from_xyz(0.0, 1.0, -1.0)));
    let good = stage.settled_picture();
    assert!(!black(&good) && good.nonfinite() == 0, "floor and wall light each other");

    let list = || Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default());
    let corners = vec![[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0]];
    let nan = vec![[f32::NAN, 0.0, 0.0], [0.3, f32::INFINITY, 0.0], [0.0, 0.3, 0.0]];
    let with = |mesh: Mesh, positions: Vec<[f32; 3]>| mesh.with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions);
    // A mesh without positions is left out: Bevy's own prepass stops the renderer on it.
    let bad = [
        ("no normals, indices or UVs", with(list(), corners.clone())),
        ("no vertices", with(list(), Vec::new())),
        ("indices without vertices", with(list(), Vec::new()).with_inserted_indices(Indices::U32(vec![0, 1, 2]))),
        (
            "indices beyond the vertices",
            with(list(), corners.clone()).with_inserted_indices(Indices::U16(vec![0, 1, 900])),
        ),
        ("half a triangle", with(list(), corners.clone()).with_inserted_indices(Indices::U16(vec![0, 1, 2, 0]))),
        ("NaN positions", with(list(), nan)),
        ("lines", with(Mesh::new(PrimitiveTopology::LineList, RenderAssetUsages::default()), corners)),
    ];
    for (name, mesh) in bad {
        let mesh = stage.world().resource_mut::<Assets<Mesh>>().add(mesh);
        let hidden = Transform::from_xyz(0.0, -3.0, 0.0);
        let entity = stage.world().spawn((Mesh3d(mesh), MeshMaterial3d(paint.clone()), hidden)).id();
        let picture = stage.settled_picture();
        assert!(picture.nonfinite() == 0 && !black(&picture), "{name}");
        stage.world().despawn(entity);
    }
    let bad = [
        ("scale of zero", Transform::from_scale(Vec3::ZERO)),
        ("flat", Transform::from_scale(Vec3::new(1.0, 0.0, 1.0))),
        ("NaN scale", Transform::from_scale(Vec3::NAN)),
        ("NaN place", Transform::from_translation(Vec3::NAN)),
        ("infinitely far", Transform::from_translation(Vec3::INFINITY)),
        ("mirrored", Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0))),
    ];
    for (name, transform) in bad {
        let entity = stage.world().spawn((Mesh3d(floor.clone()), MeshMaterial3d(paint.clone()), transform)).id();
        let picture = stage.settled_picture();
        assert!(picture.nonfinite() == 0 && !black(&picture), "{name}");
        stage.world().despawn(entity);
    }
    for (name, intensity, place) in [
        ("NaN light", f32::NAN, Vec3::Y),
        ("infinite light", f32::INFINITY, Vec3::Y),
        ("negative light", -1000.0, Vec3::Y),
        ("light nowhere", 1000.0, Vec3::NAN),
        ("light in a wall", 1000.0, Vec3::new(0.0, 1.0, -1.0)),
    ] {
        let light = PointLight { intensity, ..default() };
        let entity = stage.world().spawn((light, Transform::from_translation(place))).id();
        let picture = stage.settled_picture();
        assert_eq!(picture.nonfinite(), 0, "{name}");
        stage.world().despawn(entity);
    }
    assert!(good == stage.settled_picture(), "what is gone left something behind");
}

/// Two rooms that share a wall of 10 cm in a scene of 8 m, light in one and none in the other: percents of the light that are in
/// the dark one, by what lights see.
fn leaks<const N: usize>(visibilities: [VplVisibility; N]) -> [f64; N] {
    let fine = GiSettings { history: 0, probes: 0, ..Quality::default().settings() };
    let mut stage = Stage::new(SIZE, fine, |app| {
        app.add_systems(Startup, |mut build: Builder| {
            let white = build.paint([0.7; 3]);
            let walls = Walls {
                floor: white.clone(),
                ceiling: white.clone(),
                back: white.clone(),
                front: white.clone(),
                left: white.clone(),
                right: white.clone(),
            };
            build.room(Vec3::new(-4.0, 0.0, -2.0), Vec3::new(-0.05, 3.0, 2.0), &walls);
            build.room(Vec3::new(0.05, 0.0, -2.0), Vec3::new(4.0, 3.0, 2.0), &walls);
            build.commands.spawn((
                PointLight { intensity: 500_000.0, range: 100.0, ..default() },
                Transform::from_xyz(-2.0, 2.0, 0.3),
            ));
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 6.0 }, look(-1.0)));
        });
    });
    let camera = stage.only::<Camera3d>();
    visibilities.map(|visibility| {
        stage.light_by(illumination(GiSettings { visibility, ..fine }));
        let [bright, dark] = [-1.0, 1.0].map(|side| {
            stage.world().entity_mut(camera).insert(look(side));
            stage.settled_picture().mean_luminance()
        });
        assert!(bright > 1.0, "the bright room is lit: {bright}");
        let percent = 100.0 * dark / bright;
        println!("{visibility:?}: {percent:.4} % of the light is in the dark room");
        percent
    })
}

#[test]
fn a_sealed_room_stays_dark() {
    for percent in leaks([VplVisibility::Atlas, VplVisibility::Ism, VplVisibility::Voxel]) {
        assert!(percent < 0.5, "{percent:.2} % of the light is in the dark room");
    }
}

/// From the far end of one room towards the wall that it shares.
fn look(side: f32) -> Transform {
    Transform::from_xyz(3.7 * side, 1.5, 1.2).looking_at(Vec3::new(0.0, 1.5, -0.4), Vec3::Y)
}

#[test]
fn plugins_without_a_camera_leave_bevys_picture() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let file = SceneFile::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let picture = |plain_bevy: bool| {
        let run = Run { plain_bevy, ..run(SIZE, None) };
        let plugin = GltfScenePlugin {
            file: file.clone(),
            camera: camera.clone(),
            matte: false,
            flip_textures: false,
            bake: None,
        };
        Stage::with_assets(run, Some(file.folder()), |app| {
            app.add_plugins(plugin);
        })
        .picture()
    };
    let (ours, bevys) = (picture(false), picture(true));
    let metrics = Metrics::new(&ours, &bevys).expect("sizes are equal");
    assert!(bevys.mean_luminance() > 1.0 && metrics.flip <= 0.005, "{metrics:?}");
}

/// Light between shaded pixels is that of its surface, and pixels without neighbours are shaded themselves.
#[test]
fn half_resolution_is_near_full() {
    let mut stage = Stage::new(UVec2::new(160, 90), SMALL, |app| {
        app.add_plugins(CornellPlugin);
    });
    for visibility in [VplVisibility::None, VplVisibility::Voxel, VplVisibility::Atlas] {
        let mut picture = |resolution| {
            stage.light_by(illumination(GiSettings { visibility, resolution, ..SMALL }));
            stage.settled_picture()
        };
        let (full, half) = (picture(Resolution::Full), picture(Resolution::Half));
        let metrics = Metrics::new(&half, &full).expect("sizes are equal");
        println!("{visibility:?}: {metrics:?}");
        let lit = |picture: &Picture| picture.pixels.iter().filter(|pixel| **pixel != [0.0; 3]).count();
        assert!(
            lit(&half).abs_diff(lit(&full)) < 30,
            "{} pixels are lit, {} at full resolution",
            lit(&half),
            lit(&full)
        );
        assert!(half.nonfinite() == 0 && (metrics.energy - 1.0).abs() < 0.02, "{metrics:?}");
    }
}

/// A closed box whose walls emit: light goes on for ever, and has a closed form. Without occlusion it must be even, too.
#[test]
fn a_furnace_has_its_closed_form() {
    let (emitted, albedo) = (10.0, 0.5);
    let settings = GiSettings { vpls: 1024, bounces: 12, ..SMALL };
    let mut stage = Stage::new(SIZE, settings, |app| {
        app.add_systems(Startup, move |mut build: Builder| {
            let paint = build.materials.add(StandardMaterial {
                base_color: Color::linear_rgb(albedo, albedo, albedo),
                perceptual_roughness: 1.0,
                reflectance: 0.0,
                emissive: LinearRgba::rgb(emitted, emitted, emitted),
                emissive_exposure_weight: 1.0,
                ..default()
            });
            let [floor, ceiling, back, front, left, right] = std::array::from_fn(|_| paint.clone());
            let walls = Walls { floor, ceiling, back, front, left, right };
            build.room(Vec3::splat(-1.5), Vec3::splat(1.5), &walls);
            let place = Transform::from_xyz(0.3, 0.2, 1.2).looking_at(Vec3::new(-0.2, -0.1, -1.5), Vec3::Y);
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 4.0 }, place));
        });
    });
    let picture = stage.picture();
    let expected = emitted * albedo / (1.0 - albedo);
    let mean = picture.mean_luminance() as f32;
    assert!((mean / expected - 1.0).abs() < 0.1, "mean {mean} cd/m^2, expected {expected}");
    // Corners are darker by the bound of the geometry term, lights close by are bright: most of it is within a quarter.
    let near = picture.pixels.iter().filter(|pixel| (pixel[1] / expected - 1.0).abs() < 0.25).count();
    assert!(near * 10 > picture.pixels.len() * 8, "{near} of {} pixels are near {expected}", picture.pixels.len());
}

/// A shut door keeps light out in the frame in which it shuts, and lets it in again.
#[test]
fn light_comes_and_goes_with_doors() {
    let settings = GiSettings { grid: 64, vpls: 1024, ..SMALL };
    let mut stage = Stage::new(SIZE, settings, |app| {
        app.add_plugins(DoorsPlugin);
    });
    let open = stage.picture();
    let mut after = |seconds: f32| {
        stage.frame(Duration::from_secs_f32(seconds));
        stage.captured()
    };
    let shut = after(DoorsPlugin::SHUT);
    let leak = shut.mean_luminance() / open.mean_luminance();
    println!("{leak:.4} of the light is there with all doors shut");
    assert!(leak < 0.02, "{leak} of the light comes through doors that are shut");
    assert!(after(DoorsPlugin::CYCLE - DoorsPlugin::SHUT) == open, "doors that open again let other light in");
}

/// Bevy would draw masked surfaces once more, over their bounced light.
#[test]
fn a_masked_surface_that_is_whole_looks_like_an_opaque_one() {
    let mut stage = cornell(SMALL);
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(GiIsolate::All);
    let opaque = stage.settled_picture();
    let mask = |stage: &mut Stage, alpha_mode: AlphaMode| {
        for (_, material) in stage.world().resource_mut::<Assets<StandardMaterial>>().iter_mut() {
            material.alpha_mode = alpha_mode;
        }
    };
    mask(&mut stage, AlphaMode::Mask(0.5));
    assert!(!black(&opaque) && opaque == stage.settled_picture(), "masked surfaces differ");
    mask(&mut stage, AlphaMode::Opaque);
    assert!(opaque == stage.settled_picture(), "a mask left something behind");
}

/// A skinned animal: its bounced light depends on the time alone, however that was reached.
#[test]
fn a_skinned_mesh_has_no_lag() {
    let stage = || {
        Stage::new(SIZE, SMALL, |app| {
            app.add_plugins(AnimalPlugin);
        })
    };
    let (mut by_frames, mut at_once) = (stage(), stage());
    let start = by_frames.picture();
    for _ in 0..15 {
        by_frames.frame(Duration::from_millis(100));
    }
    at_once.frame(Duration::from_millis(1500));
    let later = by_frames.picture();
    assert!(later == at_once.picture(), "how the time was reached shows");
    let metrics = Metrics::new(&later, &start).expect("sizes are equal");
    assert!(metrics.nrmse > 0.01, "an animal that walks does not show: {metrics:?}");
    // And in the very frame in which it moves: the step and the picture of it are one frame.
    let mut third = stage();
    third.frame(Duration::from_millis(1500));
    assert!(later == third.captured(), "bounced light is a frame late");
}

/// Light takes the colour of the texture where it falls, not of the mean of all of it.
#[test]
fn a_textured_wall_reflects_what_is_on_it() {
    use bevy::asset::RenderAssetUsages;
    use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

    let mut stage = Stage::new(SIZE, SMALL, |app| {
        app.add_systems(Startup, |mut build: Builder, mut images: ResMut<Assets<Image>>| {
            // Red on the left, green on the right.
            let texels = (0..32 * 32).flat_map(|i| if i % 32 < 16 { [255, 0, 0, 255] } else { [0, 255, 0, 255] });
            let image = Image::new(
                Extent3d { width: 32, height: 32, depth_or_array_layers: 1 },
                TextureDimension::D2,
                texels.collect(),
                TextureFormat::Rgba8UnormSrgb,
                RenderAssetUsages::default(),
            );
            let paint = build.materials.add(StandardMaterial {
                base_color_texture: Some(images.add(image)),
                perceptual_roughness: 1.0,
                ..default()
            });
            let white = build.paint([0.8; 3]);
            build.panel(Vec3::new(-3.0, 0.0, -1.0), Vec3::X * 6.0, Vec3::Y * 3.0, &paint);
            build.panel(Vec3::new(-3.0, 0.0, -1.0), Vec3::Z * 3.0, Vec3::X * 6.0, &white);
            for x in [-1.5, 1.5] {
                let light = SpotLight { intensity: 100_000.0, range: 50.0, outer_angle: 0.5, ..default() };
                let place = Transform::from_xyz(x, 1.5, 1.5).looking_at(Vec3::new(x, 1.5, -1.0), Vec3::Y);
                build.commands.spawn((light, place));
            }
            let place = Transform::from_xyz(0.0, 2.5, 4.0).looking_at(Vec3::new(0.0, 0.0, 0.0), Vec3::Y);
            build.commands.spawn((Camera3d::default(), Exposure { ev100: 7.0 }, place));
        });
    });
    let picture = stage.settled_picture();
    let (left, right) = (picture.mean_of(10..26, 20..34), picture.mean_of(38..54, 20..34));
    assert!(left[0] > 2.0 * left[1], "the floor before the red half is red: {left:?}");
    assert!(right[1] > 2.0 * right[0], "the floor before the green half is green: {right:?}");
}
