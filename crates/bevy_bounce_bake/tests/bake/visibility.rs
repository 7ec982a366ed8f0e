//! Decoded visibility against exact rays.

use bevy_bounce_bake::rays::Bvh;
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake, verify};
use bevy_bounce_cssm::Filter;
use glam::Vec3;

use crate::scenes::{cornell_box, random, small};

fn room() -> Scene {
    Source::open(&cornell_box()).and_then(|source| Scene::from_gltf(&source)).expect("the repository has it")
}

#[test]
fn maps_agree_with_rays() {
    let scene = room();
    let settings = BakeSettings { atlas: 64, depth: 32, ..BakeSettings::default() };
    let (file, _) = bake(&scene, &settings, &()).expect("it can be baked");
    let agreement = verify(&file, &scene, 50_000).expect("it is of this scene");
    assert!(agreement.pairs > 49_000 && agreement.percent() > 96.0, "{agreement:?}");
    let all: u64 = agreement.distances.iter().sum();
    assert!(all == agreement.pairs - agreement.agreeing && agreement.near_percent() > 99.5, "{agreement:?}");
    // Which is no matter of chance.
    assert!(agreement.sampled > 700 && agreement.sampled_near < agreement.sampled / 2, "{agreement:?}");
    // The same pairs every time.
    assert_eq!(verify(&file, &scene, 50_000).expect("as before"), agreement);
}

#[test]
fn another_scene_is_noticed() {
    let (file, _) = bake(&room(), &small(), &()).expect("it can be baked");
    let said = verify(&file, &random(3), 10).map_err(|error| error.to_string());
    assert!(said.is_err_and(|said| said.contains("another scene")));
}

#[test]
fn wrong_maps_disagree() {
    let scene = room();
    let (mut file, _) = bake(&scene, &small(), &()).expect("it can be baked");
    // Every map sees everything.
    file.maps.directory.fill(1 << 31 | 0xffff);
    assert!(verify(&file, &scene, 20_000).expect("it is of this scene").percent() < 95.0);
}

#[test]
fn the_filter_lies_between_its_neighbours() {
    let scene = room();
    let (file, _) = bake(&scene, &small(), &()).expect("it can be baked");
    let mut partly = 0;
    for index in 0..file.meta.texels as usize {
        let texel = file.texel(index).expect("in range");
        let at = texel.cell.map(|at| at as f32 + 0.3);
        let point = [0.3, 0.8, 0.2];
        let [pixels, both] =
            [Filter::Pixels, Filter::PixelsAndTexels].map(|filter| file.visibility(&texel, at, point, filter));
        assert!((0.0..=1.0001).contains(&pixels) && (0.0..=1.0001).contains(&both));
        partly += usize::from(both > 0.01 && both < 0.99);
    }
    assert!(partly > 0);
}

#[test]
fn maps_from_outside_agree_with_rays() {
    for seed in 0..3 {
        let scene = random(seed);
        let (file, _) = bake(&scene, &small(), &()).expect("it can be baked");
        let bvh = Bvh::new(&scene);
        let (center, radius) = (Vec3::from(file.meta.csm_center), file.meta.csm_radius);
        let mut rng = fastrand::Rng::with_seed(seed);
        let (mut agreeing, mut blocked, count) = (0, 0, 4000);
        for _ in 0..count {
            let mut unit = || Vec3::from([(); 3].map(|()| rng.f32() - 0.5)).normalize_or(Vec3::X);
            let (from, through) = (center + 1.5 * radius * unit(), center + 0.4 * radius * unit());
            let to = from + (through - from).normalize() * 4.0 * radius;
            let exact = !bvh.visible(from, to, 0.0);
            agreeing += usize::from(exact == file.blocks(from.to_array(), to.to_array()));
            blocked += usize::from(exact);
        }
        assert!(blocked > count / 20 && blocked < count * 19 / 20, "seed {seed}: {blocked} of {count}");
        assert!(agreeing > count * 93 / 100, "seed {seed}: {agreeing} of {count}");
    }
}
