//! Every decoded depth lies strictly between the first and the second surface of its ray.

use bevy_bounce_bake::{BakeSettings, Scene, Strategy, bake};
use bevy_bounce_cssm::cube::FacePoint;
use bevy_bounce_cssm::{CssmFile, UNBOUNDED};
use glam::DVec3;

use crate::scenes::random;

/// Rays that pass an edge, or a plane edge on, closer than this may meet it or not, by rounding.
const DOUBT: f64 = 2.0e-4;

/// All surfaces along a ray, nearest first, in double precision and triangle by triangle; nothing where rounding decides.
fn surfaces(scene: &Scene, origin: DVec3, direction: DVec3) -> Option<Vec<f64>> {
    let mut depths = Vec::new();
    for corners in scene.triangles() {
        // Moeller and Trumbore 1997.
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let p = direction.cross(ac);
        let determinant = ab.dot(p);
        if (determinant / (ab.cross(ac).length() * direction.length())).abs() < DOUBT {
            return None;
        }
        let t = origin - a;
        let u = t.dot(p) / determinant;
        let q = t.cross(ab);
        let v = direction.dot(q) / determinant;
        let depth = ac.dot(q) / determinant;
        let inside = u.min(v).min(1.0 - u - v);
        if depth > -1.0e-6 && inside.abs() < DOUBT {
            return None;
        }
        if inside > 0.0 && depth > 0.0 {
            depths.push(depth);
        }
    }
    depths.sort_by(f64::total_cmp);
    Some(depths)
}

#[derive(Default, Debug)]
struct Count {
    checked: u64,
    close: u64,
    doubtful: u64,
}

/// Checks all pixels on the front of a few texels' maps.
fn check(scene: &Scene, file: &CssmFile, count: &mut Count) {
    let side = file.meta.depth;
    let quantum = f64::from(file.meta.quantum);
    for index in (0..file.meta.texels as usize).step_by(3) {
        let texel = file.texel(index).expect("in range");
        let origin = DVec3::from(file.center(&texel).map(f64::from));
        for (face, pixel) in
            (0..6 * side * side).map(|pixel| (pixel / (side * side), [pixel % side, pixel / side % side]))
        {
            let at = pixel.map(|at| at as f32 + 0.5);
            let direction = DVec3::from(FacePoint { face, at, depth: 1.0 }.direction(side).map(f64::from));
            if direction.dot(DVec3::from(texel.normal.map(f64::from))) < 1.0e-5 {
                continue;
            }
            let Some(depths) = surfaces(scene, origin, direction) else {
                count.doubtful += 1;
                continue;
            };
            let code = file.code(&texel, face, pixel).expect("in range");
            let depth = f64::from(file.quantizer().depth(code));
            let Some(&first) = depths.first() else {
                assert_eq!(code, UNBOUNDED, "texel {index} face {face} pixel {pixel:?}: nothing there");
                continue;
            };
            let behind = depths.iter().copied().find(|depth| depth - first > 1.01 * quantum);
            let near = depths.get(1).is_some_and(|second| second - first < 2.3 * quantum);
            if near {
                count.close += 1;
                continue;
            }
            count.checked += 1;
            let second = behind.unwrap_or(f64::INFINITY);
            let between = first < depth && (depth < second || code == UNBOUNDED && second.is_infinite());
            assert!(between, "texel {index} face {face} pixel {pixel:?}: {first} {depth} {second}");
        }
    }
}

#[test]
fn decoded_depths_lie_between_the_surfaces() {
    let mut count = Count::default();
    for seed in 0..8 {
        let scene = random(seed);
        for strategy in Strategy::ALL {
            for (atlas, depth) in [(16, 16), (40, 8)] {
                let settings = BakeSettings { atlas, depth, strategy, unwrap: false };
                let (file, report) = bake(&scene, &settings, &()).expect("it can be baked");
                let file = CssmFile::from_bytes(&file.to_bytes()).expect("what was written can be read");
                assert!(report.ratio > 1.0 && report.runs > 0);
                check(&scene, &file, &mut count);
            }
        }
    }
    println!("{count:?}");
    assert!(count.checked > 100_000, "{count:?}");
    assert!(count.doubtful + count.close < count.checked / 20, "{count:?}");
}

#[test]
fn close_surfaces_are_counted() {
    let sheet = |z: f32| [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| glam::Vec3::new(x, y, z));
    // A floor that looks up at two sheets, a tenth of a quantum apart.
    let positions = [sheet(0.0), sheet(0.5), sheet(0.500_002)].concat();
    let triangles =
        (0..3).flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|corners| corners.map(|corner| 4 * quad + corner)));
    let scene = Scene::from_mesh("sheets", positions, triangles.collect()).expect("it has triangles");
    let settings = BakeSettings { atlas: 24, depth: 8, ..BakeSettings::default() };
    let (file, _) = bake(&scene, &settings, &()).expect("it can be baked");
    assert!(file.meta.close > 0 && file.meta.close < file.meta.rays);
}
