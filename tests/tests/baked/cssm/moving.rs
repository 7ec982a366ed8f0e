//! Baked objects that move: the Cornell box without its short block, and that block.

use std::path::Path;
use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::cssm::times_lit;
use bevy_bounce::{CssmObject, CssmPart, CssmSettings, GiSettings, GlobalIllumination, Quality, Technique, gpu_memory};
use bevy_bounce_cssm::CssmAsset;
use bevy_bounce_examples::scenes::CornellBox;
use bevy_bounce_tests::baked::{cornell_box, cornell_box_in_two};
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::committed_file;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

/// Half the references'.
const SIZE: UVec2 = UVec2::new(64, 36);
/// The references' own. The mean of a smaller picture jumps by itself, as single pixels of a bright side come into sight.
const FULL_SIZE: UVec2 = UVec2::new(128, 72);
/// For what takes no measure of light.
const SMALL_SIZE: UVec2 = UVec2::new(32, 18);

fn radiosity(error: f32, bounces: u32) -> GlobalIllumination {
    let settings = GiSettings { bounces, cssm: CssmSettings { error, ..CssmSettings::DEFAULT }, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// Poses of the block: where it is modelled, floating and tilted, and before the tall one.
fn poses() -> [Transform; 3] {
    let [sine, cosine] = CornellBox::BLOCKS[1].half_turn;
    let tilt = Quat::from_axis_angle(Vec3::new(1.0, 1.0, 0.0).normalize(), 0.6);
    [
        Transform::from_translation(CornellBox::BLOCKS[1].base).with_rotation(Quat::from_xyzw(0.0, sine, 0.0, cosine)),
        Transform::from_xyz(0.5, 1.3, 0.7).with_rotation(tilt),
        Transform::from_xyz(-0.9, 0.0, 1.1).with_rotation(Quat::from_rotation_y(0.5)),
    ]
}

/// The node of the short block.
pub(super) fn block(stage: &mut Stage) -> Entity {
    let name = CornellBox::BLOCKS[1].name;
    let mut names = stage.world().query::<(Entity, &Name)>();
    names.iter(stage.world()).find(|(_, found)| found.as_str() == name).expect("is in the scene").0
}

pub(super) fn bake(stage: &mut Stage, entity: Entity, file: bevy_bounce_cssm::CssmFile) {
    let bake = stage.world().resource_mut::<Assets<CssmAsset>>().add(CssmAsset { file });
    stage.world().entity_mut(entity).insert(CssmObject { bake });
}

/// Atlases of the room and the block whose texels are about as large as those of the whole box's test bake.
const ATLASES: [u32; 2] = [64, 24];
/// Light from a bake is the closer to its reference the finer its texels are.
const FINE_ATLASES: [u32; 2] = [112, 40];
/// For what takes no measure of light.
const SMALL_ATLASES: [u32; 2] = [32, 16];

/// The room and the block, each with its own bake. Returns the block.
fn in_two(size: UVec2, illumination: GlobalIllumination, atlases: [u32; 2]) -> (Stage, Entity) {
    let mut stage = Stage::of_asset("cornell_box.glb", run(size, Some(illumination)), true, None);
    let (root, block) = (stage.only::<WorldAssetRoot>(), block(&mut stage));
    let [room_bake, block_bake] = cornell_box_in_two(atlases);
    bake(&mut stage, root, room_bake);
    bake(&mut stage, block, block_bake);
    stage.settled_picture();
    (stage, block)
}

/// The path-traced picture of a pose.
fn reference(pose: usize) -> Picture {
    let file = committed_file(&format!("moving_block.{pose}.indirect.exr"));
    Picture::load(&file).unwrap_or_else(|error| panic!("{error}"))
}

fn place(stage: &mut Stage, entity: Entity, place: Transform) {
    stage.world().entity_mut(entity).insert(place);
}

#[test]
fn two_bakes_light_as_one_does() {
    let whole = Some(cornell_box().clone());
    let whole = Stage::of_asset("cornell_box.glb", run(SIZE, Some(radiosity(2.0, 6))), true, whole).picture();
    let (mut stage, block) = in_two(SIZE, radiosity(2.0, 6), ATLASES);
    let bounds = Bounds { energy: Some((0.97, 1.03)), low: Some(0.1), flip: Some(0.06), nrmse: None };
    let metrics = compare(&stage.picture(), &whole, &bounds).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    // The bounds would notice: without its bake the block neither reflects nor hides.
    stage.world().entity_mut(block).remove::<CssmObject>();
    compare(&stage.picture(), &whole, &bounds).expect_err("the bounds are too wide to tell");
}

/// While everything rests, pixels keep their light; another bake changes it all the same.
#[test]
fn a_bake_that_comes_shows_where_everything_rests() {
    const HISTORY: u32 = 4;
    let GlobalIllumination { quality: Quality::Custom(settings), .. } = radiosity(1.0, 3) else {
        panic!("its settings are stated");
    };
    let quality = Quality::Custom(GiSettings { history: HISTORY, ..settings });
    let light = GlobalIllumination { quality, ..radiosity(1.0, 3) };
    let rested = |stage: &mut Stage| {
        (0..4 * HISTORY).for_each(|_| stage.frame(Duration::ZERO));
        stage.picture()
    };
    let mut stage = Stage::of_asset("cornell_box.glb", run(SMALL_SIZE, Some(light.clone())), true, None);
    let (root, block) = (stage.only::<WorldAssetRoot>(), block(&mut stage));
    let [room_bake, block_bake] = cornell_box_in_two(SMALL_ATLASES);
    bake(&mut stage, root, room_bake);
    let alone = rested(&mut stage);
    bake(&mut stage, block, block_bake);
    let both = rested(&mut stage);
    let expected = rested(&mut in_two(SMALL_SIZE, light, SMALL_ATLASES).0);
    let bounds = Bounds { energy: Some((0.99, 1.01)), low: Some(0.02), flip: None, nrmse: None };
    let metrics = compare(&both, &expected, &bounds).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    compare(&alone, &expected, &bounds).expect_err("the bounds are too wide to tell");
}

/// The block in each of the poses has the light of that pose's reference: `tests/data/moving_block.N.indirect.exr` are path-traced.
fn assert_poses_equal_their_references(numbers: &[usize]) {
    let bounds = Bounds { energy: Some((0.93, 1.07)), low: Some(0.2), flip: None, nrmse: None };
    let (mut stage, block) = in_two(FULL_SIZE, radiosity(16.0, 10), FINE_ATLASES);
    let poses = poses();
    for &number in numbers {
        place(&mut stage, block, poses[number]);
        let picture = stage.picture();
        let reference = reference(number);
        if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
            let show = |picture: &Picture| picture.map(|pixel| pixel.map(|c| c / 60.0));
            for (name, picture) in [("light", &picture), ("reference", &reference)] {
                let path = Path::new(&folder).join(format!("moving_block.{number}.{name}.png"));
                show(picture).save(&path).unwrap_or_else(|error| panic!("{error}"));
            }
        }
        let metrics = compare(&picture, &reference, &bounds).unwrap_or_else(|error| panic!("pose {number}: {error}"));
        println!("pose {number}: {metrics:?}");
        let wrong = Metrics::new(&picture, &self::reference((number + 1) % 3)).expect("sizes are equal");
        assert!(wrong.nrmse > 1.5 * metrics.nrmse, "it might as well be another pose: {wrong:?}");
    }
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn a_pose_equals_its_reference() {
    assert_poses_equal_their_references(&[1]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_pose_equals_its_reference() {
    assert_poses_equal_their_references(&[0, 1, 2]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn nothing_pops_while_an_object_moves() {
    const STEPS: usize = 60;
    let (mut stage, block) = in_two(FULL_SIZE, radiosity(16.0, 2), ATLASES);
    let [from, through, to] = poses();
    let mut means = Vec::new();
    for step in 0..=STEPS {
        let along = 2.0 * step as f32 / STEPS as f32;
        let (a, b, part) = if along < 1.0 { (from, through, along) } else { (through, to, along - 1.0) };
        // It rests at each pose, so that only light could jump.
        let part = part * part * (3.0 - 2.0 * part);
        let pose = Transform {
            translation: a.translation.lerp(b.translation, part),
            rotation: a.rotation.slerp(b.rotation, part),
            ..default()
        };
        let times = times_lit(stage.render_world());
        place(&mut stage, block, pose);
        means.push(stage.picture().mean_luminance());
        assert!(step == 0 || times_lit(stage.render_world()) == times + 1, "step {step}: texels are not lit anew");
    }
    let mean = means.iter().sum::<f64>() / means.len() as f64;
    let steps: Vec<f64> = means.windows(2).map(|pair| (pair[1] - pair[0]) / mean).collect();
    let jumps = steps.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let (largest, jump) = (steps.iter().fold(0.0, |a: f64, b| a.max(b.abs())), jumps.fold(0.0, f64::max));
    println!("mean {mean:.3} cd/m^2, largest step {largest:.4}, largest change of it {jump:.4}");
    assert!(largest < 0.03, "a step of {largest} of the mean: {means:?}");
    assert!(jump < 0.015, "a step that differs by {jump} of the mean from the last: {means:?}");
    // Back at rest, nothing is computed.
    let times = times_lit(stage.render_world());
    let rest = stage.picture();
    assert!(rest == stage.picture() && times_lit(stage.render_world()) == times, "light of a scene at rest changes");
}

/// Two objects of one bake share what is not light.
#[test]
fn a_bake_is_held_once() {
    let (mut stage, block) = in_two(SMALL_SIZE, radiosity(16.0, 2), SMALL_ATLASES);
    let alone = stage.picture();
    let before = gpu_memory(stage.render_world_mut());
    let bake = stage.world().get::<CssmObject>(block).expect("is baked").clone();
    let mut meshes = stage.world().query::<(&ChildOf, &Mesh3d, &MeshMaterial3d<StandardMaterial>)>();
    let (_, mesh, material) = meshes.iter(stage.world()).find(|(parent, ..)| parent.0 == block).expect("has a mesh");
    let twin = (mesh.clone(), material.clone(), bake, CssmPart(0), poses()[2]);
    let twin = stage.world().spawn(twin).id();
    let both = stage.settled_picture();
    let after = gpu_memory(stage.render_world_mut());
    assert_eq!(before["cssm: maps"], after["cssm: maps"]);
    assert!(before["cssm: light"] < after["cssm: light"]);
    let metrics = Metrics::new(&both, &alone).expect("sizes are equal");
    assert!(metrics.nonfinite == 0 && metrics.nrmse > 0.05, "the second block has no effect: {metrics:?}");
    stage.world().despawn(twin);
    stage.frame(Duration::ZERO);
    assert!(alone == stage.picture(), "what is gone left something behind");
}
