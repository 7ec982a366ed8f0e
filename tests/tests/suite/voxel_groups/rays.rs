//! Rays, areas and paths through groups, shader by shader.

use bevy::math::{Affine3A, EulerRot, Mat3, Quat, Vec3};
use bevy_bounce_shaders::types::{BRICK_WORDS, GROUP_EDGE, Grid, INSTANCE_FLIPPED, LIGHT_POINT, Light};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, add_groups, count_of, cuboid, run, voxelize};
use bevy_bounce_tests::twins::random::Random;

use crate::paths::intersect;

const SHOOT: &str = "
    #import bevy_bounce::shared::rays::{trace, to_grid, grid, Ray}
    @group(0) @binding(0) var<storage, read> rays: array<vec4<f32>>;
    @group(0) @binding(1) var<storage, read_write> hits: array<vec4<f32>>;
    @compute @workgroup_size(64)
    fn shoot(@builtin(global_invocation_id) id: vec3<u32>) {
        if 2u * id.x >= arrayLength(&hits) {
            return;
        }
        var ray: Ray;
        ray.origin = to_grid(rays[2u * id.x].xyz);
        ray.direction = rays[2u * id.x + 1u].xyz;
        ray.length = rays[2u * id.x].w / grid.voxel_size;
        let hit = trace(ray);
        hits[2u * id.x] = vec4<f32>(hit.normal, select(-1.0, hit.t * grid.voxel_size, hit.found));
        hits[2u * id.x + 1u] = vec4<f32>(f32(hit.group), 0.0, 0.0, 0.0);
    }";

struct Hit {
    /// Negative where nothing was met.
    t: f32,
    normal: Vec3,
    group: u32,
}

fn shoot(resources: Resources, rays: &[(Vec3, Vec3)]) -> Vec<Hit> {
    let packed: Vec<f32> = rays.iter().flat_map(|(o, d)| [o.x, o.y, o.z, 1e4, d.x, d.y, d.z, 0.0]).collect();
    let resources = resources.floats("rays", &packed).zeroed("hits", 8 * rays.len());
    let kernel = gpu().kernel(&compose_source(SHOOT, "shoot.wgsl", &[]).expect("composes"), "shoot");
    let groups = rays.len().div_ceil(64) as u32;
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [groups, 1, 1]).expect("runs");
    let words = resources.read_floats("hits").expect("reads back");
    let hit = |word: &[f32; 8]| Hit { t: word[3], normal: Vec3::new(word[0], word[1], word[2]), group: word[4] as u32 };
    words.as_chunks().0.iter().map(hit).collect()
}

/// A table with a box on it, in a space of its own.
fn furniture(flags: u32) -> TestScene {
    let mut scene = TestScene::new(Vec3::splat(0.6));
    let (low, high) = (Vec3::new(-0.5, 0.0, -0.3), Vec3::new(0.5, 0.08, 0.3));
    scene.mesh(&cuboid(low, high), 0, flags, Affine3A::IDENTITY);
    let (low, high) = (Vec3::new(-0.31, 0.08, -0.17), Vec3::new(0.07, 0.43, 0.21));
    scene.mesh(&cuboid(low, high), 0, flags, Affine3A::IDENTITY);
    scene
}

/// The table as it is, and for mirrors: seen from where its triangles wind the other way.
fn tables() -> [(TestScene, Grid); 2] {
    [0, INSTANCE_FLIPPED].map(|flags| {
        let scene = furniture(flags);
        let grid = group_grid(&scene);
        (scene, grid)
    })
}

/// A grid as groups have it.
pub fn group_grid(scene: &TestScene) -> Grid {
    let (low, high) = scene.bounds();
    scene.grid((high - low).max_element() / (GROUP_EDGE - 4) as f32)
}

fn room() -> TestScene {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    scene.room(Vec3::new(-2.0, 0.0, -1.5), Vec3::new(2.0, 2.5, 1.5));
    scene
}

/// Turned, stretched unevenly, mirrored, and sheared.
fn placements() -> Vec<(usize, Affine3A)> {
    let turn = |x, y, z| Quat::from_euler(EulerRot::XYZ, x, y, z);
    let shear = Affine3A::from_mat3_translation(
        Mat3::from_cols(Vec3::X, Vec3::new(0.4, 1.0, 0.1), Vec3::Z),
        Vec3::new(-0.2, 1.63, 0.71),
    );
    vec![
        (0, Affine3A::from_rotation_translation(turn(0.3, 0.7, 0.2), Vec3::new(-1.1, 0.9, -0.4))),
        (
            0,
            Affine3A::from_scale_rotation_translation(
                Vec3::new(0.7, 1.9, 1.2),
                turn(0.0, 2.1, 0.5),
                Vec3::new(1.0, 0.6, -0.2),
            ),
        ),
        (
            1,
            Affine3A::from_scale_rotation_translation(
                Vec3::new(-1.0, 0.8, 1.0),
                turn(1.3, 0.2, 0.0),
                Vec3::new(0.1, 1.7, -0.9),
            ),
        ),
        (0, shear),
    ]
}

#[test]
fn rays_meet_groups_where_they_stand() {
    let (world, tables) = (room(), tables());
    let (grid, (group, own)) = (world.grid(0.11), &tables[0]);
    let placed = placements();
    let grids = tables.each_ref().map(|(scene, grid)| (scene, *grid));
    let resources = add_groups(gpu(), voxelize(gpu(), &world, &grid, None), &grids, &placed);
    let mut triangles: Vec<([Vec3; 3], u32)> = world.triangles.iter().map(|t| (*t, 0)).collect();
    for (index, (_, place)) in (1..).zip(&placed) {
        triangles.extend(group.triangles.iter().map(|t| (t.map(|p| place.transform_point3(p)), index)));
    }
    let mut random = Random::new(5);
    // From the walls' side of everything: not within a group.
    let rays: Vec<(Vec3, Vec3)> = (0..8000)
        .map(|_| {
            let origin = Vec3::new(0.0, 1.25, 0.0) + random.vector() * Vec3::new(1.9, 1.15, 1.4);
            (origin, random.direction())
        })
        .filter(|(origin, _)| {
            placed.iter().all(|(_, place)| {
                let local = place.inverse().transform_point3(*origin);
                !(local.cmpgt(Vec3::new(-0.6, -0.1, -0.4)).all() && local.cmplt(Vec3::new(0.6, 0.53, 0.4)).all())
            })
        })
        .collect();
    assert!(rays.len() > 3000, "{} rays", rays.len());
    let hits = shoot(resources, &rays);
    let (mut missed, mut off, mut turned, mut other) = (0, 0, 0, 0);
    let mut met = vec![0; placed.len() + 1];
    for (&(origin, direction), hit) in rays.iter().zip(&hits) {
        let ways = triangles.iter().filter_map(|(t, index)| Some((intersect(t, origin, direction)?, t, *index)));
        let Some((exact, [a, b, c], index)) = ways.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
        met[index as usize] += 1;
        let size = if index == 0 { grid.voxel_size } else { 1.9 * own.voxel_size };
        if hit.t < 0.0 {
            missed += 1;
        } else if (hit.t - exact).abs() > size {
            off += 1;
        } else {
            other += usize::from(hit.group != index);
            turned += usize::from(hit.normal.dot((*b - *a).cross(*c - *a).normalize()) < 0.99);
        }
    }
    println!("{missed} missed, {off} off, {other} of another group, {turned} turned; met {met:?} of {}", rays.len());
    assert!(met[1..].iter().all(|count| *count > 100), "{met:?}");
    assert!(missed * 200 <= rays.len(), "{missed} of {} rays leave a closed room", rays.len());
    assert!(off * 50 <= rays.len(), "{off} of {} rays end a voxel and more off", rays.len());
    assert!(other * 100 <= rays.len() && turned * 50 <= rays.len(), "{other} of another group, {turned} turned");
}

/// A ray that starts on a group leaves it, and one that ends there arrives.
#[test]
fn surfaces_of_groups_do_not_hide_themselves() {
    const LOOK: &str = "
        #import bevy_bounce::shared::rays::{trace, to_grid, grid, Ray}
        @group(0) @binding(0) var<storage, read> ends: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> seen: array<u32>;
        @compute @workgroup_size(64)
        fn look(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&seen) {
                return;
            }
            let way = ends[4u * id.x + 1u].xyz - ends[4u * id.x].xyz;
            var ray: Ray;
            ray.origin = to_grid(ends[4u * id.x].xyz);
            ray.direction = normalize(way);
            ray.length = length(way) / grid.voxel_size;
            ray.start_normal = ends[4u * id.x + 2u].xyz;
            ray.end_normal = ends[4u * id.x + 3u].xyz;
            ray.gap = 0.25;
            seen[id.x] = u32(!trace(ray).found);
        }";
    let (world, mut group) = (room(), TestScene::new(Vec3::ONE));
    group.soup(&cuboid(Vec3::splat(-0.4), Vec3::splat(0.4)));
    let place = Affine3A::from_scale_rotation_translation(
        Vec3::new(1.4, 0.7, 1.0),
        Quat::from_euler(EulerRot::XYZ, 0.4, 0.9, 0.2),
        Vec3::new(0.13, 1.21, 0.07),
    );
    let grid = world.grid(0.11);
    let resources =
        add_groups(gpu(), voxelize(gpu(), &world, &grid, None), &[(&group, group_grid(&group))], &[(0, place)]);
    let mut random = Random::new(77);
    let mut ends = Vec::new();
    let mut expected = Vec::new();
    while expected.len() < 2000 {
        let triangle = group.triangles[random.below(12) as usize].map(|p| place.transform_point3(p));
        let [a, b, c] = triangle;
        let (mut u, mut v) = (0.5 + 0.5 * random.vector().x, 0.5 + 0.5 * random.vector().x);
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let on = a + (b - a) * u + (c - a) * v;
        let normal = (b - a).cross(c - a).normalize();
        let away = Vec3::new(0.0, 1.25, 0.0) + random.vector() * Vec3::new(1.9, 1.15, 1.4);
        let local = place.inverse().transform_point3(away);
        // Neither within the block nor at a grazing angle.
        let slope = (away - on).normalize().dot(normal);
        if local.abs().max_element() < 0.5 || slope.abs() < 0.2 || (away - on).length() < 0.4 {
            continue;
        }
        // Surfaces let pass what comes from behind: what is hidden is hidden to rays that come.
        let (from, to, from_normal, to_normal) = if slope > 0.0 && random.below(2) == 0 {
            (on, away, normal, Vec3::ZERO)
        } else {
            (away, on, Vec3::ZERO, normal)
        };
        for p in [from, to, from_normal, to_normal] {
            ends.extend([p.x, p.y, p.z, 0.0]);
        }
        expected.push(slope > 0.0);
    }
    let resources = resources.floats("ends", &ends).zeroed("seen", expected.len());
    let kernel = gpu().kernel(&compose_source(LOOK, "look.wgsl", &[]).expect("composes"), "look");
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [32, 1, 1]).expect("runs");
    let seen = resources.read_words("seen").expect("reads back");
    let count = |open: bool| expected.iter().filter(|e| **e == open).count();
    let wrong = |open: bool| seen.iter().zip(&expected).filter(|(s, e)| **e == open && (**s == 1) != open).count();
    println!("open: {} of {} wrong; hidden: {} of {} wrong", wrong(true), count(true), wrong(false), count(false));
    assert!(wrong(true) * 50 <= count(true), "{} of {} rays meet the surface they stand on", wrong(true), count(true));
    assert!(wrong(false) * 20 <= count(false), "{} of {} rays go through the block", wrong(false), count(false));
}

#[test]
fn areas_of_groups_are_those_of_their_triangles() {
    // Voxels of the world that are some three and forty times as large as a group's.
    for voxel_size in [0.11, 1.6] {
        assert_areas(voxel_size);
    }
}

fn assert_areas(voxel_size: f32) {
    let (world, tables) = (room(), tables());
    let (grid, group) = (world.grid(voxel_size), &tables[0].0);
    let placed = placements();
    let grids = tables.each_ref().map(|(scene, grid)| (scene, *grid));
    let resources = add_groups(gpu(), voxelize(gpu(), &world, &grid, None), &grids, &placed)
        .zeroed("bricks", count_of(&grid, 8) * BRICK_WORDS as usize);
    let before = resources.read_words("counters").expect("reads back")[2];
    let threads = placed.len() as u32 * GROUP_EDGE.pow(3);
    run(gpu(), "vpl/group_areas.wgsl", "add_group_areas", &resources, [threads / 64, 1, 1]);
    let bricks = resources.read_words("bricks").expect("reads back");
    let steps: f64 = bricks.chunks(BRICK_WORDS as usize).map(|brick| f64::from(brick[3])).sum();
    let found = steps as f32 / 65536.0 * grid.voxel_size * grid.voxel_size;
    let area = |[a, b, c]: [Vec3; 3]| 0.5 * (b - a).cross(c - a).length();
    let expected: f32 = placed
        .iter()
        .flat_map(|(_, place)| group.triangles.iter().map(|t| area(t.map(|p| place.transform_point3(p)))))
        .sum();
    println!("{found} of {expected} square metres");
    assert!((found / expected - 1.0).abs() < 0.02, "{found} of {expected}");
    let counted = resources.read_words("counters").expect("reads back")[2] - before;
    let counted = counted as f32 / 256.0 * grid.voxel_size * grid.voxel_size;
    assert!((counted / expected - 1.0).abs() < 0.05, "{counted} of {expected}");
}

/// The light of a lamp in a closed room with a group in it goes round in it without loss.
#[test]
fn no_light_is_lost_between_grids() {
    let (mut world, mut group) = (room(), TestScene::new(Vec3::ONE));
    world.materials[0].albedo = Vec3::ONE.extend(1.0);
    group.soup(&cuboid(Vec3::new(-0.4, -0.5, -0.3), Vec3::new(0.4, 0.5, 0.3)));
    world.lights.push(Light {
        position: Vec3::new(0.9, 1.9, 0.6),
        kind: LIGHT_POINT,
        color: Vec3::splat(10.0),
        cumulative_power: 40.0 * std::f32::consts::PI,
        max_bounces: u32::MAX,
        ..Default::default()
    });
    let place =
        Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::XYZ, 0.4, 0.9, 0.2), Vec3::new(-0.4, 1.1, 0.1));
    let grid = world.grid(0.11);
    let own = group_grid(&group);
    let traced = crate::paths::Traced::with_groups(&world, grid, 8, &[(&group, own)], &[(0, place)]);
    let lost = traced.paths.iter().filter(|path| path.length < 8).count();
    let local = |p: Vec3| place.inverse().transform_point3(p);
    let on_group = |p: Vec3| (local(p).abs() - Vec3::new(0.4, 0.5, 0.3)).max_element().abs() < 0.03;
    let met = traced.all().filter(|vertex| on_group(vertex.position)).count();
    let all = traced.all().count();
    println!("{lost} paths lost, {met} of {all} vertices on the group");
    assert!(met * 20 > all, "{met} of {all} vertices on the group");
    assert!(lost * 1000 <= crate::paths::PATHS as usize * 8, "{lost} paths left a closed room");
    for vertex in traced.all().filter(|vertex| on_group(vertex.position)) {
        let out = place.transform_vector3(local(vertex.position) / Vec3::new(0.4, 0.5, 0.3).powf(2.0));
        assert!(vertex.normal.dot(out) > -0.1, "{} faces inwards", vertex.position);
    }
}
