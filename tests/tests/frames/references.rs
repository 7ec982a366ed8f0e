//! Bounced light by virtual lights against path-traced references of whole scenes.

use std::path::Path;

use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality};
use bevy_bounce_examples::gltf::{GltfScenePlugin, SceneFile};
use bevy_bounce_tests::metrics::{Bounds, Metrics};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::{committed_file, save_if_asked, shared_file, shared_reference};
use bevy_bounce_tests::stage::{Stage, illumination, run};

const SMALL_SCENE: Bounds = Bounds { energy: Some((0.95, 1.05)), low: Some(0.15), flip: Some(0.10), nrmse: None };
const CORNER: Bounds = Bounds { low: Some(0.20), flip: Some(0.11), ..SMALL_SCENE };
const ULTRA: Bounds = Bounds { low: Some(0.10), flip: Some(0.07), ..SMALL_SCENE };
const ULTRA_CORNER: Bounds = Bounds { low: Some(0.13), ..ULTRA };
const LARGE_SCENE: Bounds = Bounds { energy: Some((0.90, 1.10)), low: Some(0.30), flip: None, nrmse: None };

/// With as many bounces as the references have, and each frame by itself.
fn lit(quality: Quality) -> GlobalIllumination {
    illumination(GiSettings { bounces: 8, history: 0, ..quality.settings() })
}

/// How far the light of a scene is from its reference.
fn measure(name: &str, scene: &Path, reference: &Picture, quality: Quality) -> Metrics {
    let file = SceneFile::open(scene).unwrap_or_else(|error| panic!("{error}"));
    let camera = file.camera(None).unwrap_or_else(|error| panic!("{error}")).cloned();
    let size = UVec2::new(reference.width as u32, reference.height as u32);
    // The references have the textures the other way up.
    let flip_textures = true;
    let mut stage = Stage::with_assets(run(size, Some(lit(quality))), Some(file.folder()), |app| {
        app.add_plugins(GltfScenePlugin { file, camera, matte: true, flip_textures, bake: None });
    });
    let picture = stage.picture();
    save_if_asked(&picture, &format!("{name}.{quality:?}.exr"));
    let metrics = Metrics::new(&picture, reference).unwrap_or_else(|error| panic!("{name}: {error}"));
    println!("{name}, {quality:?}: {metrics:?}");
    metrics
}

fn assert_agreement(scenes: &[(&str, &Bounds)], quality: Quality) {
    let broken = scenes.iter().filter_map(|(name, bounds)| {
        let (scene, reference) = shared_reference(name)?;
        let outcome = measure(name, &scene, &reference, quality).check(bounds);
        outcome.err().map(|error| format!("{name}: {error}"))
    });
    let broken: Vec<String> = broken.collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn boxes_equal_their_references() {
    let scenes = [("cornell_spot", &SMALL_SCENE), ("cornell_point", &SMALL_SCENE), ("corner", &CORNER)];
    assert_agreement(&scenes, Quality::default());
}

#[test]
fn a_room_around_two_bends_equals_its_reference() {
    assert_agreement(&[("u_room", &SMALL_SCENE)], Quality::default());
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn the_best_quality_equals_references_closely() {
    let scenes = [("cornell_spot", &ULTRA), ("cornell_point", &ULTRA), ("corner", &ULTRA_CORNER), ("u_room", &ULTRA)];
    assert_agreement(&scenes, Quality::Ultra);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn a_church_and_furnished_rooms_equal_their_references() {
    let scenes = ["sibenik", "breakfast_room", "living_room"].map(|name| (name, &LARGE_SCENE));
    assert_agreement(&scenes, Quality::default());
}

/// Beside a reference that is sunlit through the holes of leaves and sees through them without a bounce: see `data/README.md`.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn an_atrium_with_masked_plants_equals_its_reference() {
    let Some(scene) = shared_file("scenes/sponza.glb") else { return };
    let reference = Picture::load(&committed_file("sponza.indirect.exr")).unwrap_or_else(|error| panic!("{error}"));
    let outcome = measure("sponza", &scene, &reference, Quality::default()).check(&LARGE_SCENE);
    outcome.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
#[ignore = "not met: low 0.328 of 0.30, for this reference takes holes of leaves for bounces"]
fn an_atrium_equals_a_reference_without_holes() {
    assert_agreement(&[("sponza", &LARGE_SCENE)], Quality::default());
}
