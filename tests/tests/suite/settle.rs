//! Virtual lights are set on the first surface that their path met.

use std::collections::BTreeSet;
use std::f32::consts::{PI, TAU};

use bevy::math::{Affine3A, UVec3, Vec3, Vec4};
use bevy_bounce_shaders::types::{CHUNK_TRIANGLES, Grid, INSTANCE_TWO_SIDED, LIST_ENTRY_WORDS, Material, Vpl};
use bevy_bounce_tests::gpu::gpu;
use bevy_bounce_tests::scene::{TestScene, list_triangles, settled};

use crate::paths::{Traced, point_light};
use crate::shadow_atlas::pack_incoming;

const VOXEL: f32 = 0.2;

/// A square of that half width about a point, that faces up.
fn square(center: Vec3, half: f32) -> [[Vec3; 3]; 2] {
    let corner = |x: f32, z: f32| center + Vec3::new(x, 0.0, z) * half;
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    [[a, b, c], [a, c, d]]
}

/// A floor that is much larger than a brick, and squares over it, one beside the other.
fn scene() -> TestScene {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let masked = scene.materials.len() as u32;
    scene.materials.push(Material { albedo: Vec4::new(0.5, 0.5, 0.5, 0.1), alpha_cutoff: 0.5, ..scene.materials[0] });
    scene.soup(&square(Vec3::ZERO, 6.0));
    let place = Affine3A::IDENTITY;
    scene.mesh(&square(Vec3::new(-3.0, 0.1, 0.0), 0.5), 0, 0, place);
    scene.mesh(&square(Vec3::new(-1.0, 0.1, 0.0), 0.5), masked, 0, place);
    let backs = |x| square(Vec3::new(x, 0.1, 0.0), 0.5).map(|[a, b, c]| [a, c, b]);
    scene.mesh(&backs(1.0), 0, 0, place);
    scene.mesh(&backs(3.0), 0, INSTANCE_TWO_SIDED, place);
    scene
}

/// Lights whose paths came down, freely for so many voxels, where they are put.
fn set(scene: &TestScene, lights: &[(Vec3, f32, u32)]) -> Vec<Vpl> {
    let vpls: Vec<Vpl> = lights
        .iter()
        .map(|&(position, reach, bounce_met)| Vpl {
            position,
            bounce_met,
            normal: Vec3::X,
            flux: Vec3::ONE,
            incoming: pack_incoming(Vec3::NEG_Y, reach),
            ..Vpl::default()
        })
        .collect();
    settled(gpu(), scene, &scene.grid(VOXEL), &vpls)
}

#[test]
fn lights_are_set_on_the_first_surface_that_shows_its_front() {
    // On the floor, on a square over it, through one that is masked out, through the back of one, on one with two sides.
    let heights = [(-5.0, 0.0), (-3.0, 0.1), (-1.0, 0.0), (1.0, 0.0), (3.0, 0.1)];
    let lights = heights.map(|(x, _)| (Vec3::new(x, 0.05, 0.1), 1.5, 1));
    for (vpl, (x, height)) in set(&scene(), &lights).iter().zip(heights) {
        let place = Vec3::new(x, height, 0.1);
        assert!((vpl.position - place).length() < 1e-4 * VOXEL + 1e-6, "{} instead of {place}", vpl.position);
        assert!(vpl.normal.distance(Vec3::Y) < 1e-3, "{x}: normal {}", vpl.normal);
    }
}

#[test]
fn lights_stay_where_nothing_is_near() {
    let above = 1.6 * VOXEL;
    let below = -1.6 * VOXEL;
    let lights = [
        // Too far over the floor, and too far under it.
        (Vec3::new(-5.0, above, 0.1), 1.5, 1),
        (Vec3::new(-5.0, below, 0.1), 1.5, 1),
        // Their light started below the square.
        (Vec3::new(-3.0, -0.05, 0.1), 0.3, 1),
        // On an emissive surface.
        (Vec3::new(-3.0, 0.05, 0.1), 1.5, 0),
    ];
    let found = set(&scene(), &lights);
    for index in [0, 1, 3] {
        assert_eq!((found[index].position, found[index].normal), (lights[index].0, Vec3::X), "light {index}");
    }
    assert!((found[2].position.y).abs() < 1e-4, "{} is not on the floor", found[2].position);
}

/// Two tiles in one voxel, each of its own colour.
#[test]
fn lights_have_the_colour_of_the_triangle_that_they_met() {
    // Their brightest channel is 1: no path ends, and what it carries on is the colour itself.
    let tiles = [(-0.08, Vec3::new(1.0, 0.2, 0.4)), (-0.04, Vec3::new(0.6, 1.0, 0.2))];
    let mut scene = TestScene::new(Vec3::ONE);
    for (x, color) in tiles {
        scene.materials.push(Material { albedo: color.extend(1.0), ..scene.materials[0] });
        let material = scene.materials.len() as u32 - 1;
        scene.mesh(&square(Vec3::new(x, 0.0, 0.0), 0.02), material, 0, Affine3A::IDENTITY);
    }
    let places = tiles.map(|(x, _)| Vec3::new(x, 0.0, 0.005));
    let grid = scene.grid(VOXEL);
    let [first, second] = places.map(|place| ((place - grid.origin) / VOXEL).as_uvec3());
    assert_eq!(first, second, "the tiles are not in one voxel");
    let lights = places.map(|place| (place + 0.05 * Vec3::Y, 1.5, 1));
    for (vpl, (x, color)) in set(&scene, &lights).iter().zip(tiles) {
        assert!((vpl.flux - color).abs().max_element() < 0.5 / 255.0 + 1e-6, "{x}: {} instead of {color}", vpl.flux);
    }
}

/// A closed shell, seen from both sides: an ellipsoid.
fn cushion(center: Vec3, radii: Vec3) -> Vec<[Vec3; 3]> {
    const AROUND: u32 = 24;
    const ALONG: u32 = 12;
    let at = |i: u32, j: u32| {
        let (turn, height) = (TAU * (i % AROUND) as f32 / AROUND as f32, PI * j as f32 / ALONG as f32);
        center + radii * Vec3::new(height.sin() * turn.cos(), height.cos(), height.sin() * turn.sin())
    };
    let quads = (0..AROUND).flat_map(|i| (0..ALONG).map(move |j| (i, j)));
    quads
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)];
            [[a, b, c], [a, c, d]]
        })
        .filter(|[a, b, c]| (*b - *a).cross(*c - *a).length() > 1e-6)
        .collect()
}

/// Cushions on a floor, which touch each other, under a lamp: what bounces between them lights none from within.
#[test]
fn no_light_comes_into_closed_things() {
    let mut scene = TestScene::new(Vec3::splat(0.8));
    scene.room(Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 3.0, 3.0));
    let radii = Vec3::new(0.8, 0.3, 0.6);
    let centers =
        [[-1.3, 0.3, 0.0], [0.0, 0.3, 0.3], [1.25, 0.3, -0.2], [-0.6, 0.8, 0.0], [0.7, 0.8, 0.1]].map(Vec3::from);
    for center in centers {
        scene.mesh(&cushion(center, radii), 0, INSTANCE_TWO_SIDED, Affine3A::IDENTITY);
    }
    scene.lights.push(point_light(Vec3::new(0.3, 2.5, 0.4), Vec3::splat(100.0)));
    let traced = Traced::new(&scene, VOXEL, 4);
    let mut flux = [[0.0; 2]; 5];
    for vertex in traced.all() {
        let is_within = centers.iter().any(|center| ((vertex.position - *center) / radii).length() < 0.97)
            || centers.iter().any(|center| {
                let off = (vertex.position - *center) / radii;
                off.length() < 1.02 && vertex.normal.dot(off / radii) < 0.0
            });
        flux[vertex.bounce() as usize][usize::from(is_within)] += vertex.flux.y;
    }
    for (bounce, [without, within]) in flux.iter().enumerate().skip(1) {
        let share = within / (without + within);
        println!("bounce {bounce}: {share:.4} of the light within cushions");
        assert!(share < 0.01, "bounce {bounce}: {share} of the light within cushions");
    }
}

/// Voxel and triangle of each entry of the lists; none is there twice.
fn listed(scene: &TestScene, grid: &Grid, queue_entries: Option<usize>) -> BTreeSet<(usize, u32)> {
    let resources = scene.resources(gpu()).uniform("grid", grid);
    let lists = list_triangles(gpu(), scene, grid, &resources, queue_entries).read_words("lists").expect("reads back");
    let voxels = grid.dims.element_product() as usize;
    let mut entries = BTreeSet::new();
    for voxel in 0..voxels {
        let mut next = lists[1 + voxel] as usize;
        while next != 0 {
            assert!(entries.insert((voxel, lists[next])), "triangle {} is in voxel {voxel} twice", lists[next]);
            next = lists[next + 1] as usize;
        }
    }
    assert_eq!(entries.len(), lists[0] as usize, "entries are left out");
    assert!(1 + voxels + entries.len() * LIST_ENTRY_WORDS as usize <= lists.len());
    entries
}

/// Large triangles by the queue of bricks or, where that is full, without: each is in the list of every voxel that it goes through, and of
/// none that it does not come near.
#[test]
fn triangles_are_listed_where_they_are() {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let floor = square(Vec3::ZERO, 6.0);
    let shell = cushion(Vec3::new(0.4, 1.0, -0.3), Vec3::new(0.8, 0.3, 0.6));
    scene.soup(&floor);
    scene.mesh(&shell, 0, 0, Affine3A::IDENTITY);
    let grid = scene.grid(VOXEL);
    let entries = listed(&scene, &grid, None);
    assert_eq!(listed(&scene, &grid, Some(3)), entries);
    let voxel_of = |point: Vec3| ((point - grid.origin) / grid.voxel_size).floor().as_uvec3();
    let index_of = |voxel: UVec3| ((voxel.z * grid.dims.y + voxel.y) * grid.dims.x + voxel.x) as usize;
    // Each mesh begins with a chunk of its own.
    let numbered = (0..).zip(floor).chain((CHUNK_TRIANGLES..).zip(shell));
    let mut inside = BTreeSet::new();
    for (triangle, [a, b, c]) in numbered.clone() {
        for i in 0..=60 {
            for j in 0..=60 - i {
                let point = a + (b - a) * (i as f32 / 60.0) + (c - a) * (j as f32 / 60.0);
                inside.insert((index_of(voxel_of(point)), triangle));
            }
        }
    }
    let missed: Vec<_> = inside.difference(&entries).collect();
    assert!(missed.is_empty(), "{} of {} are not listed: {:?}", missed.len(), inside.len(), missed.first());
    for (triangle, corners) in numbered {
        let [low, high] = [Vec3::min, Vec3::max].map(|of| of(corners[0], of(corners[1], corners[2])));
        let (first, last) = (voxel_of(low - 2e-3 * VOXEL), voxel_of(high + 2e-3 * VOXEL));
        let near = |voxel: usize| {
            let (x, y) = (voxel as u32 % grid.dims.x, voxel as u32 / grid.dims.x);
            let place = UVec3::new(x, y % grid.dims.y, y / grid.dims.y);
            place.cmpge(first).all() && place.cmple(last).all()
        };
        assert!(entries.iter().all(|&(voxel, listed)| listed != triangle || near(voxel)), "triangle {triangle}");
    }
    println!("{} entries, {} of them by points on the triangles", entries.len(), inside.len());
}
