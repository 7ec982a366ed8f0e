//! Virtual lights that see by bakes.

use bevy::prelude::*;
use bevy_bounce::{CssmObject, GiIsolate, GiSettings, GlobalIllumination, Quality, VplVisibility, gpu_memory};
use bevy_bounce_tests::baked::{cornell_box, cornell_box_in_two};
use bevy_bounce_tests::metrics::{Bounds, Metrics, compare};
use bevy_bounce_tests::stage::{SMALL, Stage, run};

use super::moving::{bake, block};

const SIZE: UVec2 = UVec2::new(64, 36);

fn by(visibility: VplVisibility) -> GlobalIllumination {
    let settings = GiSettings { visibility, ..SMALL };
    GlobalIllumination { quality: Quality::Custom(settings), ..default() }
}

/// Within what maps of triangles and maps of bakes differ by.
const ALIKE: Bounds = Bounds { energy: Some((0.97, 1.03)), low: Some(0.1), flip: Some(0.04), nrmse: None };

#[test]
fn bakes_show_lights_what_triangles_do() {
    let atlas = Stage::of_asset("cornell_box.glb", run(SIZE, Some(by(VplVisibility::Atlas))), true, None).picture();
    let file = cornell_box().clone();
    let mut stage = Stage::of_asset("cornell_box.glb", run(SIZE, Some(by(VplVisibility::Baked))), true, Some(file));
    let baked = stage.settled_picture();
    let metrics = compare(&baked, &atlas, &ALIKE).unwrap_or_else(|error| panic!("{error}"));
    println!("{metrics:?}");
    assert!(metrics.nrmse > 1e-4, "the bake is not asked");
    assert!(gpu_memory(stage.render_world_mut()).contains_key("cssm: maps"));
    // The bounds would notice: without shadows there is more light.
    stage.light_by(by(VplVisibility::None));
    compare(&stage.settled_picture(), &atlas, &ALIKE).expect_err("the bounds are too wide to tell");
    assert!(!gpu_memory(stage.render_world_mut()).contains_key("cssm: maps"), "a bake that is not asked stays");
    // What is not baked is seen by its triangles.
    let root = stage.only::<WorldAssetRoot>();
    stage.world().entity_mut(root).remove::<CssmObject>();
    stage.light_by(by(VplVisibility::Baked));
    assert!(stage.settled_picture() == atlas, "without a bake there is another picture");
}

/// A bake of the room alone, and a block that is not baked; then one that is, by itself; wherever it stands.
#[test]
fn what_is_not_baked_casts_too() {
    let start = |visibility| Stage::of_asset("cornell_box.glb", run(SIZE, Some(by(visibility))), true, None);
    let (mut atlas, mut baked) = (start(VplVisibility::Atlas), start(VplVisibility::Baked));
    let [room_bake, block_bake] = cornell_box_in_two([64, 24]);
    let (root, moving) = (baked.only::<WorldAssetRoot>(), block(&mut baked));
    bake(&mut baked, root, room_bake);
    let away = Transform::from_xyz(-0.5, 1.1, 0.6).with_rotation(Quat::from_rotation_z(0.5));
    let mut compare_at = |baked: &mut Stage, place: Transform, name: &str| {
        let in_atlas = block(&mut atlas);
        for (stage, entity) in [(&mut atlas, in_atlas), (&mut *baked, moving)] {
            stage.world().entity_mut(entity).insert(place);
        }
        let (found, expected) = (baked.settled_picture(), atlas.settled_picture());
        let metrics = compare(&found, &expected, &ALIKE).unwrap_or_else(|error| panic!("{name}: {error}"));
        println!("{name}: {metrics:?}");
        found
    };
    let floating = compare_at(&mut baked, away, "a block that is not baked");
    baked.world().entity_mut(moving).insert(Transform::from_xyz(0.0, 50.0, 0.0));
    let gone = Metrics::new(&baked.settled_picture(), &floating).expect("sizes are equal");
    assert!(gone.nrmse > 0.05, "the block casts nothing: {gone:?}");
    bake(&mut baked, moving, block_bake);
    compare_at(&mut baked, away, "a block that is baked");
    compare_at(&mut baked, Transform::from_xyz(0.9, 0.0, 0.8), "the same elsewhere");
    let camera = baked.only::<Camera3d>();
    baked.world().entity_mut(camera).insert(GiIsolate::ShadowAtlas);
    assert!(baked.settled_picture().mean_luminance() > 0.0);
}
