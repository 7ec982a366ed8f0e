//! Light of the texels and of their hierarchy, against sums over all texels.

use bevy::math::{Affine3A, Vec3};
use bevy_bounce::cssm::tree::Tree;
use bevy_bounce::cssm::words::PAGE_BITS;
use bevy_bounce_cssm::{CssmFile, Texel};
use bevy_bounce_shaders::types::{
    CSSM_TOP_NODES, CssmGather, CssmLevel, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_RECT, LIGHT_SPOT, Light, Scene,
};
use bevy_bounce_tests::baked::{cornell_box, resources, small_block, small_cornell_box};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{run, run_with};
use bevy_bounce_tests::twins::cssm::{Object, direct, gather, texels};

/// A lamp in the room and one before it, a spot and a sun that shine in from the open side.
fn lights(file: &CssmFile) -> Vec<Light> {
    let (low, high) = (Vec3::from(file.meta.bounds_min), Vec3::from(file.meta.bounds_max));
    let at = |x: f32, y: f32, z: f32| low + (high - low) * Vec3::new(x, y, z);
    let direction = Vec3::new(0.2, -0.3, -1.0).normalize();
    vec![
        Light { kind: LIGHT_POINT, position: at(0.5, 0.9, 0.5), color: Vec3::new(3.0, 2.0, 1.0), ..Light::default() },
        Light {
            kind: LIGHT_POINT,
            position: at(0.4, 0.6, 2.0),
            range: 20.0,
            color: Vec3::splat(5.0),
            ..Light::default()
        },
        Light {
            kind: LIGHT_SPOT,
            position: at(0.5, 0.95, 0.6),
            direction: Vec3::NEG_Y,
            color: Vec3::new(0.0, 4.0, 9.0),
            spot_scale: 3.0,
            spot_cos_outer: 2.0 / 3.0,
            ..Light::default()
        },
        Light { kind: LIGHT_DIRECTIONAL, direction, color: Vec3::splat(0.7), ..Light::default() },
        Light {
            kind: LIGHT_RECT,
            position: at(0.5, 0.9, 0.4),
            direction: Vec3::NEG_Y,
            color: Vec3::new(2.0, 1.0, 3.0),
            side: 0.1 * (high.x - low.x) * Vec3::X,
            half_height: 0.06 * (high.x - low.x),
            ..Light::default()
        },
    ]
}

/// A radiance for each texel, uneven.
fn radiance(texels: &[Texel]) -> Vec<Vec3> {
    let uneven = |texel: &Texel| {
        let wave = (texel.position[0] * 7.0).sin() + (texel.position[1] * 5.0).cos();
        Vec3::new(1.0, 0.5, 0.25) * (wave + 2.5)
    };
    texels.iter().map(uneven).collect()
}

fn values(values: &[Vec3]) -> Vec<f32> {
    values.iter().flat_map(|value| [value.x, value.y, value.z, 0.0]).collect()
}

fn read(resources: &Resources, name: &str) -> Vec<Vec3> {
    let floats = resources.read_floats(name).expect("reads back");
    floats.as_chunks::<4>().0.iter().map(|[r, g, b, _]| Vec3::new(*r, *g, *b)).collect()
}

/// Objects whose texels send those radiances, one after the other.
fn with_light(objects: &[(&CssmFile, Affine3A)], sent: &[Vec3], threshold: f32) -> Resources {
    let levels: Vec<u32> = objects.iter().map(|(file, _)| Tree::build(file).levels()).collect();
    let mut resources = resources(gpu(), objects, PAGE_BITS)
        .floats("sources", &values(sent))
        .zeroed("gathered", 4 * sent.len())
        .zeroed("powers", 8 * sent.len() + 4 * CSSM_TOP_NODES)
        .uniform("settings", &CssmGather { threshold, ..CssmGather::default() })
        .uniform("level", &CssmLevel { level: 0 });
    run(gpu(), "cssm/hierarchy.wgsl", "leaves", &resources, [sent.len().div_ceil(64) as u32, 1, 1]);
    for level in (0..levels.iter().copied().max().unwrap_or(0)).rev() {
        resources = resources.uniform("level", &CssmLevel { level });
        let rows = levels.iter().filter(|levels| level < **levels).count() as u32;
        run(gpu(), "cssm/hierarchy.wgsl", "pull", &resources, [(rows << level).div_ceil(64), 1, 1]);
    }
    run(gpu(), "cssm/hierarchy.wgsl", "pull_top", &resources, [(2 * objects.len() as u32 - 1).div_ceil(64), 1, 1]);
    resources
}

#[test]
fn direct_light_is_that_of_every_light() {
    let file = cornell_box();
    let (texels, lights) = (texels(file), lights(file));
    for (name, lights) in [("each", lights.clone()), ("none", Vec::new())] {
        let scene = Scene { light_count: lights.len() as u32, ..Scene::default() };
        let emitted = vec![Vec3::splat(0.125); texels.len()];
        let resources = resources(gpu(), &[(file, Affine3A::IDENTITY)], PAGE_BITS)
            .uniform("scene", &scene)
            .structs("lights", &[&lights[..], &[Light::default()]].concat())
            .uniform("settings", &CssmGather::default())
            .floats("sources", &values(&emitted));
        run(gpu(), "cssm/direct.wgsl", "direct", &resources, [texels.len().div_ceil(64) as u32, 1, 1]);
        let mut lit = 0;
        for (texel, found) in texels.iter().zip(read(&resources, "sources")) {
            let irradiance = direct(file, texel, &lights);
            let expected = 0.125 + Vec3::from(texel.diffuse) * irradiance / std::f32::consts::PI;
            assert!(found.distance(expected) <= 1.0e-4 * expected.length(), "{name}: {found} {expected} {texel:?}");
            lit += usize::from(irradiance != Vec3::ZERO);
        }
        assert!(lit == 0 && lights.is_empty() || lit > texels.len() / 4 && lit < texels.len());
    }
}

/// Lights of all kinds shine as brightly on an object that was moved and turned together with them.
#[test]
fn direct_light_moves_along() {
    let file = cornell_box();
    let turn = Affine3A::from_rotation_translation(bevy::math::Quat::from_rotation_y(1.1), Vec3::new(3.0, -2.0, 9.0));
    let count = file.meta.texels as usize;
    let lit = |place: Affine3A| {
        let lights: Vec<Light> = lights(file)
            .into_iter()
            .map(|light| Light {
                position: place.transform_point3(light.position),
                direction: place.transform_vector3(light.direction),
                side: place.transform_vector3(light.side),
                ..light
            })
            .collect();
        let resources = resources(gpu(), &[(file, place)], PAGE_BITS)
            .uniform("scene", &Scene { light_count: lights.len() as u32, ..Scene::default() })
            .structs("lights", &lights)
            .uniform("settings", &CssmGather { filtered: 1, ..CssmGather::default() })
            .zeroed("sources", 4 * count);
        run(gpu(), "cssm/direct.wgsl", "direct", &resources, [count.div_ceil(64) as u32, 1, 1]);
        read(&resources, "sources")
    };
    let (still, moved) = (lit(Affine3A::IDENTITY), lit(turn));
    // At edges of shadows rounding may decide otherwise.
    let apart = |(a, b): &(&Vec3, &Vec3)| a.distance(**b) > 1.0e-3 * (1.0 + a.length());
    let differ = still.iter().zip(&moved).filter(apart).count();
    assert!(differ * 100 < count, "{differ} of {count} texels");
    assert!(still.iter().any(|light| light.length() > 0.01));
}

#[test]
fn nodes_hold_what_is_below_them() {
    let file = cornell_box();
    let (texels, tree) = (texels(file), Tree::build(file));
    let sent = radiance(&texels);
    let powers = with_light(&[(file, Affine3A::IDENTITY)], &sent, 0.0).read_floats("powers").expect("reads back");
    let powers: Vec<[f32; 4]> = powers.as_chunks().0.to_vec();
    let (mut index, mut rank) = (0, 0);
    // Leaf by leaf, and the sums of all that contain it.
    let mut sums = vec![[0.0_f64; 4]; tree.nodes() as usize];
    let mut open: Vec<(u32, u32)> = Vec::new();
    let bounds = [Vec3::from(file.meta.bounds_min), Vec3::from(file.meta.bounds_max)];
    while index < tree.nodes() {
        let skip = tree.node(index, bounds).skip;
        open.retain(|(_, end)| *end > index);
        open.push((index, skip));
        if skip == index + 1 {
            let leaf = tree.leaf(rank) as usize;
            let light = sent[leaf] * texels[leaf].area;
            for (node, _) in &open {
                let sum = &mut sums[*node as usize];
                (0..3).for_each(|channel| sum[channel] += f64::from(light[channel]));
                sum[3] += f64::from(texels[leaf].area);
            }
            rank += 1;
        }
        index += 1;
    }
    assert_eq!(rank, file.meta.texels);
    for (node, (found, expected)) in powers.iter().zip(&sums).enumerate() {
        let close = |(found, expected): (&f32, &f64)| (f64::from(*found) - expected).abs() <= 1.0e-5 * expected.abs();
        assert!(found.iter().zip(expected).all(close), "node {node}: {found:?} {expected:?}");
    }
}

#[test]
fn without_a_threshold_every_texel_counts() {
    let file = small_cornell_box();
    let texels = texels(file);
    let sent = radiance(&texels);
    let groups = [texels.len().div_ceil(64) as u32, 1, 1];
    let objects = [(file, Affine3A::IDENTITY)];
    let exact = with_light(&objects, &sent, 0.0);
    run(gpu(), "cssm/bounce.wgsl", "bounce", &exact, groups);
    let exact = exact.read_floats("gathered").expect("reads back");
    let rough = with_light(&objects, &sent, 0.1);
    run(gpu(), "cssm/bounce.wgsl", "bounce", &rough, groups);
    let rough = rough.read_floats("gathered").expect("reads back");
    let (mut sum, mut rough_sum, mut error, mut cut, mut rough_cut) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for index in 0..texels.len() {
        let found = Vec3::from_slice(&exact[4 * index..]);
        let near = Vec3::from_slice(&rough[4 * index..]);
        // Every third against the sum over all texels.
        if index % 3 == 0 {
            let expected = gather(&[Object { file, origin: Vec3::ZERO, radiance: &sent }], 0, index);
            assert!(found.distance(expected) <= 2.0e-4 * expected.length(), "{index}: {found} {expected}");
        }
        sum += found.x;
        rough_sum += near.x;
        error += (near.x - found.x).abs();
        cut += exact[4 * index + 3];
        rough_cut += rough[4 * index + 3];
    }
    let count = texels.len() as f32;
    println!("mean {}, mean error {}, cut {} and {}", sum / count, error / count, cut / count, rough_cut / count);
    assert!((rough_sum / sum - 1.0).abs() < 0.02, "energy {}", rough_sum / sum);
    assert!(error < 0.1 * sum && rough_cut < 0.8 * cut);
}

/// A cut's light is right in the mean where some texels are bright and others hidden: with lamps that cast shadows, each receiver sees
/// those that are lit more than those that are not.
#[test]
fn coarse_cuts_lose_no_light() {
    let file = cornell_box();
    let texels = texels(file);
    let lamps = lights(file);
    let sent: Vec<Vec3> = texels
        .iter()
        .map(|texel| Vec3::from(texel.diffuse) * direct(file, texel, &lamps) / std::f32::consts::PI)
        .collect();
    let groups = [texels.len().div_ceil(64) as u32, 1, 1];
    let gathered = |threshold: f32| {
        let lit = with_light(&[(file, Affine3A::IDENTITY)], &sent, threshold);
        run(gpu(), "cssm/bounce.wgsl", "bounce", &lit, groups);
        let floats = lit.read_floats("gathered").expect("reads back");
        let texel_light = |(texel, [r, g, b, cut]): (&Texel, &[f32; 4])| {
            let area = f64::from(texel.area);
            [area * f64::from(r + g + b), f64::from(*cut)]
        };
        let all: Vec<[f64; 2]> = texels.iter().zip(floats.as_chunks().0).map(texel_light).collect();
        all.iter().fold([0.0; 2], |[light, cut], [l, c]| [light + l, cut + c / texels.len() as f64])
    };
    let [exact, all] = gathered(0.0);
    let mean = exact / texels.iter().map(|texel| f64::from(texel.area)).sum::<f64>() / 3.0;
    for share in [0.02, 0.1, 0.5] {
        let [light, cut] = gathered((share * mean) as f32);
        println!("threshold {share} of the mean: {:.4} of the light, cuts of {cut:.0} of {all:.0}", light / exact);
        assert!((light / exact - 1.0).abs() < 0.01, "{} of the light", light / exact);
        assert!(cut < 0.8 * all);
    }
}

/// A block in the room, another of the same bake beside it, and one before the open side.
#[test]
fn objects_light_and_hide_each_other() {
    let (room, block) = (small_cornell_box(), small_block());
    let (low, high) = (Vec3::from(room.meta.bounds_min), Vec3::from(room.meta.bounds_max));
    let at = |x: f32, y: f32, z: f32| low + (high - low) * Vec3::new(x, y, z);
    let origins = [Vec3::ZERO, at(0.5, 0.75, 0.75), at(0.25, 0.5, 0.875), at(0.5, 0.25, 1.5)];
    let files = [room, block, block, block];
    let sent: Vec<Vec<Vec3>> = files.iter().map(|file| radiance(&texels(file))).collect();
    let placed: Vec<_> = files.iter().zip(origins).map(|(file, at)| (*file, Affine3A::from_translation(at))).collect();
    let lit = with_light(&placed, &sent.concat(), 0.0);
    let lights = sent.concat().len();
    let groups = [lights.div_ceil(64) as u32, 1, 1];
    run_with(gpu(), "cssm/bounce.wgsl", "bounce", &["SEVERAL"], &lit, groups);
    let found = read(&lit, "gathered");
    let objects = |count: usize| -> Vec<Object> {
        let all = files.iter().zip(origins).zip(&sent).take(count);
        all.map(|((file, origin), radiance)| Object { file, origin, radiance }).collect()
    };
    let (mut first, mut off, mut alone_off, mut checked) = (0, 0, 0, 0);
    for (number, (file, sent)) in files.iter().zip(&sent).enumerate() {
        for index in (0..file.meta.texels as usize).step_by(5) {
            let found = found[first + index];
            let expected = gather(&objects(files.len()), number, index);
            // A single one of the senders may be seen by one and not by the other, where rounding decides.
            off += usize::from(found.distance(expected) > 1.0e-3 * expected.length());
            alone_off +=
                usize::from(number == 0 && found.distance(gather(&objects(1), 0, index)) > 1.0e-2 * expected.length());
            checked += 1;
        }
        first += sent.len();
    }
    println!("{checked} texels, {off} off; {alone_off} of the room differ from the room alone");
    assert!(off * 50 <= checked, "{off} of {checked} texels are off");
    assert!(alone_off * 5 > checked, "the blocks have no effect");
}

/// A swarm of blocks far before the open side, of two sizes, lights a dark room: several of them may send as one.
#[test]
fn far_objects_are_taken_together() {
    // With many more of them, Mesa's software rasteriser ends the loops of threads that gather from every texel.
    const BLOCKS: usize = 16;
    let (room, block) = (cornell_box(), small_block());
    let (low, high) = (Vec3::from(room.meta.bounds_min), Vec3::from(room.meta.bounds_max));
    let size = high - low;
    let texels_of_room = texels(room);
    let place = |number: usize| {
        let at = number as f32;
        let spread = Vec3::new((at * 7.3).sin(), (at * 3.1).cos(), 3.0 + (at * 1.7).sin());
        let scale = Vec3::splat(if number.is_multiple_of(2) { 1.0 } else { 0.4 });
        let turn = bevy::math::Quat::from_rotation_y(at);
        Affine3A::from_scale_rotation_translation(scale, turn, low + size * (Vec3::splat(0.5) + 4.0 * spread))
    };
    let mut placed = vec![(room, Affine3A::IDENTITY)];
    placed.extend((0..BLOCKS).map(|number| (block, place(number))));
    let mut sent = vec![Vec3::ZERO; texels_of_room.len()];
    for number in 0..BLOCKS {
        let dim = if number.is_multiple_of(3) { 0.1 } else { 1.0 };
        sent.extend(radiance(&texels(block)).iter().map(|light| dim * *light));
    }
    let groups = [sent.len().div_ceil(64) as u32, 1, 1];
    let gathered = |threshold: f32| {
        let lit = with_light(&placed, &sent, threshold);
        run_with(gpu(), "cssm/bounce.wgsl", "bounce", &["SEVERAL"], &lit, groups);
        let floats = lit.read_floats("gathered").expect("reads back");
        let (mut light, mut cut) = (0.0, 0.0);
        for (texel, [r, g, b, nodes]) in texels_of_room.iter().zip(floats.as_chunks().0) {
            light += f64::from(texel.area) * f64::from(r + g + b);
            cut += f64::from(*nodes) / texels_of_room.len() as f64;
        }
        [light, cut]
    };
    let [exact, all] = gathered(0.0);
    let mean = exact / texels_of_room.iter().map(|texel| f64::from(texel.area)).sum::<f64>() / 3.0;
    for (share, most) in [(0.1, 0.5 * all), (1.0, 0.1 * all), (10.0, 0.5 * BLOCKS as f64)] {
        let [light, cut] = gathered((share * mean) as f32);
        println!("threshold {share} of the mean: {:.4} of the light, cuts of {cut:.1} of {all:.0}", light / exact);
        assert!((light / exact - 1.0).abs() < 0.03, "{} of the light", light / exact);
        assert!(cut > 0.0 && cut < most, "{cut} nodes");
    }
}
