//! Bounced light by caches alone against path-traced references of whole scenes.

use bevy::prelude::*;
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, Technique};
use bevy_bounce_tests::metrics::{Bounds, compare};
use bevy_bounce_tests::references::{save_if_asked, shared_reference};
use bevy_bounce_tests::stage::{Stage, run};

/// The default quality, with as many bounces as the references have and each frame by itself.
fn cached(bounces: u32) -> GlobalIllumination {
    let settings = GiSettings { bounces, history: 0, ..GiSettings::default() };
    GlobalIllumination { technique: Technique::RadianceCache, quality: Quality::Custom(settings), ..default() }
}

/// The scene's bounced light is that of its reference, and one bounce of it is not.
fn assert_agreement(name: &str) {
    const BOUNDS: Bounds = Bounds { energy: Some((0.85, 1.15)), low: Some(0.25), flip: None, nrmse: None };
    let Some((scene, reference)) = shared_reference(name) else { return };
    let size = UVec2::new(reference.width as u32, reference.height as u32);
    let mut stage = Stage::of_asset(&scene.to_string_lossy(), run(size, Some(cached(8))), true, None);
    let picture = stage.picture();
    save_if_asked(&picture, &format!("{name}.caches.exr"));
    let metrics = compare(&picture, &reference, &BOUNDS).unwrap_or_else(|error| panic!("{name}: {error}"));
    println!("{name}: {metrics:?}");
    stage.light_by(cached(1));
    compare(&stage.settled_picture(), &reference, &BOUNDS).expect_err("the bounds are too wide to tell");
}

#[test]
fn cornell_spot_equals_its_reference() {
    assert_agreement("cornell_spot");
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn u_room_equals_its_reference() {
    assert_agreement("u_room");
}
