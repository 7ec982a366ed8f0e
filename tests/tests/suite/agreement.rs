//! What virtual lights see of the pixels of whole scenes, against exact rays.

use bevy::math::Vec3;
use bevy_bounce_shaders::types::{
    AtlasParameters, BRICK_WORDS, CANDIDATES, Grid, HILBERT_BITS, NODE_STEPS, Occluder, Path, Vpl, VplHeader,
    VplParameters,
};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::glb::{self, GlbScene};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::references::shared_file;
use bevy_bounce_tests::scene::{TestScene, run, settle, voxelize};
use bevy_bounce_tests::twins::random::Random;

use crate::sort::radix_sort;

const LIGHTS: u32 = 256;
const PATHS: u32 = 8 * LIGHTS;
const BOUNCES: u32 = 12;
const TILE: u32 = 32;
const GRID: u32 = 64;

/// A pixel: what it shows, and the light it is asked about.
struct Pair {
    light: usize,
    position: Vec3,
    normal: Vec3,
}

/// A grid of at most `GRID`^3 voxels.
fn grid(scene: &TestScene) -> Grid {
    let (low, high) = scene.bounds();
    let mut size = (high - low).max_element() / (4 * GRID) as f32;
    loop {
        let grid = scene.grid(size);
        if grid.dims.element_product() <= GRID.pow(3) {
            return grid;
        }
        size *= 1.02;
    }
}

/// The list of virtual lights of a scene, and the shadow map of each.
fn light_up(scene: &TestScene, grid: &Grid) -> Resources {
    let parameters = VplParameters { capacity: LIGHTS, path_count: PATHS, max_bounces: BOUNCES, bound_scale: 1.0 };
    let slots = (PATHS * (BOUNCES + 1)) as usize;
    let bricks = grid.dims.map(|voxels| voxels.div_ceil(8)).element_product() as usize;
    let resources = voxelize(gpu(), scene, grid, None)
        .uniform("parameters", &parameters)
        .structs("vertices", &vec![Vpl::default(); slots])
        .structs("paths", &vec![Path::default(); PATHS as usize])
        .zeroed("bricks", bricks * BRICK_WORDS as usize)
        .zeroed("candidates", (PATHS * CANDIDATES) as usize)
        .structs("vpls", &vec![Vpl::default(); LIGHTS as usize])
        .structs("header", &[VplHeader::default()])
        .zeroed("vertex_count", 1)
        .zeroed("pairs", 2 * slots)
        .zeroed("starts", slots + 1)
        .zeroed("nodes", slots)
        .zeroed("steps", NODE_STEPS as usize)
        .zeroed("firsts", LIGHTS as usize + 1);
    run(gpu(), "vpl/look_ahead.wgsl", "look_ahead", &resources, [PATHS * CANDIDATES / 64, 1, 1]);
    run(gpu(), "vpl/trace.wgsl", "trace_paths", &resources, [PATHS.div_ceil(64), 1, 1]);
    run(gpu(), "vpl/order.wgsl", "scan_paths", &resources, [1, 1, 1]);
    run(gpu(), "vpl/order.wgsl", "write_pairs", &resources, [PATHS.div_ceil(64), 1, 1]);
    let count = resources.read_words("vertex_count").expect("reads back")[0] as usize;
    let pairs = resources.read_words("pairs").expect("reads back");
    let sorted = radix_sort(&pairs.as_chunks().0[..count], 3 + 3 * HILBERT_BITS);
    let resources = resources.words("pairs", sorted.as_flattened());
    run(gpu(), "vpl/weights.wgsl", "scan_weights", &resources, [1, 1, 1]);
    run(gpu(), "vpl/cuts.wgsl", "measure_nodes", &resources, [slots.div_ceil(256) as u32, 1, 1]);
    run(gpu(), "vpl/cuts.wgsl", "cut", &resources, [1, 1, 1]);
    run(gpu(), "vpl/list.wgsl", "build_list", &resources, [LIGHTS.div_ceil(64), 1, 1]);
    resources
}

/// Sets the lights on their surfaces and draws their maps, from all triangles.
fn draw(scene: &TestScene, grid: &Grid, resources: Resources) -> Resources {
    let resources = settle(gpu(), scene, grid, resources, LIGHTS);
    let (chunks, occluder_count) = scene.occluder_chunks();
    let (low, high) = scene.bounds();
    let parameters =
        AtlasParameters { tile: TILE, occluder_count, far: (high - low).length(), point_area: 0.0, error: 0.0 };
    let resources = resources
        .uniform("parameters", &parameters)
        .structs("occluder_chunks", &chunks)
        .structs("occluders", &vec![Occluder::default(); occluder_count as usize])
        .zeroed("atlas", (LIGHTS * TILE * TILE) as usize);
    run(gpu(), "shadow_atlas/occluders.wgsl", "place_occluders", &resources, [chunks.len() as u32, 1, 1]);
    run(gpu(), "shadow_atlas/rasterize.wgsl", "rasterize", &resources, [LIGHTS, 1, 1]);
    resources
}

/// The triangles, halved until there are `LEAF` each, and the box of each: what exact rays look through.
struct Rays {
    triangles: Vec<[Vec3; 3]>,
    boxes: Vec<(Vec3, Vec3)>,
}

const LEAF: usize = 32;

impl Rays {
    fn new(scene: &TestScene) -> Self {
        let mut triangles = scene.triangles.clone();
        fn split(triangles: &mut [[Vec3; 3]]) {
            if triangles.len() <= LEAF {
                return;
            }
            let centre = |t: &[Vec3; 3]| t[0] + t[1] + t[2];
            let (low, high) = triangles
                .iter()
                .map(centre)
                .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
            let axis = (high - low).max_position();
            let middle = (triangles.len() / 2).next_multiple_of(LEAF);
            if middle >= triangles.len() {
                return;
            }
            triangles.select_nth_unstable_by(middle, |a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
            let (a, b) = triangles.split_at_mut(middle);
            split(a);
            split(b);
        }
        split(&mut triangles);
        let bounds = |chunk: &[[Vec3; 3]]| {
            let corners = chunk.as_flattened();
            corners.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)))
        };
        let boxes = triangles.chunks(LEAF).map(bounds).collect();
        Self { triangles, boxes }
    }

    /// The nearest surface between two distances, from either side: its distance and triangle.
    fn cast(&self, origin: Vec3, direction: Vec3, least: f32, most: f32) -> Option<(f32, [Vec3; 3])> {
        let inverse = direction.recip();
        let mut found = None;
        let mut nearest = most;
        for (chunk, (low, high)) in self.triangles.chunks(LEAF).zip(&self.boxes) {
            let (a, b) = ((*low - origin) * inverse, (*high - origin) * inverse);
            let enter = a.min(b).max_element().max(least);
            if enter > a.max(b).min_element().min(nearest) {
                continue;
            }
            for t in chunk {
                let turned = [t[0], t[2], t[1]];
                let hit = crate::paths::intersect(t, origin, direction)
                    .or_else(|| crate::paths::intersect(&turned, origin, direction));
                if let Some(distance) = hit.filter(|distance| *distance > least && *distance < nearest) {
                    nearest = distance;
                    found = Some((distance, *t));
                }
            }
        }
        found
    }
}

/// Pixels of the scene's camera at random, each with a light that it faces and that faces it.
fn pairs(glb: &GlbScene, rays: &Rays, vpls: &[Vpl], count: usize) -> Vec<Pair> {
    let mut random = Random::new(11);
    let eye = Vec3::from(glb.world_from_view.translation);
    let mut found = Vec::new();
    while found.len() < count {
        let x = (2.0 * random.unit() - 1.0) * glb.half_height * 16.0 / 9.0;
        let y = (2.0 * random.unit() - 1.0) * glb.half_height;
        let direction = Vec3::from(glb.world_from_view.matrix3 * bevy::math::Vec3A::new(x, y, -1.0)).normalize();
        let Some((distance, [a, b, c])) = rays.cast(eye, direction, 1e-4, f32::MAX) else { continue };
        let normal = (b - a).cross(c - a).normalize();
        let normal = normal * -normal.dot(direction).signum();
        let position = eye + direction * distance;
        for _ in 0..8 {
            let light = (random.unit() * vpls.len() as f32) as usize % vpls.len();
            let to = (vpls[light].position - position).normalize();
            if to.dot(normal) > 0.0 && to.dot(vpls[light].normal) < 0.0 {
                found.push(Pair { light, position, normal });
                break;
            }
        }
    }
    found
}

/// What a kind of visibility says of each pair.
fn ask(resources: Resources, function: &str, pairs: &[Pair]) -> Vec<bool> {
    let source = format!(
        "
        {function}
        @group(0) @binding(0) var<storage, read> vpls: array<Vpl>;
        @group(0) @binding(1) var<storage, read> points: array<vec4<f32>>;
        @group(0) @binding(2) var<storage, read_write> seen: array<u32>;
        @compute @workgroup_size(64)
        fn look(@builtin(global_invocation_id) id: vec3<u32>) {{
            if id.x < arrayLength(&seen) {{
                let light = u32(points[2u * id.x].w);
                seen[id.x] = u32(is_seen(light, vpls[light], points[2u * id.x].xyz, points[2u * id.x + 1u].xyz));
            }}
        }}"
    );
    let packed: Vec<f32> = pairs
        .iter()
        .flat_map(|p| [p.position.extend(p.light as f32), p.normal.extend(0.0)])
        .flat_map(|words| words.to_array())
        .collect();
    let resources = resources.floats("points", &packed).zeroed("seen", pairs.len());
    let kernel = gpu().kernel(&compose_source(&source, "look.wgsl", &[]).expect("composes"), "look");
    let groups = [pairs.len().div_ceil(64) as u32, 1, 1];
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, groups).expect("runs");
    resources.read_words("seen").expect("reads back").iter().map(|word| *word != 0).collect()
}

const ATLAS: &str = "
    #import bevy_bounce::shadow_atlas::lookup::atlas_visible
    #import bevy_bounce::vpl::types::Vpl
    fn is_seen(light: u32, vpl: Vpl, position: vec3<f32>, normal: vec3<f32>) -> bool {
        return atlas_visible(light, vpl, position, normal);
    }";

/// Shares of all pairs.
struct Agreement {
    agree: f64,
    exact: f64,
    maps: f64,
}

/// What shadow maps of all triangles and exact rays say of pixels and lights of a scene.
fn atlas_agreement(name: &str) -> Option<Agreement> {
    let glb = glb::read(&shared_file(&format!("scenes/{name}.glb"))?).expect("a scene");
    let grid = grid(&glb.scene);
    let resources = draw(&glb.scene, &grid, light_up(&glb.scene, &grid));
    let header: VplHeader = resources.read_structs("header").expect("reads back")[0];
    let mut vpls: Vec<Vpl> = resources.read_structs("vpls").expect("reads back");
    vpls.truncate(header.count as usize);
    let rays = Rays::new(&glb.scene);
    let pairs = pairs(&glb, &rays, &vpls, 8000);
    let near = 1e-3 * grid.voxel_size;
    let exact: Vec<bool> = pairs
        .iter()
        .map(|pair| {
            let vpl = &vpls[pair.light];
            let from = vpl.position + vpl.normal * near;
            let to = pair.position + pair.normal * near - from;
            rays.cast(from, to.normalize(), 0.0, to.length()).is_none()
        })
        .collect();
    let seen = ask(resources, ATLAS, &pairs);
    let share = |pass: &dyn Fn(bool, bool) -> bool| {
        exact.iter().zip(&seen).filter(|(exact, seen)| pass(**exact, **seen)).count() as f64 / pairs.len() as f64
    };
    let found = Agreement {
        agree: share(&|exact, seen| exact == seen),
        exact: share(&|exact, _| exact),
        maps: share(&|_, seen| seen),
    };
    println!("{name}: {:.4} agree; exact rays see {:.4}, maps {:.4}", found.agree, found.exact, found.maps);
    Some(found)
}

#[test]
fn maps_agree_with_exact_rays_in_scenes() {
    // A texel of 32 x 32 is up to six degrees wide: in a church of columns and ledges as much is hidden by chance as is seen.
    for (name, least) in [("corner", 0.97), ("sibenik", 0.85)] {
        let Some(found) = atlas_agreement(name) else { return };
        assert!(found.agree >= least, "{name}: {} agree", found.agree);
        assert!((found.maps - found.exact).abs() < 0.02, "{name}: maps see {}, rays {}", found.maps, found.exact);
    }
}

#[test]
fn lights_settle_on_what_their_path_met() {
    let Some(file) = shared_file("scenes/sibenik.glb") else { return };
    let glb = glb::read(&file).expect("a scene");
    let grid = grid(&glb.scene);
    let rays = Rays::new(&glb.scene);
    // Share of the light, by where it is sent, with something nearer than a voxel and a half.
    let buried = |resources: &Resources| {
        let header: VplHeader = resources.read_structs("header").expect("reads back")[0];
        let vpls: Vec<Vpl> = resources.read_structs("vpls").expect("reads back");
        let mut random = Random::new(3);
        let (mut near, mut all) = (0.0, 0.0);
        for vpl in vpls[..header.count as usize].iter().step_by(4) {
            let (x, y) = vpl.normal.any_orthonormal_pair();
            for _ in 0..8 {
                let (u, turn) = (random.unit(), random.unit() * std::f32::consts::TAU);
                let direction = vpl.normal * (1.0 - u).sqrt() + (x * turn.cos() + y * turn.sin()) * u.sqrt();
                let start = vpl.position + vpl.normal * 1e-3 * grid.voxel_size;
                let is_near = rays.cast(start, direction, 0.0, 1.5 * grid.voxel_size).is_some();
                near += f64::from(vpl.flux.y) * f64::from(u8::from(is_near));
                all += f64::from(vpl.flux.y);
            }
        }
        near / all
    };
    let resources = light_up(&glb.scene, &grid);
    let before = buried(&resources);
    let after = buried(&settle(gpu(), &glb.scene, &grid, resources, LIGHTS));
    println!("near surfaces is {before:.3} of the light before, in {after:.3} after");
    assert!(before > 0.25 && after < 0.17, "{before} before, {after} after");
}
