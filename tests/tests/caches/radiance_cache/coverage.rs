//! Every pixel of the G-buffer has light from a cache, in whole frames.

use std::time::Duration;

use bevy::camera::primitives::Aabb;
use bevy::prelude::*;
use bevy_bounce::radiance_cache::{CacheCounts, cache_counts};
use bevy_bounce::{GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, Technique};
use bevy_bounce_examples::scenes::{
    AnimalPlugin, BuddhaBoxPlugin, ChurchPlugin, CornellPlugin, CrowdPlugin, DoorsPlugin, HeadsPlugin,
    NightMarketPlugin, OfficePlugin, SeeThroughPlugin, ShowroomPlugin, TownPlugin, URoomPlugin, VillagePlugin,
};
use bevy_bounce_tests::references::shared_file;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination, run};
use bevy_bounce_tests::twins::random::Random;

use super::stage::cached;

const SIZE: UVec2 = UVec2::new(128, 72);

/// Caches alone, and beside virtual lights.
fn lights() -> [GlobalIllumination; 2] {
    let glossy = RadianceCacheSettings { glossy: true, ..default() };
    [cached(SMALL), illumination(GiSettings { radiance_cache: glossy, ..SMALL })]
}

/// What the only view's caches came to.
fn counts(stage: &mut Stage) -> CacheCounts {
    let counts = cache_counts(stage.render_world_mut());
    assert_eq!(counts.len(), 1, "{counts:?}");
    counts[0]
}

fn assert_covered(name: &str, stage: &mut Stage) {
    for light in lights() {
        let technique = light.technique;
        stage.light_by(light);
        stage.settled_picture();
        let counts = counts(stage);
        println!("{name}, {technique:?}: {counts:?}");
        assert!(counts.pixels > 0 && counts.caches > 0, "{name}: nothing is seen: {counts:?}");
        assert_eq!(counts.missing, 0, "{name}, {technique:?}: {counts:?}");
    }
}

fn assert_scenes_are_covered(names: &[&str]) {
    for name in names {
        let Some(file) = shared_file(&format!("scenes/{name}.glb")) else { return };
        let mut stage = Stage::of_asset(&file.to_string_lossy(), run(SIZE, Some(cached(SMALL))), false, None);
        assert_covered(name, &mut stage);
    }
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_pixel_has_light_in_plain_scenes() {
    assert_scenes_are_covered(&["cornell_point", "cornell_spot", "corner", "furnace", "u_room", "sibenik"]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_pixel_has_light_in_textured_scenes() {
    assert_scenes_are_covered(&["bathroom", "breakfast_room", "living_room", "sponza"]);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_pixel_has_light_in_generated_scenes() {
    for name in ["cornell_box.glb", "glossy_box.glb"] {
        assert_covered(name, &mut Stage::of_asset(name, run(SIZE, Some(cached(SMALL))), false, None));
    }
    let scenes: [(&str, fn(&mut App)); 14] = [
        ("animal", |app| _ = app.add_plugins(AnimalPlugin)),
        ("buddha box", |app| _ = app.add_plugins(BuddhaBoxPlugin)),
        ("church", |app| _ = app.add_plugins(ChurchPlugin)),
        ("cornell", |app| _ = app.add_plugins(CornellPlugin)),
        ("crowd", |app| _ = app.add_plugins(CrowdPlugin)),
        ("doors", |app| _ = app.add_plugins(DoorsPlugin)),
        ("heads", |app| _ = app.add_plugins(HeadsPlugin)),
        ("night market", |app| _ = app.add_plugins(NightMarketPlugin)),
        ("office", |app| _ = app.add_plugins(OfficePlugin)),
        ("see through", |app| _ = app.add_plugins(SeeThroughPlugin)),
        ("showroom", |app| _ = app.add_plugins(ShowroomPlugin)),
        ("town", |app| _ = app.add_plugins(TownPlugin)),
        ("u room", |app| _ = app.add_plugins(URoomPlugin)),
        ("village", |app| _ = app.add_plugins(VillagePlugin)),
    ];
    for (name, scene) in scenes {
        let mut stage = Stage::with_run(run(SIZE, Some(cached(SMALL))), scene);
        assert_covered(name, &mut stage);
    }
}

/// The box of all meshes.
fn bounds(stage: &mut Stage) -> (Vec3, Vec3) {
    let mut meshes = stage.world().query::<(&Aabb, &GlobalTransform)>();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (aabb, transform) in meshes.iter(stage.world()) {
        for corner in 0..8 {
            let sign = |bit: u32| if corner & bit == 0 { -1.0 } else { 1.0 };
            let local = aabb.center + aabb.half_extents * Vec3::new(sign(1), sign(2), sign(4)).to_vec3a();
            let place = transform.transform_point(local.into());
            (low, high) = (low.min(place), high.max(place));
        }
    }
    (low, high)
}

#[test]
fn every_pixel_has_light_from_some_cameras() {
    assert_church_is_covered(20);
}

#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_pixel_has_light_from_a_hundred_cameras() {
    assert_church_is_covered(100);
}

/// A church of columns and ledges from so many places within, most of them in no place for a camera.
fn assert_church_is_covered(cameras: u32) {
    let Some(file) = shared_file("scenes/sibenik.glb") else { return };
    let size = SIZE / 2;
    let quality = Quality::Custom(GiSettings { vpls: 64, ..SMALL });
    let light = GlobalIllumination { technique: Technique::RadianceCache, quality, ..default() };
    let mut stage = Stage::of_asset(&file.to_string_lossy(), run(size, Some(light)), true, None);
    let (low, high) = bounds(&mut stage);
    let camera = stage.only::<Camera3d>();
    let mut random = Random::new(7);
    let (mut pixels, mut merged) = (0, 0);
    for i in 0..cameras {
        let place = low + (high - low) * (0.5 + 0.45 * random.vector());
        let look = Transform::from_translation(place).looking_to(random.direction(), Vec3::Y);
        stage.world().entity_mut(camera).insert(look);
        stage.frame(Duration::ZERO);
        let counts = counts(&mut stage);
        assert_eq!(counts.missing, 0, "camera {i} at {place}: {counts:?}");
        pixels += counts.pixels;
        merged += counts.merged;
    }
    println!("{pixels} pixels, {merged} clusters merged");
    assert!(5 * pixels > cameras * size.element_product(), "hardly anything is seen: {pixels} pixels");
}
