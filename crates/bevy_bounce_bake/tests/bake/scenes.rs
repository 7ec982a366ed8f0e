//! Scenes to bake: random ones, a box, the repository's own, and bad ones.

use std::path::{Path, PathBuf};

use bevy_bounce_bake::{BakeError, BakeSettings, Scene, Source, bake};
use glam::Vec3;

/// A repository's generated scene.
pub fn cornell_box() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/cornell_box.glb")
}

/// Small settings.
pub fn small() -> BakeSettings {
    BakeSettings { atlas: 24, depth: 8, ..BakeSettings::default() }
}

/// Triangles of a box, seen from outside.
fn add_box(positions: &mut Vec<Vec3>, triangles: &mut Vec<[u32; 3]>, center: Vec3, size: Vec3) {
    for axis in 0..3 {
        for side in [-0.5, 0.5] {
            let first = positions.len() as u32;
            for (u, v) in [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)] {
                let mut corner = Vec3::ZERO;
                corner[axis] = side;
                corner[(axis + 1) % 3] = u;
                corner[(axis + 2) % 3] = v;
                positions.push(center + corner * size);
            }
            let quad = [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|corner| first + corner));
            triangles.extend(if side > 0.0 { quad } else { quad.map(|[a, b, c]| [a, c, b]) });
        }
    }
}

/// Boxes in all positions, some within another, and triangles in between that belong to no solid.
pub fn random(seed: u64) -> Scene {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut point = move |scale: f32| Vec3::from([(); 3].map(|()| (rng.f32() - 0.5) * scale));
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..2 + seed % 3 {
        let size = point(3.0).abs() + Vec3::splat(0.2);
        add_box(&mut positions, &mut triangles, point(6.0), size);
    }
    for _ in 0..3 + seed % 4 {
        let first = positions.len() as u32;
        let middle = point(6.0);
        positions.extend([middle + point(3.0), middle + point(3.0), middle + point(3.0)]);
        triangles.push([first, first + 1, first + 2]);
    }
    Scene::from_mesh("random", positions, triangles).expect("it has triangles")
}

fn problem(result: Result<Scene, BakeError>) -> String {
    result.and_then(|scene| bake(&scene, &small(), &())).map_or_else(|error| error.to_string(), |_| "none".to_owned())
}

#[test]
fn meshes_that_cannot_be_baked_are_named() {
    let corners = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    let mesh = |positions: &[Vec3], triangles: &[[u32; 3]]| {
        problem(Scene::from_mesh("statue.glb", positions.to_vec(), triangles.to_vec()))
    };
    let nan = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, f32::NAN, 0.0)];
    let huge = [Vec3::ZERO, Vec3::X * 1.0e30, Vec3::Y * 1.0e30];
    for (said, wanted) in [
        (mesh(&corners, &[]), "no triangle"),
        (mesh(&corners, &[[0, 0, 1], [1, 2, 2]]), "no triangle"),
        (mesh(&[Vec3::ZERO, Vec3::X, Vec3::X * 2.0], &[[0, 1, 2]]), "no triangle"),
        (mesh(&nan, &[[0, 1, 2]]), "vertex 2"),
        (mesh(&corners, &[[0, 1, 7]]), "index 7"),
        (mesh(&huge, &[[0, 1, 2]]), "scale it"),
    ] {
        assert!(said.contains("statue.glb") && said.contains(wanted), "{said}");
    }
}

#[test]
fn open_degenerate_and_non_manifold_meshes_are_baked() {
    // Three triangles on one edge, one of them twice, and one without area.
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.3, -1.0, -0.4)];
    let triangles = vec![[0, 1, 2], [0, 1, 3], [0, 1, 4], [0, 1, 4], [2, 2, 3]];
    let said = problem(Scene::from_mesh("fins", positions, triangles));
    assert_eq!(said, "none");
}

#[test]
fn overlapping_and_crowded_second_sets_are_named() {
    let mut scene = random(1);
    let count = scene.parts[0].positions.len();
    scene.parts[0].uv1 =
        Some((0..count).map(|corner| glam::Vec2::new((corner % 2) as f32, (corner / 2 % 2) as f32)).collect());
    let said = problem(Ok(scene.clone()));
    assert!(said.contains("random") && said.contains("TEXCOORD_1") && said.contains("texel ("), "{said}");
    let unwrapped = bake(&scene, &BakeSettings { unwrap: true, ..small() }, &());
    assert!(unwrapped.is_ok());
}

#[test]
fn an_atlas_too_small_is_named() {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for number in 0..60 {
        add_box(&mut positions, &mut triangles, Vec3::X * number as f32, Vec3::splat(0.5));
    }
    let scene = Scene::from_mesh("bricks", positions, triangles).expect("it has triangles");
    let said = bake(&scene, &BakeSettings { atlas: 8, ..small() }, &()).map(|_| ()).map_err(|error| error.to_string());
    assert!(said.is_err_and(|said| said.contains("atlas of 8") && said.contains("larger --atlas")));
}

#[test]
fn broken_gltf_files_are_named() {
    let bytes = std::fs::read(cornell_box()).expect("the repository has it");
    let said =
        |bytes: &[u8]| problem(Source::parse("room.glb".into(), bytes).and_then(|source| Scene::from_gltf(&source)));
    assert_eq!(said(&bytes), "none");
    for (bytes, wanted) in [
        (vec![], "is empty"),
        (bytes[..bytes.len() - 40].to_vec(), "truncated"),
        (b"glTF\x01\0\0\0\x0c\0\0\0".to_vec(), "version 1"),
        (b"{ \"asset\": 3 }".to_vec(), "not valid glTF"),
    ] {
        let said = said(&bytes);
        assert!(said.contains("room.glb") && said.contains(wanted), "{said}");
    }
}

#[test]
fn flipped_bytes_of_a_gltf_file_do_no_harm() {
    let bytes = std::fs::read(cornell_box()).expect("the repository has it");
    let mut rng = fastrand::Rng::with_seed(8);
    for _ in 0..2000 {
        let mut damaged = bytes.clone();
        for _ in 0..rng.usize(1..4) {
            let at = rng.usize(0..damaged.len());
            damaged[at] = rng.u8(..);
        }
        // Whatever comes of it, it is no panic.
        let scene = Source::parse("room.glb".into(), &damaged).and_then(|source| Scene::from_gltf(&source));
        drop(scene);
    }
}
