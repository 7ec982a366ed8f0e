//! Light from bakes of whole scenes against path-traced references.

use bevy::prelude::*;
use bevy_bounce::{CssmSettings, GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::CssmFile;
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_tests::metrics::{Bounds, Metrics};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::shared_file;
use bevy_bounce_tests::stage::{SMALL, Stage, run};

const BOUNDS: Bounds = Bounds { energy: Some((0.95, 1.05)), low: Some(0.12), flip: Some(0.08), nrmse: None };

fn radiosity(bounces: u32, error: f32) -> GlobalIllumination {
    let settings = GiSettings { bounces, cssm: CssmSettings { error, ..CssmSettings::DEFAULT }, ..SMALL };
    GlobalIllumination { technique: Technique::SurfaceRadiosity, quality: Quality::Custom(settings), ..default() }
}

fn baked(path: &std::path::Path, settings: &BakeSettings) -> CssmFile {
    let source = Source::open(path).unwrap_or_else(|error| panic!("{error}"));
    let scene = Scene::from_gltf(&source).unwrap_or_else(|error| panic!("{error}"));
    bake(&scene, settings, &()).unwrap_or_else(|error| panic!("{error}")).0
}

/// Whether the scene's bounced light is that of its reference; `None` where they are absent.
fn metrics(name: &str, errors: &[f32]) -> Option<Vec<Metrics>> {
    let path = shared_file(&format!("scenes/{name}.glb"))?;
    let reference = Picture::load(&shared_file(&format!("references/{name}.indirect.exr"))?).expect("is a picture");
    let size = UVec2::new(reference.width as u32, reference.height as u32);
    let bake = baked(&path, &BakeSettings::default());
    let file = SceneFile::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let folder = file.folder();
    // As many bounces as the reference has.
    let mut stage = Stage::with_assets(run(size, Some(radiosity(8, errors[0]))), Some(folder), |app| {
        app.add_plugins(GltfScenePlugin { file, camera, matte: true, flip_textures: false, bake: Some(bake) });
    });
    let found = errors.iter().map(|&error| {
        stage.light_by(radiosity(8, error));
        let started = std::time::Instant::now();
        let picture = stage.picture();
        let metrics = Metrics::new(&picture, &reference).expect("sizes are equal");
        println!("{name}, error {error}: {metrics:?}, {:.1} s", started.elapsed().as_secs_f32());
        if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
            let path = std::path::Path::new(&folder).join(format!("{name}.cssm.{error}.exr"));
            picture.save(&path).unwrap_or_else(|error| panic!("{error}"));
        }
        metrics
    });
    Some(found.collect())
}

fn assert_agreement(name: &str) {
    let errors: Vec<f32> = match std::env::var("ERRORS") {
        Ok(list) => list.split(',').map(|error| error.parse().expect("a number")).collect(),
        Err(_) => vec![16.0],
    };
    for metrics in metrics(name, &errors).into_iter().flatten() {
        metrics.check(&BOUNDS).unwrap_or_else(|error| panic!("{name}: {error}; {metrics:?}"));
    }
}

#[test]
fn cornell_spot_equals_its_reference() {
    assert_agreement("cornell_spot");
}

#[test]
fn u_room_equals_its_reference() {
    assert_agreement("u_room");
}

#[test]
fn corner_equals_its_reference() {
    assert_agreement("corner");
}
