//! Virtual lights that see by bakes, against exact rays.

use std::path::Path;

use bevy::math::{Affine3A, EulerRot, Quat, Vec3};
use bevy_bounce::cssm::words::PAGE_BITS;
use bevy_bounce_shaders::types::{AtlasParameters, NONE, Occluder, TILE_EMPTY, Vpl, VplHeader, tile_parts};
use bevy_bounce_tests::baked::{cornell_box, resources};
use bevy_bounce_tests::glb;
use bevy_bounce_tests::gpu::gpu;
use bevy_bounce_tests::scene::{run, run_with};
use bevy_bounce_tests::twins::random::Random;

use crate::shadow_atlas::{look, nearest};

const TILE: u32 = 24;
/// Of four parts.
const LARGE_TILE: u32 = 52;
const LIGHTS: usize = 64;

/// Lights anywhere on baked texels, of an object that is turned and half as large: they see what exact rays do.
#[test]
fn lights_see_what_rays_reach() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let scene = glb::read(&path).expect("a scene").scene;
    let place = Affine3A::from_scale_rotation_translation(
        Vec3::splat(0.5),
        Quat::from_euler(EulerRot::XYZ, 0.4, 0.9, -0.2),
        Vec3::new(3.0, -1.0, 0.5),
    );
    let (file, mut random) = (cornell_box(), Random::new(5));
    let light = |random: &mut Random| {
        let texel = file.texel((random.unit() * file.meta.texels as f32) as usize).expect("there are so many");
        let normal = Vec3::from(texel.normal);
        let aside = normal.any_orthonormal_vector() * (random.unit() - 0.5) * texel.area.sqrt();
        Vpl {
            position: place.transform_point3(Vec3::from(texel.position) + aside),
            normal: place.transform_vector3(normal).normalize(),
            ..Vpl::default()
        }
    };
    let mut vpls: Vec<Vpl> = (0..LIGHTS).map(|_| light(&mut random)).collect();
    // One in the air.
    let in_air = &mut vpls[LIGHTS - 1];
    in_air.position += in_air.normal * 0.5;
    let far = 4.0;
    let texels = (TILE * TILE) as usize;
    let draw = |tile: u32| {
        let parameters = AtlasParameters { tile, occluder_count: 0, far, point_area: 0.0, error: 0.0 };
        let bound = resources(gpu(), &[(file, place)], PAGE_BITS)
            .uniform("parameters", &parameters)
            .structs("header", &[VplHeader { count: LIGHTS as u32, ..VplHeader::default() }])
            .structs("vpls", &vpls)
            .zeroed("eyes", 2 * (LIGHTS + 8))
            .zeroed("atlas", (LIGHTS + 8) * (tile * tile) as usize);
        run(gpu(), "shadow_atlas/eyes.wgsl", "find_eyes", &bound, [2, 1, 1]);
        run(gpu(), "shadow_atlas/baked.wgsl", "draw_baked", &bound, [(LIGHTS + 8) as u32, 1, 1]);
        bound
    };
    let bound = draw(TILE);
    let eyes = bound.read_words("eyes").expect("reads back");
    let (eyes, _) = eyes.as_chunks::<2>();
    assert!(eyes[..LIGHTS - 1].iter().all(|[object, texel]| *object == 0 && *texel < file.meta.texels));
    assert!(eyes[LIGHTS - 1..].iter().all(|eye| *eye == [NONE; 2]), "in the air, and beyond the list");
    let words = bound.read_words("atlas").expect("reads back");
    assert!(words[(LIGHTS - 1) * texels..].iter().all(|word| *word == TILE_EMPTY));

    let large = draw(LARGE_TILE).uniform("grid", &scene.grid(0.1)).structs("occluders", &[Occluder::default()]);
    let baked = large.read_words("atlas").expect("reads back");
    let groups = [LIGHTS as u32, 1, tile_parts(LARGE_TILE)];
    run_with(gpu(), "shadow_atlas/rasterize.wgsl", "rasterize", &["BAKED"], &large, groups);
    assert_eq!(large.read_words("atlas").expect("reads back"), baked, "where nothing else casts, bakes stay");

    // Pairs of lights and texels that face each other, in the object's space.
    let into = place.inverse();
    let mut pairs = Vec::new();
    while pairs.len() < 20_000 {
        let light = (random.unit() * (LIGHTS - 1) as f32) as usize;
        let texel = file.texel((random.unit() * file.meta.texels as f32) as usize).expect("there are so many");
        let (eye, facing) = (&vpls[light], place.transform_vector3(Vec3::from(texel.normal)).normalize());
        let position = place.transform_point3(Vec3::from(texel.position));
        let way = (position - eye.position).normalize();
        if way.dot(eye.normal) > 0.02 && way.dot(facing) < -0.02 {
            pairs.push((light, position, facing));
        }
    }
    let exact = |&(light, position, facing): &(usize, Vec3, Vec3)| {
        let [from, to] = [vpls[light].position + vpls[light].normal * 1e-3, position + facing * 1e-3];
        let [from, to] = [from, to].map(|point| into.transform_point3(point));
        let blocked = nearest(&scene, from, (to - from).normalize(), 0.0);
        blocked.is_none_or(|distance| distance >= (to - from).length())
    };
    let exact: Vec<bool> = pairs.iter().map(exact).collect();
    let share = |seen: &[bool]| seen.iter().filter(|seen| **seen).count() as f64 / pairs.len() as f64;
    let mapped = look(bound, &pairs);
    let by_file: Vec<bool> = pairs
        .iter()
        .map(|&(light, position, _)| {
            let texel = file.texel(eyes[light][1] as usize).expect("there are so many");
            file.visible(&texel, into.transform_point3(position).to_array())
        })
        .collect();
    let alike = |a: &[bool], b: &[bool]| a.iter().zip(b).filter(|(a, b)| a == b).count() as f64 / pairs.len() as f64;
    let [file_right, map_right] = [&by_file, &mapped].map(|seen| alike(seen, &exact));
    let [rays, map] = [&exact, &mapped].map(|seen| share(seen));
    println!(
        "rays see {rays:.4}, maps {map:.4}; of the answers {file_right:.4} of the bake and {map_right:.4} of the maps are the rays'"
    );
    assert!((0.5..0.9).contains(&rays), "rays see {rays}");
    // What a map of 24 by 24 leaves of one of 32 by 32 a side of the cube.
    assert!(map_right > file_right - 0.03 && (map - rays).abs() < 0.06);
}
