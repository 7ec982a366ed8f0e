//! Lightmaps and irradiance volumes in Bevy without a plugin of this project, against path-traced references.

use bevy::prelude::*;
use bevy_bounce_bake::LightmapSettings;
use bevy_bounce_tests::lightmaps::{Baked, bake, bounced, join, split};
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::picture::Picture;
use bevy_bounce_tests::references::shared_file;
use serde_json::json;

/// Of the references.
const SIZE: UVec2 = UVec2::new(320, 180);
/// As many bounces as the references have.
const SMALL: LightmapSettings =
    LightmapSettings { atlas: 128, rays: 128, bounces: Some(8), probes: 8, direct: false, unwrap: false };
/// What is asked of the light in a picture.
const ENERGY: Bounds = Bounds { energy: Some((0.93, 1.07)), low: None, flip: None, nrmse: None };

/// A scene's file and its reference.
fn shared(name: &str) -> Option<(Vec<u8>, Picture)> {
    let scene = shared_file(&format!("scenes/{name}.glb"))?;
    let reference = shared_file(&format!("references/{name}.indirect.exr"))?;
    Some((std::fs::read(scene).expect("it is there"), Picture::load(&reference).expect("it is there")))
}

/// What a lightmap adds to the picture.
fn lightmapped(scene: &[u8], settings: &LightmapSettings, deferred: bool) -> Picture {
    let (files, report) = bake(scene, settings);
    println!("{report:?}");
    let mut baked = Baked::new(&files, SIZE, deferred);
    let without = baked.picture();
    baked.add_lightmap();
    bounced(&baked.picture(), &without)
}

fn check(name: &str, picture: &Picture, reference: &Picture) {
    println!("{name}: {:?}", Metrics::new(picture, reference));
    compare(picture, reference, &ENERGY).unwrap_or_else(|error| panic!("{name}: {error}"));
    if let Some(folder) = std::env::var_os("BOUNCE_PICTURES") {
        picture.save(&std::path::Path::new(&folder).join(format!("{name}.exr"))).expect("can be written");
    }
}

#[test]
fn a_cornell_box_equals_its_reference() {
    let Some((scene, reference)) = shared("cornell_spot") else { return };
    for deferred in [false, true] {
        let picture = lightmapped(&scene, &SMALL, deferred);
        check(if deferred { "cornell_spot-deferred" } else { "cornell_spot" }, &picture, &reference);
    }
}

/// Round things that touch, and light that comes round a corner.
#[test]
fn other_generated_scenes_equal_their_references() {
    for name in ["corner", "u_room"] {
        let Some((scene, reference)) = shared(name) else { return };
        check(name, &lightmapped(&scene, &LightmapSettings { atlas: 256, ..SMALL }, false), &reference);
    }
}

/// A cathedral of 75,276 triangles. The reference's textures stand upside down, so these are turned over, too.
#[test]
#[ignore = "takes minutes: a lightmap of half a million texels on the processor"]
fn a_real_scene_equals_its_reference() {
    let Some((scene, reference)) = shared("sibenik") else { return };
    let (mut json, rest) = split(&scene);
    let turn = json!({ "KHR_texture_transform": { "offset": [0.0, 1.0], "scale": [1.0, -1.0] } });
    for material in json["materials"].as_array_mut().into_iter().flatten() {
        if let Some(texture) = material.pointer_mut("/pbrMetallicRoughness/baseColorTexture") {
            texture["extensions"] = turn.clone();
        }
    }
    let settings = LightmapSettings { atlas: 1024, rays: 64, ..SMALL };
    check("sibenik", &lightmapped(&join(&json, rest), &settings, false), &reference);
}

/// Surfaces lit by the volume alone are about as bright as by the lightmap, and a ball between red and green walls is
/// red on one side and green on the other. With both, the lightmap counts alone.
#[test]
fn a_volume_lights_what_has_no_lightmap() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let bytes = std::fs::read(path).expect("the repository has it");
    let (files, _) = bake(&bytes, &SMALL);
    let mut baked = Baked::new(&files, SIZE, false);
    let without = baked.picture();
    baked.add_volume();
    let by_volume = bounced(&baked.picture(), &without);
    baked.add_lightmap();
    let by_both = bounced(&baked.picture(), &without);
    let mut baked = Baked::new(&files, SIZE, false);
    baked.add_lightmap();
    let by_lightmap = bounced(&baked.picture(), &without);
    let metrics = Metrics::new(&by_volume, &by_lightmap);
    println!("volume against lightmap: {metrics:?}");
    let energy = by_volume.mean_luminance() / by_lightmap.mean_luminance();
    assert!((0.8..1.25).contains(&energy), "{energy}");
    let both = Metrics::new(&by_both, &by_lightmap).expect("sizes are equal");
    assert!((both.energy - 1.0).abs() < 1.0e-3, "{both:?}");
    // Bevy 0.19's deferred renderer adds them up.
    let mut deferred = Baked::new(&files, SIZE, true);
    let without = deferred.picture();
    deferred.add_lightmap();
    deferred.add_volume();
    let twice = bounced(&deferred.picture(), &without).mean_luminance() / by_lightmap.mean_luminance();
    println!("both in Bevy's deferred renderer: {twice}");
    assert!(twice > 1.5, "no longer added up: the documentation says otherwise");

    let ball = baked.world().resource_mut::<Assets<Mesh>>().add(Sphere::new(0.5));
    let paint = StandardMaterial { base_color: Color::WHITE, perceptual_roughness: 1.0, reflectance: 0.0, ..default() };
    let paint = baked.world().resource_mut::<Assets<StandardMaterial>>().add(paint);
    baked.world().spawn((Mesh3d(ball), MeshMaterial3d(paint), Transform::from_xyz(0.0, 2.0, 0.5)));
    let unlit = baked.picture();
    baked.add_volume();
    let picture = bounced(&baked.picture(), &unlit);
    let lit: Vec<(usize, usize)> = (0..SIZE.x as usize * SIZE.y as usize)
        .map(|pixel| (pixel % SIZE.x as usize, pixel / SIZE.x as usize))
        .filter(|&(x, y)| picture.at(x, y)[1] > 1.0)
        .collect();
    let middle = SIZE.x as usize / 2;
    let redness = |left: bool| {
        let pixels = lit.iter().filter(|(x, _)| (*x < middle) == left).map(|&(x, y)| picture.at(x, y));
        let sum = pixels.fold([0.0; 2], |sum, pixel| [sum[0] + pixel[0], sum[1] + pixel[1]]);
        sum[0] / sum[1]
    };
    println!("{} pixels of the ball, red over green {} and {}", lit.len(), redness(true), redness(false));
    assert!(lit.len() > 200 && redness(true) > 1.3 * redness(false));
}
