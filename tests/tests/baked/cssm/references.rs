//! Light from bakes of whole scenes against path-traced references.

use std::path::Path;

use bevy::prelude::*;
use bevy_bounce::{CssmSettings, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::CssmFile;
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_tests::metrics::{Bounds, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::shared_file;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

/// As many as the references have.
const BOUNCES: u32 = 8;
const BOUNDS: Bounds = Bounds { energy: Some((0.95, 1.05)), low: Some(0.12), flip: Some(0.08), nrmse: None };

fn radiosity(bounces: u32, error: f32) -> GlobalIllumination {
    let settings = GiSettings { bounces, cssm: CssmSettings { error, ..CssmSettings::DEFAULT }, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

/// By the baker's own settings: an atlas of 128, cube maps of 64.
pub(super) fn baked(path: &Path) -> CssmFile {
    let source = Source::open(path).unwrap_or_else(|error| panic!("{error}"));
    let scene = Scene::from_gltf(&source).unwrap_or_else(|error| panic!("{error}"));
    bake(&scene, &BakeSettings::default(), &()).unwrap_or_else(|error| panic!("{error}")).0
}

/// The scene's bounced light is that of its reference. Cuts are as coarse as `Quality::Medium` has them. Where the scene and its
/// reference are, returns both.
fn assert_agreement(name: &str) -> Option<(Stage, Picture)> {
    let scene = shared_file(&format!("scenes/{name}.glb"));
    let (path, reference) = scene.zip(shared_file(&format!("references/{name}.indirect.exr")))?;
    let reference = Picture::load(&reference).unwrap_or_else(|error| panic!("{error}"));
    let size = UVec2::new(reference.width as u32, reference.height as u32);
    let bake = baked(&path);
    let file = SceneFile::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let folder = file.folder();
    let mut stage = Stage::with_assets(run(size, Some(radiosity(BOUNCES, 16.0))), Some(folder), |app| {
        app.add_plugins(GltfScenePlugin { file, camera, matte: true, flip_textures: false, bake: Some(bake) });
    });
    let picture = stage.picture();
    if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
        let path = Path::new(&folder).join(format!("{name}.cssm.exr"));
        picture.save(&path).unwrap_or_else(|error| panic!("{error}"));
    }
    let metrics = compare(&picture, &reference, &BOUNDS).unwrap_or_else(|error| panic!("{name}: {error}"));
    println!("{name}: {metrics:?}");
    Some((stage, reference))
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn u_room_equals_its_reference() {
    let Some((mut stage, reference)) = assert_agreement("u_room") else { return };
    // The bounds would notice: without what bounces twice there is too little.
    stage.light_by(radiosity(1, 16.0));
    compare(&stage.settled_picture(), &reference, &BOUNDS).expect_err("the bounds are too wide to tell");
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn cornell_spot_equals_its_reference() {
    assert_agreement("cornell_spot");
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn corner_equals_its_reference() {
    assert_agreement("corner");
}
