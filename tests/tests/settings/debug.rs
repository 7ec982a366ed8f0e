//! Pictures of intermediates, and the gizmos.

use std::collections::BTreeSet;
use std::time::Duration;

use bevy::prelude::*;
use bevy_bounce::radiance_cache::cache_counts;
use bevy_bounce::{
    GiGizmos, GiIsolate, GiSettings, GlobalIllumination, Quality, RadianceCacheSettings, SsbcSettings, Technique,
    VplVisibility, gpu_memory, vpl_count,
};
use bevy_bounce_examples::scenes::CornellPlugin;
use bevy_bounce_tests::metrics::Metrics;
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::stage::{SMALL, Stage, illumination};

const SIZE: UVec2 = UVec2::new(160, 90);
const SETTINGS: GiSettings = GiSettings {
    visibility: VplVisibility::Atlas,
    tile: 16,
    ssbc: SsbcSettings { iterations: 1, ..SsbcSettings::OFF },
    radiance_cache: RadianceCacheSettings { glossy: true, ..RadianceCacheSettings::DEFAULT },
    ..SMALL
};

/// Without caches, which cost most of a frame on a software adapter.
const WITHOUT_CACHES: GiSettings = GiSettings { radiance_cache: RadianceCacheSettings::DEFAULT, ..SETTINGS };

fn cornell(settings: GiSettings) -> Stage {
    Stage::new(SIZE, settings, |app| {
        app.add_plugins(CornellPlugin);
    })
}

/// What the picture holds, as it is in the target: times the exposure.
fn isolated(stage: &mut Stage, isolate: GiIsolate) -> Picture {
    let camera = stage.only::<Camera3d>();
    stage.world().entity_mut(camera).insert(isolate);
    stage.settled_picture()
}

/// Pre-exposed.
fn shown(stage: &mut Stage, isolate: GiIsolate) -> Picture {
    let camera = stage.only::<Camera3d>();
    let exposure = stage.world().get::<bevy::camera::Exposure>(camera).copied().unwrap_or_default().exposure();
    let mut picture = isolated(stage, isolate);
    picture.pixels.iter_mut().flatten().for_each(|value| *value *= exposure);
    picture
}

fn half(picture: &Picture, right: bool) -> Picture {
    let (half, from) = (picture.width / 2, if right { picture.width / 2 } else { 0 });
    // Without the line between the halves.
    Picture::from_fn(half - 1, picture.height, |x, y| picture.at(x + from + usize::from(right), y))
}

/// Bounded light on the left, compensated on the right, to the bit.
#[test]
fn the_halves_of_a_split_picture_are_those_of_its_parts() {
    let mut stage = cornell(WITHOUT_CACHES);
    let [bounded, whole, split] =
        [GiIsolate::Bounded, GiIsolate::Indirect, GiIsolate::Split].map(|isolate| isolated(&mut stage, isolate));
    assert!(half(&split, false) == half(&bounded, false) && half(&split, true) == half(&whole, true));
    assert!(half(&bounded, true) != half(&whole, true), "nothing is compensated");
    let line = split.at(split.width / 2, 5);
    assert!(line[0] > whole.at(split.width / 2, 5)[0] && line[0] == line[1], "{line:?}");
}

/// Diffuse and glossy light add up, and light without colour is that with it over a white surface.
#[test]
fn terms_add_up() {
    let mut stage = cornell(SETTINGS);
    let [whole, glossy, irradiance] =
        [GiIsolate::Indirect, GiIsolate::Glossy, GiIsolate::Irradiance].map(|isolate| isolated(&mut stage, isolate));
    let (all, part) = (whole.mean_luminance(), glossy.mean_luminance());
    println!("{part:.3} of {all:.3} cd/m^2 are glossy, irradiance over pi is {:.3}", irradiance.mean_luminance());
    assert!(part > 0.0 && part < 0.5 * all);
    let brighter = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).all(|c| a[c] >= 0.99 * b[c]);
    let diffuse = Picture { pixels: whole.pixels.clone(), ..whole };
    let count = irradiance.pixels.iter().zip(&diffuse.pixels).filter(|pair| brighter(*pair)).count();
    assert!(count * 100 > irradiance.pixels.len() * 98, "{count} of {} pixels", irradiance.pixels.len());
    stage.light_by(illumination(WITHOUT_CACHES));
    assert_eq!(isolated(&mut stage, GiIsolate::Glossy).mean_luminance(), 0.0);
}

/// A camera's rays meet the red wall on the left, the green one on the right, the floor below.
#[test]
fn voxels_look_like_the_room() {
    let mut stage = cornell(WITHOUT_CACHES);
    let (left, right, floor) = ((44, 45), (116, 45), (80, 82));
    let albedo = shown(&mut stage, GiIsolate::VoxelAlbedo);
    let at = |picture: &Picture, (x, y): (usize, usize)| picture.at(x, y);
    let (red, green) = (at(&albedo, left), at(&albedo, right));
    println!("left {red:?}, right {green:?}, floor {:?}", at(&albedo, floor));
    assert!(red[0] > 2.0 * red[1] && green[1] > 2.0 * green[0], "left {red:?}, right {green:?}");
    let normal = shown(&mut stage, GiIsolate::VoxelNormal);
    for (place, expected) in [(left, Vec3::X), (right, Vec3::NEG_X), (floor, Vec3::Y)] {
        let normal = Vec3::from(at(&normal, place)) * 2.0 - 1.0;
        assert!(normal.dot(expected) > 0.95, "{normal} for {expected}");
    }
    // The light of the voxels is about that of the picture, but coarse.
    let light = isolated(&mut stage, GiIsolate::VoxelLight);
    let whole = isolated(&mut stage, GiIsolate::All);
    let energy = Metrics::new(&light, &whole).expect("sizes are equal").energy;
    println!("voxels send {energy:.3} of what is seen");
    assert!(light.nonfinite() == 0 && (0.5..2.0).contains(&energy), "{energy}");
}

/// Every level has about the light that voxels send, and is coarser than the one before; caches are shown one after the other.
#[test]
fn levels_and_caches_are_shown() {
    let mut stage = cornell(SETTINGS);
    let [levels, light] = [GiIsolate::VoxelLevels, GiIsolate::VoxelLight].map(|isolate| isolated(&mut stage, isolate));
    // A grid of 32 has four levels.
    let edge = |level: usize| level * SIZE.x as usize / 4;
    for level in 0..4 {
        let mean = |picture: &Picture| picture.mean_of(edge(level)..edge(level + 1), 0..SIZE.y as usize)[1];
        let band = (edge(level)..edge(level + 1)).flat_map(|x| (0..SIZE.y as usize).map(move |y| (x, y)));
        let colors: BTreeSet<[u32; 3]> = band.map(|(x, y)| levels.at(x, y).map(f32::to_bits)).collect();
        println!("level {level}: {:.3} of the light, {} colours", mean(&levels) / mean(&light), colors.len());
        assert!((0.5..2.0).contains(&(mean(&levels) / mean(&light))), "level {level}");
    }
    let caches = isolated(&mut stage, GiIsolate::Caches);
    let count = cache_counts(stage.render_world_mut())[0].caches as usize;
    let (columns, rows) = (SIZE.x as usize / 16, SIZE.y as usize / 32);
    assert!(count > columns * rows, "{count} caches");
    for index in 0..columns * rows {
        let (x, y) = (index % columns * 16, index / columns * 32);
        let [finest, coarse] = [y..y + 16, y + 16..y + 32].map(|y| caches.mean_of(x..x + 16, y)[1]);
        assert!(finest > 0.0 && (0.4..2.5).contains(&(coarse / finest)), "cache {index}: {coarse} of {finest}");
    }
    stage.light_by(illumination(SMALL));
    assert_eq!(isolated(&mut stage, GiIsolate::Caches).mean_luminance(), 0.0);
}

/// Light of voxels is there for the picture alone where no technique asks for it.
#[test]
fn voxels_are_lit_for_their_picture() {
    let mut stage = cornell(SMALL);
    let held = |stage: &mut Stage| -> u64 {
        let memory = gpu_memory(stage.render_world_mut());
        memory.iter().filter(|(name, _)| name.starts_with("voxel light")).map(|(_, bytes)| bytes).sum()
    };
    assert_eq!(held(&mut stage), 0);
    let before = isolated(&mut stage, GiIsolate::Indirect);
    for isolate in [GiIsolate::VoxelLight, GiIsolate::VoxelLevels] {
        assert!(isolated(&mut stage, isolate).mean_luminance() > 0.0, "{isolate:?}");
    }
    assert!(held(&mut stage) > 0);
    assert!(isolated(&mut stage, GiIsolate::Indirect) == before, "a picture leaves something behind");
    assert_eq!(held(&mut stage), 0);
}

/// Tiles are there for as many lights as there are; clusters cover what is seen; what is not there is black.
#[test]
fn tiles_and_clusters_are_shown_where_they_are() {
    let mut stage = cornell(SETTINGS);
    let lights = vpl_count(stage.render_world_mut()).expect("there are lights") as usize;
    let atlas = shown(&mut stage, GiIsolate::ShadowAtlas);
    let columns = SIZE.x as usize / 16;
    let tile = |light: usize| {
        let (x, y) = (light % columns * 16, light / columns * 16);
        (0..256).map(|texel| atlas.at(x + texel % 16, y + texel / 16)[0]).fold(0.0, f32::max)
    };
    let rows = SIZE.y as usize / 16;
    assert!(lights > columns * rows && (0..columns * rows).all(|light| tile(light) > 0.0), "{lights} lights");
    let clusters = shown(&mut stage, GiIsolate::Clusters);
    let lit = isolated(&mut stage, GiIsolate::Irradiance);
    let is_white = |pixel: &&[f32; 3]| pixel.iter().all(|value| (value - 1.0).abs() < 0.01);
    let caches = clusters.pixels.iter().filter(is_white).count();
    let same = clusters.pixels.iter().zip(&lit.pixels).filter(|(a, b)| (a[0] > 0.0) == (b[0] > 0.0)).count();
    println!("{caches} caches, {same} of {} pixels", lit.pixels.len());
    assert!(caches > 50 && same * 100 > lit.pixels.len() * 99, "{caches} caches, {same} pixels");
    stage.light_by(illumination(SMALL));
    for isolate in [GiIsolate::ShadowAtlas, GiIsolate::Clusters] {
        assert_eq!(isolated(&mut stage, isolate).mean_luminance(), 0.0, "{isolate:?}");
    }
}

/// Gizmos show while they are on, for every technique with lights, and leave nothing behind.
#[test]
fn gizmos_come_and_go() {
    let mut stage = cornell(SMALL);
    let plain = isolated(&mut stage, GiIsolate::All);
    let switch = |stage: &mut Stage, virtual_lights| {
        stage.world().insert_resource(GiGizmos { virtual_lights, ..default() });
        (0..6).for_each(|_| stage.frame(Duration::ZERO));
    };
    switch(&mut stage, true);
    let differs = |a: &Picture, b: &Picture| a.pixels.iter().zip(&b.pixels).filter(|(a, b)| a != b).count();
    let drawn = differs(&stage.picture(), &plain);
    println!("{drawn} of {} pixels show gizmos", plain.pixels.len());
    assert!(drawn * 50 > plain.pixels.len(), "{drawn} pixels");
    // Without lights there is nothing to draw; nothing stands still from before.
    stage.light_by(GlobalIllumination {
        technique: Technique::SurfaceRadiosity,
        quality: Quality::Custom(SMALL),
        ..default()
    });
    (0..6).for_each(|_| stage.frame(Duration::ZERO));
    let dark = stage.picture();
    switch(&mut stage, false);
    assert!(differs(&stage.picture(), &dark) == 0, "gizmos without lights");
    stage.light_by(illumination(SMALL));
    assert!(stage.settled_picture() == plain, "gizmos leave something behind");
}

/// No two of them are the same; with `BOUNCE_PICTURES`, a folder, they are written there as the display shows them.
#[test]
#[ignore = "takes minutes on a software adapter"]
fn every_picture_is_another() {
    use GiIsolate::*;
    let (size, folder) = (UVec2::new(160, 90), std::env::var_os("BOUNCE_PICTURES"));
    let mut stage = Stage::new(size, SETTINGS, |app| {
        app.add_plugins(CornellPlugin);
    });
    let camera = stage.only::<Camera3d>();
    let mut seen = Vec::new();
    let mut look = |stage: &mut Stage, name: String| {
        stage.settle();
        stage.frame(Duration::ZERO);
        let shown = stage.display();
        if let Some(folder) = &folder {
            let picture = image::RgbaImage::from_vec(size.x, size.y, shown.clone()).expect("four bytes a pixel");
            picture.save(std::path::Path::new(folder).join(format!("{name}.png"))).expect("can be written");
        }
        let same = seen.iter().find(|(_, other)| *other == shown).map(|(other, _): &(String, _)| other.clone());
        assert_eq!(same, None, "{name} shows the same");
        seen.push((name, shown));
    };
    for isolate in [
        All,
        Direct,
        Indirect,
        Bounded,
        Residual,
        Split,
        Glossy,
        Irradiance,
        VoxelAlbedo,
        VoxelNormal,
        VoxelLight,
        VoxelLevels,
        ShadowAtlas,
        Clusters,
        Caches,
    ] {
        stage.world().entity_mut(camera).insert(isolate);
        look(&mut stage, format!("{isolate:?}"));
    }
    stage.world().entity_mut(camera).insert(All);
    stage.world().insert_resource(GiGizmos { virtual_lights: true, ..default() });
    look(&mut stage, "gizmos".into());
}
