//! From paths to the list of virtual lights: nothing is lost, nothing goes far, and light comes from where it is.

use std::collections::{BTreeMap, BTreeSet};

use bevy::math::{Affine3A, Quat, Vec3};
use bevy_bounce_shaders::types::{CompactVpl, SUBSETS, Vpl};
use bevy_bounce_tests::gpu::gpu;
use bevy_bounce_tests::scene::{TestScene, run};

use super::{PATHS, Traced, point_light, room, sun};

#[test]
fn the_list_is_whole_and_even() {
    let mut scene = room(Vec3::splat(0.6));
    let mut lamp = bevy_bounce_tests::scene::matte(Vec3::ZERO);
    lamp.emissive = Vec3::splat(20.0);
    scene.materials.push(lamp);
    let strip = [Vec3::new(-0.5, 1.5, 0.0), Vec3::new(0.5, 1.5, 0.0), Vec3::new(0.0, 1.5, 0.5)];
    scene.mesh(&[strip], 1, 0, Affine3A::from_rotation_translation(Quat::from_rotation_z(0.3), Vec3::ZERO));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::splat(3.0)));
    let (traced, header, list) = Traced::new(&scene, 0.2, 6).list();

    assert_eq!(header.path_count, PATHS);
    let (all, count) = (traced.all().count(), header.count as usize);
    assert!(all > 2 * traced.parameters.capacity as usize, "{all} vertices are no choice");
    // The order is cut at a height in steps of a 32nd of an octave: one step less would be more lights than there is room for.
    assert!((970..=1000).contains(&count), "{count} lights in a list of 1000");

    // Each light is at a vertex, and none is in two places.
    let by_key: BTreeMap<_, _> = traced.all().map(|vpl| ((vpl.sample, vpl.bounce()), vpl)).collect();
    let mut seen = BTreeSet::new();
    for vpl in &list[..count] {
        let key = (vpl.sample, vpl.bounce());
        assert!(seen.insert(key), "{key:?} is twice in the list");
        let vertex = by_key.get(&key).unwrap_or_else(|| panic!("{key:?} is not a vertex"));
        assert_eq!((vpl.position, vpl.normal), (vertex.position, vertex.normal));
    }

    // Nothing is lost, and nothing goes far: flux and place of all that looks one way.
    let facing = |vpl: &Vpl| (0..6).find(|i| vpl.normal[i / 2] * [1.0, -1.0][i % 2] > 0.7);
    let moments = |vpls: &mut dyn Iterator<Item = &Vpl>, side: Option<usize>| {
        vpls.filter(|vpl| facing(vpl) == side)
            .fold((Vec3::ZERO, Vec3::ZERO), |(flux, place), vpl| (flux + vpl.flux, place + vpl.flux.y * vpl.position))
    };
    for side in (0..6).map(Some) {
        let (expected, expected_place) = moments(&mut traced.all(), side);
        let (found, place) = moments(&mut list[..count].iter(), side);
        let error = (found * PATHS as f32 / expected - 1.0).abs().max_element();
        assert!(error < 0.02, "side {side:?} has {found} lumens, expected {}", expected / PATHS as f32);
        let off = place / found.y - expected_place / expected.y;
        assert!(off.length() < 0.03, "the light of side {side:?} is {off} off");
    }
    let total = |vpls: &mut dyn Iterator<Item = &Vpl>| vpls.map(|vpl| vpl.flux.as_dvec3()).sum::<bevy::math::DVec3>();
    let ratio = total(&mut list[..count].iter()) * f64::from(PATHS) / total(&mut traced.all());
    assert!((ratio - 1.0).abs().max_element() < 1e-5, "{ratio} of the flux is in the list");

    // Where light is rare, a light stands for less of it.
    let brick_counts = traced.brick_counts();
    let occupied = brick_counts.iter().filter(|count| **count > 0).count();
    let mean_count = (all / occupied) as u32;
    let stands_for = |rare: bool| {
        let threshold = mean_count;
        let is_rare = |vpl: &&Vpl| (brick_counts[traced.brick(vpl)] < threshold) == rare;
        let lights = list[..count].iter().filter(is_rare).count();
        traced.all().filter(is_rare).count() as f32 / lights as f32
    };
    assert!(stands_for(true) < 0.8 * stands_for(false), "{} and {}", stands_for(true), stands_for(false));

    // Each subset has its share, as well as if its lights were drawn at random.
    let mean = total(&mut list[..count].iter()).x / count as f64;
    let variance =
        list[..count].iter().map(|vpl| (f64::from(vpl.flux.x) / mean - 1.0).powi(2)).sum::<f64>() / count as f64;
    let bound = 2.0 * (variance * f64::from(SUBSETS as u32) / count as f64).sqrt();
    println!("shares of the subsets are to be within {bound:.3}");
    assert_eq!((header.subset_start[0], header.subset_start[SUBSETS]), (0, header.count));
    for subset in 0..SUBSETS {
        let range = header.subset_start[subset] as usize..header.subset_start[subset + 1] as usize;
        assert!(
            range.len().abs_diff(count / SUBSETS) <= count / SUBSETS / 4,
            "subset {subset} has {} lights",
            range.len()
        );
        let share = total(&mut list[range].iter()) * SUBSETS as f64 / total(&mut list[..count].iter());
        assert!((share - 1.0).abs().max_element() < bound, "subset {subset} has {share} of its share");
    }
}

#[test]
fn light_that_goes_into_the_open_takes_few_lights() {
    // The sun on a flat roof, and on a valley whose slopes light each other.
    let mut scene = TestScene::new(Vec3::splat(0.7));
    let quad = |a: Vec3, b: Vec3, c: Vec3, d: Vec3| [[a, b, c], [a, c, d]];
    let square = |x: [f32; 2], y: [f32; 2]| {
        let corner = |i: usize, z: f32| Vec3::new(x[i], y[i], z);
        quad(corner(0, 1.0), corner(1, 1.0), corner(1, -1.0), corner(0, -1.0))
    };
    let roof = square([-3.0, -1.0], [2.0, 2.0]);
    let valley = [square([1.0, 2.0], [2.0, 0.0]), square([2.0, 3.0], [0.0, 2.0])];
    scene.soup(&[&roof[..], &valley[0], &valley[1]].concat());
    scene.lights.push(sun(1.0, 24.0));
    let mut traced = Traced::new(&scene, 0.1, 6);
    traced.parameters.capacity = 250;
    traced.resources = traced.resources.uniform("parameters", &traced.parameters);
    let (traced, header, list) = traced.list();

    // One light for what lies within an edge e of a surface where the weight is w a square metre: its error is w e^3, the same
    // everywhere, so there are w^(2/3) of them a square metre.
    let on_roof = |vertex: &&Vpl| vertex.position.x < 0.0;
    let lights_on = |area: f64, roof: bool| {
        let there = traced.all().filter(|vertex| on_roof(vertex) == roof);
        let weight = there.map(|vertex| if vertex.met() { 1.0 } else { 0.2 }).sum::<f64>();
        area * (weight / area).powf(2.0 / 3.0)
    };
    let (roof, valley) = (lights_on(4.0, true), lights_on(4.0 * f64::sqrt(5.0), false));
    let share = roof / (roof + valley);
    let lights = list[..header.count as usize].iter().filter(on_roof).count() as f64;
    assert!(traced.all().filter(on_roof).all(|vertex| !vertex.met()), "nothing is above the roof");
    assert!(share < 0.3, "the roof has {share} of the lights");
    assert!(traced.all().any(|vertex| vertex.met()), "the slopes light each other");
    let expected = share * f64::from(header.count);
    assert!((lights / expected - 1.0).abs() < 0.2, "{lights} lights, expected {expected}");

    let flux =
        |vpls: &mut dyn Iterator<Item = &Vpl>| vpls.filter(on_roof).map(|vpl| f64::from(vpl.flux.y)).sum::<f64>();
    let kept = flux(&mut list[..header.count as usize].iter()) * f64::from(PATHS) / flux(&mut traced.all());
    assert!((kept - 1.0).abs() < 0.02, "{kept} of the roof's light is left");
}

#[test]
fn bricks_know_their_lights_and_surfaces() {
    let mut scene = room(Vec3::splat(0.7));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::splat(3.0)));
    let (traced, header, _) = Traced::new(&scene, 0.1, 12).list();
    let brick_counts = traced.brick_counts();
    let bricks = brick_counts.len();
    let resources = traced.resources.zeroed("densities", 2 * bricks);
    run(gpu(), "vpl/density.wgsl", "measure_density", &resources, [bricks as u32, 1, 1]);
    let words = resources.read_words("densities").expect("reads back");
    let densities: Vec<[f32; 2]> = words.as_chunks().0.iter().map(|pair| pair.map(f32::from_bits)).collect();
    let sum = |of: usize| densities.iter().map(|pair| f64::from(pair[of])).sum::<f64>();
    let area: f32 = scene.triangles.iter().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    let (lights, surfaces) = (sum(0) / f64::from(header.count), sum(1) / f64::from(area));
    assert!((lights - 1.0).abs() < 0.01, "bricks have {lights} of the lights");
    assert!((surfaces - 1.0).abs() < 0.01, "bricks have {surfaces} of the surfaces");
    for (count, [lights, area]) in brick_counts.iter().zip(&densities) {
        assert_eq!(*count > 0, *lights > 0.0);
        assert!(*lights == 0.0 || *area > 0.0, "{count} vertices, {area} square metres");
    }
}

/// Each as large as where its vertices are spread, which is on all surfaces; some are of two walls.
#[test]
fn lights_stand_for_all_surfaces() {
    let mut scene = room(Vec3::splat(0.7));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::splat(3.0)));
    let (traced, header, list) = Traced::new(&scene, 0.1, 12).list();
    let list = &list[..header.count as usize];
    let areas = list.iter().map(|light| f32::from_bits(light.incoming));
    let surfaces: f32 = scene.triangles.iter().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    let share = areas.clone().sum::<f32>() / surfaces;
    println!("lights stand for {share:.3} of the surfaces");
    assert!((0.8..1.4).contains(&share), "{share} of the surfaces");
    assert!(areas.clone().all(|area| area > 0.0), "a light of no area");
    let stands = |light: &Vpl| traced.all().any(|vertex| vertex.position == light.position);
    assert!(list.iter().all(stands), "a light stands where no path was");
}

#[test]
fn few_vertices_are_all_in_the_list() {
    let mut scene = room(Vec3::splat(0.05));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::splat(3.0)));
    let (traced, header, list) = Traced::new(&scene, 0.2, 3).list();
    let all = traced.all().count();
    assert!(all > 100 && all < 400, "{all} vertices");
    assert!(header.count as usize > all * 9 / 10 && header.count as usize <= all, "{} lights", header.count);
    let flux: f32 = list[..header.count as usize].iter().map(|vpl| vpl.flux.x).sum();
    let expected: f32 = traced.all().map(|vpl| vpl.flux.x / PATHS as f32).sum();
    assert!((flux / expected - 1.0).abs() < 1e-4, "{flux} lumens, expected {expected}");
}

#[test]
fn no_light_an_empty_list() {
    let (_, header, _) = Traced::new(&room(Vec3::splat(0.5)), 0.3, 4).list();
    assert_eq!((header.count, header.subset_start), (0, [0; SUBSETS + 1]));
}

/// A lamp in another room comes and goes.
#[test]
fn one_lamp_leaves_the_lights_of_others() {
    const LAMPS: usize = 300;
    let lights = |off: Option<usize>| -> BTreeMap<(u32, u32), usize> {
        let mut scene = room(Vec3::splat(0.5));
        scene.room(Vec3::new(3.0, 0.0, -1.5), Vec3::new(7.0, 2.5, 1.5));
        for lamp in 0..LAMPS {
            let place = lamp * 107 % LAMPS;
            let next_door = if lamp + 5 < LAMPS { 0.0 } else { 5.0 };
            let at = Vec3::new((place % 20) as f32 * 0.19 - 1.8 + next_door, 1.9, (place / 20) as f32 * 0.19 - 1.3);
            let candela = 10.0_f32.powf((lamp * 37 % LAMPS) as f32 / LAMPS as f32);
            scene.lights.push(point_light(at, Vec3::splat(candela)));
        }
        if let Some(off) = off {
            scene.lights[off].cumulative_power = 0.0;
        }
        let (_, header, list) = Traced::new(&scene, 0.1, 6).list();
        let subsets = header.subset_start.windows(2).enumerate();
        let lights = |(subset, range): (usize, &[u32])| {
            list[range[0] as usize..range[1] as usize].iter().map(move |light| ((light.sample, light.bounce()), subset))
        };
        subsets.flat_map(lights).collect()
    };
    let all = lights(None);
    for off in LAMPS - 5..LAMPS {
        let others = lights(Some(off));
        let kept = all.keys().filter(|light| others.contains_key(light)).count();
        let same = all.iter().filter(|(light, subset)| others.get(light) == Some(subset)).count();
        println!("without lamp {off}: of {} lights {kept} are where they were, {same} in their subset", all.len());
        assert!(kept * 10 > all.len() * 9, "without lamp {off}, {kept} of {} lights are where they were", all.len());
        assert!(same * 5 > all.len(), "without lamp {off}, {same} of {} lights are in their subset", all.len());
    }
}

#[test]
fn shading_reads_the_list_as_it_is() {
    let mut scene = room(Vec3::new(0.9, 0.4, 0.0));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::new(3.0, 2.0, 1.0)));
    let (traced, header, list) = Traced::new(&scene, 0.2, 6).list();
    let compact = traced.resources.read_structs::<CompactVpl>("compact_vpls").expect("reads back");
    assert!(header.count > 900);
    for (vpl, compact) in list.iter().zip(&compact).take(header.count as usize) {
        assert_eq!((vpl.position, vpl.normal), (compact.position, compact.normal));
        let off = vpl.flux.distance(compact.flux());
        assert!(vpl.flux.x > 0.0 && off < 3e-5 * vpl.flux.element_sum(), "{vpl:?}: {}", compact.flux());
    }
}
