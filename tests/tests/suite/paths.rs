//! Light on its way through the grid: rays meet what is there, no energy is lost or made.

mod list;

use std::collections::BTreeMap;
use std::f32::consts::PI;

use bevy::math::{Affine3A, Quat, Vec3};
use bevy_bounce_shaders::types::{
    BRICK_WORDS, CANDIDATES, CompactVpl, Grid, HILBERT_BITS, LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_RECT, LIGHT_SPOT,
    Light, NODE_STEPS, Path, Vpl, VplHeader, VplParameters,
};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, add_groups, count_of, cuboid, run, trace_paths, voxelize};
use bevy_bounce_tests::twins::random::Random;

use crate::sort::radix_sort;

pub const PATHS: u32 = 4096;

pub struct Traced {
    parameters: VplParameters,
    grid: Grid,
    vertices: Vec<Vpl>,
    pub paths: Vec<Path>,
    resources: Resources,
}

impl Traced {
    pub fn new(scene: &TestScene, voxel_size: f32, max_bounces: u32) -> Self {
        Self::through(scene, scene.grid(voxel_size), max_bounces)
    }

    pub fn through(scene: &TestScene, grid: Grid, max_bounces: u32) -> Self {
        Self::with_groups(scene, grid, max_bounces, &[], &[])
    }

    /// With groups that have grids of their own: see [`add_groups`].
    pub fn with_groups(
        scene: &TestScene,
        grid: Grid,
        max_bounces: u32,
        grids: &[(&TestScene, Grid)],
        placed: &[(usize, Affine3A)],
    ) -> Self {
        let parameters = VplParameters { capacity: 1000, path_count: PATHS, max_bounces, bound_scale: 1.0 };
        let slots = PATHS as usize * (max_bounces as usize + 1);
        let bricks = count_of(&grid, 8);
        let resources = add_groups(gpu(), voxelize(gpu(), scene, &grid, None), grids, placed)
            .uniform("parameters", &parameters)
            .structs("vertices", &vec![Vpl::default(); slots])
            .structs("paths", &vec![Path::default(); PATHS as usize])
            .zeroed("bricks", bricks * BRICK_WORDS as usize)
            .zeroed("candidates", (PATHS * CANDIDATES) as usize)
            .structs("vpls", &vec![Vpl::default(); parameters.capacity as usize])
            .structs("compact_vpls", &vec![CompactVpl::default(); parameters.capacity as usize])
            .structs("header", &[VplHeader::default()]);
        let emissive = scene.chunks(|i| scene.materials[i.material as usize].emissive != Vec3::ZERO).len() as u32;
        if emissive > 0 {
            run(gpu(), "vpl/emitters.wgsl", "collect", &resources, [emissive, 1, 1]);
            run(gpu(), "vpl/emitters.wgsl", "accumulate", &resources, [1, 1, 1]);
        }
        run(gpu(), "vpl/look_ahead.wgsl", "look_ahead", &resources, [PATHS * CANDIDATES / 64, 1, 1]);
        trace_paths(gpu(), scene, &grid, &parameters, &resources);
        let paths = resources.read_structs("paths").expect("reads back");
        let vertices = resources.read_structs("vertices").expect("reads back");
        Self { parameters, grid, vertices, paths, resources }
    }

    /// Sorts the vertices and makes the list.
    pub fn list(mut self) -> (Self, VplHeader, Vec<Vpl>) {
        let slots = self.vertices.len();
        let resources = self
            .resources
            .zeroed("vertex_count", 1)
            .zeroed("pairs", 2 * slots)
            .zeroed("starts", slots + 1)
            .zeroed("nodes", slots)
            .zeroed("steps", NODE_STEPS as usize)
            .zeroed("firsts", self.parameters.capacity as usize + 1);
        run(gpu(), "vpl/order.wgsl", "scan_paths", &resources, [1, 1, 1]);
        run(gpu(), "vpl/order.wgsl", "write_pairs", &resources, [PATHS.div_ceil(64), 1, 1]);
        let count = resources.read_words("vertex_count").expect("reads back")[0] as usize;
        let pairs = resources.read_words("pairs").expect("reads back");
        let sorted = radix_sort(&pairs.as_chunks().0[..count], 5 + 3 * HILBERT_BITS);
        let resources = resources.words("pairs", sorted.as_flattened());
        run(gpu(), "vpl/weights.wgsl", "scan_weights", &resources, [1, 1, 1]);
        run(gpu(), "vpl/cuts.wgsl", "measure_nodes", &resources, [slots.div_ceil(256) as u32, 1, 1]);
        run(gpu(), "vpl/cuts.wgsl", "cut", &resources, [1, 1, 1]);
        run(gpu(), "vpl/list.wgsl", "build_list", &resources, [self.parameters.capacity.div_ceil(64), 1, 1]);
        let header = resources.read_structs::<VplHeader>("header").expect("reads back")[0];
        let list = resources.read_structs::<Vpl>("vpls").expect("reads back");
        self.resources = resources;
        (self, header, list)
    }

    fn path(&self, path: usize) -> &[Vpl] {
        let start = path * (self.parameters.max_bounces as usize + 1);
        &self.vertices[start..start + self.paths[path].length as usize]
    }

    pub fn all(&self) -> impl Iterator<Item = &Vpl> {
        (0..self.paths.len()).flat_map(|path| self.path(path))
    }

    /// The brick of 8^3 voxels that a vertex is in.
    fn brick(&self, vpl: &Vpl) -> usize {
        let dims = self.grid.dims.map(|voxels| voxels.div_ceil(8));
        let brick = ((vpl.position - self.grid.origin) / self.grid.voxel_size / 8.0).as_uvec3();
        ((brick.z * dims.y + brick.y) * dims.x + brick.x) as usize
    }

    /// Vertices in each brick of a single grid.
    fn brick_counts(&self) -> Vec<u32> {
        let mut counts = vec![0; count_of(&self.grid, 8)];
        for vertex in self.all() {
            counts[self.brick(vertex)] += 1;
        }
        counts
    }

    /// Flux of each bounce, lumens.
    fn flux(&self) -> BTreeMap<u32, Vec3> {
        let mut flux = BTreeMap::new();
        for vertex in self.all() {
            *flux.entry(vertex.bounce()).or_insert(Vec3::ZERO) += vertex.flux / PATHS as f32;
        }
        flux
    }
}

pub fn point_light(position: Vec3, candela: Vec3) -> Light {
    let cumulative_power = 4.0 * PI * candela.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    Light { position, kind: LIGHT_POINT, color: candela, cumulative_power, max_bounces: u32::MAX, ..Default::default() }
}

/// From straight above, on a box of the scene of that many square metres.
fn sun(lux: f32, area: f32) -> Light {
    Light {
        kind: LIGHT_DIRECTIONAL,
        direction: Vec3::NEG_Y,
        color: Vec3::splat(lux),
        cumulative_power: lux * area,
        max_bounces: u32::MAX,
        ..Default::default()
    }
}

/// A closed room of one albedo.
fn room(albedo: Vec3) -> TestScene {
    let mut scene = TestScene::new(albedo);
    scene.room(Vec3::new(-2.0, 0.0, -1.5), Vec3::new(2.0, 2.5, 1.5));
    scene
}

fn assert_flux(flux: &BTreeMap<u32, Vec3>, bounce: u32, expected: Vec3, tolerance: f32) {
    let found = flux.get(&bounce).copied().unwrap_or(Vec3::ZERO);
    let error = (found - expected).abs() / expected.max(Vec3::splat(1e-9));
    assert!(error.max_element() < tolerance, "bounce {bounce}: {found} lumens, expected {expected}");
}

#[test]
fn no_light_leaves_a_closed_room() {
    let mut scene = room(Vec3::ONE);
    scene.soup(&cuboid(Vec3::new(-1.1, 0.0, -0.7), Vec3::new(-0.4, 1.2, 0.1)));
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::splat(10.0)));
    let traced = Traced::new(&scene, 0.11, 8);
    let lost = traced.paths.iter().filter(|path| path.length < 8).count();
    // Where walls meet, a ray may pass between the planes of two voxels.
    assert!(lost * 2000 <= traced.paths.len() * 8, "{lost} of {PATHS} paths left a room of albedo 1 in 8 bounces");
    for vertex in traced.all() {
        let p = vertex.position;
        let walls = (p.abs() - Vec3::new(2.0, 0.0, 1.5)).abs();
        let on_wall = walls.x.min(walls.z).min(p.y.abs()).min((p.y - 2.5).abs());
        let low = (p - Vec3::new(-1.1, 0.0, -0.7)).abs().min_element();
        let high = (p - Vec3::new(-0.4, 1.2, 0.1)).abs().min_element();
        assert!(on_wall.min(low).min(high) < 0.03, "{p} is on no surface");
    }
}

#[test]
fn bounces_carry_the_flux_of_their_closed_form() {
    let albedo = Vec3::new(0.8, 0.6, 0.2);
    let mut scene = room(albedo);
    scene.lights.push(point_light(Vec3::new(0.5, 1.7, 0.2), Vec3::new(30.0, 20.0, 10.0)));
    let flux = Traced::new(&scene, 0.11, 6).flux();
    let emitted = Vec3::new(30.0, 20.0, 10.0) * 4.0 * PI;
    for bounce in 1..=6 {
        let expected = emitted * albedo.powf(bounce as f32);
        // Few paths are left after some bounces, and blue is rare among them.
        assert_flux(&flux, bounce, expected, 0.02 + 0.012 * bounce as f32);
    }
    assert!(!flux.contains_key(&7) && !flux.contains_key(&0));
}

#[test]
fn lights_share_the_paths_by_power() {
    let mut scene = room(Vec3::splat(0.5));
    scene.lights.push(point_light(Vec3::new(1.0, 1.0, 0.0), Vec3::new(3.0, 0.0, 0.0)));
    scene.lights.push(point_light(Vec3::new(-1.0, 1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)));
    scene.lights.push(point_light(Vec3::new(-1.0, 1.0, 0.5), Vec3::new(0.0, 0.0, 20.0)));
    let flux = Traced::new(&scene, 0.11, 2).flux();
    assert_flux(&flux, 1, Vec3::new(3.0, 1.0, 20.0) * 4.0 * PI * 0.5, 0.1);
}

#[test]
fn a_spot_lights_its_cone() {
    let (inner, outer) = (0.3_f32, 0.6_f32);
    let scale = 1.0 / (inner.cos() - outer.cos());
    let candela = 50.0;
    // Integral of the squared falloff over the cone.
    let steps = 10_000;
    let lumens: f32 = (0..steps)
        .map(|i| {
            let cosine = outer.cos() + (1.0 - outer.cos()) * (i as f32 + 0.5) / steps as f32;
            let falloff = (cosine * scale - outer.cos() * scale).clamp(0.0, 1.0);
            candela * falloff * falloff * 2.0 * PI * (1.0 - outer.cos()) / steps as f32
        })
        .sum();
    let mut scene = room(Vec3::splat(0.5));
    let direction = Vec3::new(0.2, -1.0, 0.1).normalize();
    scene.lights.push(Light {
        position: Vec3::new(0.0, 2.0, 0.0),
        kind: LIGHT_SPOT,
        direction,
        color: Vec3::splat(candela),
        cumulative_power: lumens,
        spot_scale: scale,
        spot_cos_outer: outer.cos(),
        max_bounces: u32::MAX,
        ..Default::default()
    });
    let traced = Traced::new(&scene, 0.11, 1);
    assert_flux(&traced.flux(), 1, Vec3::splat(lumens * 0.5), 0.03);
    for vertex in traced.all() {
        let angle = (vertex.position - Vec3::new(0.0, 2.0, 0.0)).normalize().dot(direction).acos();
        assert!(angle < outer + 0.02, "light {angle} off the axis of a cone of {outer}");
    }
}

#[test]
fn a_rect_light_shines_to_one_side_from_all_of_its_area() {
    let mut scene = room(Vec3::splat(0.5));
    let (middle, direction) = (Vec3::new(0.2, 2.0, 0.1), Vec3::new(0.6, -0.8, 0.0));
    let side = 0.5 * Vec3::new(0.8, 0.6, 0.0);
    let half_height = 0.25;
    let radiance = 100.0;
    let lumens = PI * radiance * 4.0 * side.length() * half_height;
    scene.lights.push(Light {
        position: middle,
        kind: LIGHT_RECT,
        direction,
        color: Vec3::splat(radiance),
        cumulative_power: lumens,
        side,
        half_height,
        max_bounces: u32::MAX,
        ..Default::default()
    });
    let traced = Traced::new(&scene, 0.11, 1);
    assert_flux(&traced.flux(), 1, Vec3::splat(lumens * 0.5), 0.03);
    // Seen from it, light falls within a half space; the mean of its cosine is 2/3.
    let ways: Vec<Vec3> = traced.all().map(|vertex| vertex.position - middle).collect();
    let behind = ways.iter().filter(|way| way.dot(direction) < -0.05).count();
    assert_eq!(behind, 0, "light behind the panel");
    let mean = ways.iter().map(|way| way.normalize().dot(direction)).sum::<f32>() / ways.len() as f32;
    assert!((mean - 2.0 / 3.0).abs() < 0.03, "mean cosine {mean}");
}

/// A box above part of a floor casts a shadow and is lit itself: the shadow of the whole decides.
#[test]
fn a_directional_light_falls_on_all_that_faces_it() {
    let places: Vec<Vec3> =
        (0..12).map(|i| Vec3::new(i as f32 * 0.37 - 2.0, 0.0, (i % 3) as f32 * 0.83 - 0.8)).collect();
    let mut top = 0.0;
    for &place in &places {
        let mut scene = TestScene::new(Vec3::splat(0.5));
        let [a, b, c, d] = [(-3.0, -2.0), (3.0, -2.0), (3.0, 2.0), (-3.0, 2.0)].map(|(x, z)| Vec3::new(x, 0.0, z));
        scene.soup(&[[a, c, b], [a, d, c]]);
        scene.soup(&cuboid(place + Vec3::new(-0.5, 0.5, -0.5), place + Vec3::new(0.5, 1.5, 0.5)));
        scene.lights.push(sun(1000.0, 24.0));
        let traced = Traced::new(&scene, 0.13, 1);
        assert_flux(&traced.flux(), 1, Vec3::splat(1000.0 * 24.0 * 0.5), 0.03);
        let on_top = traced.all().filter(|vertex| (vertex.position.y - 1.5).abs() < 0.02);
        top += on_top.map(|vertex| vertex.flux.x).sum::<f32>() / PATHS as f32 / places.len() as f32;
    }
    println!("the box's top has {} of its light", top / 500.0);
    assert!((top / 500.0 - 1.0).abs() < 0.1, "the box's top has {top} lumens");
}

#[test]
fn emissive_triangles_are_area_lights() {
    for (flags, sides) in [(0, 1.0), (bevy_bounce_shaders::types::INSTANCE_TWO_SIDED, 2.0)] {
        let mut scene = room(Vec3::splat(0.5));
        let mut lamp = bevy_bounce_tests::scene::matte(Vec3::ZERO);
        lamp.emissive = Vec3::new(100.0, 50.0, 25.0);
        scene.materials.push(lamp);
        let [a, b, c, d] = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)].map(|(x, z)| Vec3::new(x, 1.5, z));
        // Faces down.
        scene.mesh(&[[a, b, c], [a, c, d]], 1, flags, Affine3A::IDENTITY);
        let traced = Traced::new(&scene, 0.11, 2);
        let emitted = Vec3::new(100.0, 50.0, 25.0) * PI * sides;
        assert_flux(&traced.flux(), 0, emitted, 1e-3);
        assert_flux(&traced.flux(), 1, emitted * 0.5, 0.03);
        assert!(traced.paths.iter().all(|path| path.first_bounce == 0));
        let up = traced.all().filter(|vertex| vertex.bounce() == 0 && vertex.normal.y > 0.5).count();
        let expected = if sides == 2.0 { PATHS as usize / 2 } else { 0 };
        assert!(up.abs_diff(expected) <= 8, "{up} paths start upwards, expected {expected}");
    }
}

#[test]
fn light_ends_at_its_range() {
    let reach = |range: f32| {
        let mut scene = room(Vec3::splat(0.5));
        scene.lights.push(Light { range, ..point_light(Vec3::new(0.0, 1.2, 0.0), Vec3::splat(10.0)) });
        Traced::new(&scene, 0.11, 1).flux().get(&1).map_or(0.0, |flux| flux.x) / (40.0 * PI * 0.5)
    };
    assert!((reach(0.0) - 1.0).abs() < 0.02, "without a range");
    // Mean of Bevy's window over all directions to the walls.
    let mut random = Random::new(2);
    let range = 2.5_f32;
    let mean: f32 = (0..100_000)
        .map(|_| {
            let direction = random.direction();
            let to = |low: f32, high: f32, d: f32| if d < 0.0 { low / d } else { high / d };
            let distance = to(-2.0, 2.0, direction.x).min(to(-1.2, 1.3, direction.y)).min(to(-1.5, 1.5, direction.z));
            (1.0 - (distance / range).powi(4)).clamp(0.0, 1.0).powi(2) / 100_000.0
        })
        .sum();
    assert!((reach(range) / mean - 1.0).abs() < 0.03, "{}, expected {mean}", reach(range));
    assert!(reach(1.0) < 1e-6, "beyond the range");
}

#[test]
fn no_light_no_paths() {
    let scene = room(Vec3::splat(0.5));
    let traced = Traced::new(&scene, 0.3, 4);
    assert!(traced.paths.iter().all(|path| path.length == 0));
}

/// The sun on a flat roof, and on a room below it through a hole: paths go where their light does.
#[test]
fn a_suns_paths_start_where_light_goes_on() {
    let mut scene = room(Vec3::splat(0.6));
    let quad = |x: [f32; 2], z: [f32; 2]| {
        let corner = |i: usize, j: usize| Vec3::new(x[i], 3.0, z[j]);
        [[corner(0, 0), corner(0, 1), corner(1, 1)], [corner(0, 0), corner(1, 1), corner(1, 0)]]
    };
    // The room has no lid to what comes from above; the roof leaves out 1 m by 1 m.
    let around = [
        ([-4.0, -0.5], [-3.0, 3.0]),
        ([0.5, 4.0], [-3.0, 3.0]),
        ([-0.5, 0.5], [-3.0, -0.5]),
        ([-0.5, 0.5], [0.5, 3.0]),
    ];
    scene.soup(&around.map(|(x, z)| quad(x, z)).concat());
    let (low, high) = scene.bounds();
    let size = high - low;
    scene.lights.push(sun(1.0, size.x * size.z));
    let traced = Traced::new(&scene, 0.1, 1);
    let first = |high: bool| traced.all().filter(move |v| v.bounce() == 1 && (v.position.y > 2.8) == high);
    let lumens = |high: bool| first(high).map(|v| v.flux.x).sum::<f32>() / PATHS as f32;
    let (roof, floor) = (first(true).count() as f32, first(false).count() as f32);
    println!("roof {} lumens, {roof} paths; floor {} lumens, {floor} paths", lumens(true), lumens(false));
    assert!((lumens(true) / (0.6 * 47.0) - 1.0).abs() < 0.03, "the roof has {} lumens", lumens(true));
    assert!((lumens(false) / 0.6 - 1.0).abs() < 0.1, "the floor has {} lumens", lumens(false));
    assert!(floor / (floor + roof) > 4.0 / 48.0, "{floor} paths for the floor, {roof} for the roof");
}

/// Rays against exact geometry.
#[test]
fn rays_meet_what_is_there() {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let turn = Affine3A::from_rotation_translation(Quat::from_euler(bevy::math::EulerRot::XYZ, 0.4, 0.7, 0.2), Vec3::Y);
    let walls = cuboid(Vec3::new(-2.0, -1.25, -1.5), Vec3::new(2.0, 1.25, 1.5)).map(|[a, b, c]| [a, c, b]);
    scene.mesh(&walls, 0, 0, turn);
    scene.mesh(
        &cuboid(Vec3::splat(-0.4), Vec3::splat(0.4)),
        0,
        0,
        Affine3A::from_translation(Vec3::new(0.3, 1.0, 0.2)),
    );
    let grid = scene.grid(0.12);
    let resources = voxelize(gpu(), &scene, &grid, None);
    let mut random = Random::new(23);
    let count = 4000;
    let mut rays = Vec::new();
    while rays.len() < count {
        let local = random.vector() * Vec3::new(1.8, 1.05, 1.3);
        let origin = turn.transform_point3(local);
        if (origin - Vec3::new(0.3, 1.0, 0.2)).abs().max_element() > 0.6 {
            rays.push((origin, random.direction()));
        }
    }
    let hits = shoot(resources, &rays);
    let (mut missed, mut off) = (0, 0);
    for (&(origin, direction), &hit) in rays.iter().zip(&hits) {
        let exact = scene.triangles.iter().filter_map(|t| intersect(t, origin, direction)).fold(f32::MAX, f32::min);
        if hit < 0.0 {
            missed += 1;
        } else if (hit - exact).abs() > 1.0 * grid.voxel_size {
            off += 1;
        }
    }
    assert!(missed * 200 <= count, "{missed} of {count} rays leave a closed room");
    assert!(off * 50 <= count, "{off} of {count} rays end a voxel and more off");
}

/// How far rays come in the voxels of some resources, world units; negative where they meet nothing.
pub fn shoot(resources: Resources, rays: &[(Vec3, Vec3)]) -> Vec<f32> {
    const SHOOT: &str = "
        #import bevy_bounce::shared::rays::{trace, to_grid, grid, Ray}
        @group(0) @binding(0) var<storage, read> rays: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> hits: array<f32>;
        @compute @workgroup_size(64)
        fn shoot(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&hits) {
                return;
            }
            var ray: Ray;
            ray.origin = to_grid(rays[2u * id.x].xyz);
            ray.direction = rays[2u * id.x + 1u].xyz;
            ray.length = rays[2u * id.x].w / grid.voxel_size;
            let hit = trace(ray);
            hits[id.x] = select(-1.0, hit.t * grid.voxel_size, hit.found);
        }";
    let packed: Vec<f32> = rays.iter().flat_map(|(o, d)| [o.x, o.y, o.z, 1e6, d.x, d.y, d.z, 0.0]).collect();
    let resources = resources.floats("rays", &packed).zeroed("hits", rays.len());
    let kernel = gpu().kernel(&compose_source(SHOOT, "shoot.wgsl", &[]).expect("composes"), "shoot");
    let groups = rays.len().div_ceil(64) as u32;
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [groups, 1, 1]).expect("runs");
    resources.read_floats("hits").expect("reads back")
}

/// Rays between the walls of a room, through a grid of about 64^3.
#[test]
fn rays_leap_over_what_is_empty() {
    const SHOOT: &str = "
        #import bevy_bounce::shared::rays::{trace, to_grid, grid, Ray}
        @group(0) @binding(0) var<storage, read> rays: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> steps: array<u32>;
        @compute @workgroup_size(64)
        fn shoot(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&steps) {
                return;
            }
            let to = rays[2u * id.x + 1u].xyz - rays[2u * id.x].xyz;
            var ray: Ray;
            ray.origin = to_grid(rays[2u * id.x].xyz);
            ray.direction = normalize(to);
            ray.length = length(to) / grid.voxel_size;
            steps[id.x] = trace(ray).steps;
        }";
    let mut scene = room(Vec3::splat(0.5));
    scene.soup(&cuboid(Vec3::new(-1.1, 0.0, -0.7), Vec3::new(-0.4, 1.2, 0.1)));
    let grid = scene.grid(4.0 / 62.0);
    let resources = voxelize(gpu(), &scene, &grid, None);
    let mut random = Random::new(29);
    let mut on_wall = || {
        let mut p = random.vector();
        let axis = random.below(3) as usize;
        p[axis] = p[axis].signum() * 0.98;
        Vec3::new(0.0, 1.25, 0.0) + p * Vec3::new(2.0, 1.25, 1.5)
    };
    let count = 4096;
    let ends: Vec<(Vec3, Vec3)> = (0..count).map(|_| (on_wall(), on_wall())).collect();
    let packed: Vec<f32> = ends.iter().flat_map(|(a, b)| [a.x, a.y, a.z, 0.0, b.x, b.y, b.z, 0.0]).collect();
    let resources = resources.floats("rays", &packed).zeroed("steps", count);
    let kernel = gpu().kernel(&compose_source(SHOOT, "shoot.wgsl", &[]).expect("composes"), "shoot");
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [count as u32 / 64, 1, 1]).expect("runs");
    let steps = resources.read_words("steps").expect("reads back");
    let mean = steps.iter().sum::<u32>() as f32 / count as f32;
    let across = |(a, b): &(Vec3, Vec3)| ((*b - *a) / grid.voxel_size).abs().element_sum();
    let voxels = ends.iter().map(across).sum::<f32>() / count as f32;
    println!("{mean:.1} steps a ray, {} at most, through {voxels:.1} voxels", steps.iter().max().unwrap_or(&0));
    assert!(mean > 1.0 && mean < voxels / 2.0, "{mean} steps through {voxels} voxels");
}

/// Distance to the front of a triangle. Moeller and Trumbore 1997.
pub fn intersect([a, b, c]: &[Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = direction.cross(e2);
    let determinant = e1.dot(p);
    if determinant <= 0.0 {
        return None;
    }
    let to = origin - *a;
    let u = to.dot(p) / determinant;
    let q = to.cross(e1);
    let v = direction.dot(q) / determinant;
    let t = e2.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some(t)
}
