//! What virtual lights see, against exact rays.

use bevy::math::{Affine3A, EulerRot, Quat, Vec2, Vec3};
use bevy_bounce_shaders::types::{AtlasParameters, Occluder, TILE_EMPTY, Vpl, VplHeader, tile_parts};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, cuboid, run, settled};
use bevy_bounce_tests::twins::random::Random;

const TILE: u32 = 32;
const LIGHTS: usize = 96;
const VOXEL: f32 = 0.1;

/// A room with a turned box and two small ones: walls, contacts, silhouettes.
fn scene() -> TestScene {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    scene.room(Vec3::new(-2.0, 0.0, -1.5), Vec3::new(2.0, 2.5, 1.5));
    let turn =
        Affine3A::from_rotation_translation(Quat::from_euler(EulerRot::XYZ, 0.3, 0.7, 0.1), Vec3::new(-0.6, 0.9, 0.2));
    scene.mesh(&cuboid(Vec3::splat(-0.4), Vec3::splat(0.4)), 0, 0, turn);
    scene.soup(&cuboid(Vec3::new(0.5, 0.0, -0.5), Vec3::new(1.1, 0.8, 0.3)));
    scene.soup(&cuboid(Vec3::new(0.6, 0.8, -0.4), Vec3::new(0.7, 1.0, -0.3)));
    scene
}

/// Points on the surfaces, by area, with their normals.
fn surface_points(scene: &TestScene, random: &mut Random, count: usize) -> Vec<(Vec3, Vec3)> {
    let area = |t: &[Vec3; 3]| (t[1] - t[0]).cross(t[2] - t[0]).length();
    let total: f32 = scene.triangles.iter().map(area).sum();
    let point = |random: &mut Random| {
        let mut pick = random.unit() * total;
        let found = scene.triangles.iter().find(|t| {
            pick -= area(t);
            pick < 0.0
        });
        let [a, b, c] = *found.unwrap_or(&scene.triangles[0]);
        let (u, v) = (random.unit(), random.unit());
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        (a + (b - a) * u + (c - a) * v, (b - a).cross(c - a).normalize())
    };
    (0..count).map(|_| point(random)).collect()
}

/// Lights of the normals given, a little off their surfaces, and their maps.
fn draw(scene: &TestScene, lights: &[(Vec3, Vec3)], random: &mut Random, tile: u32) -> Resources {
    draw_coarse(scene, lights, random, tile, 0.0, |_| 0)
}

/// The same where what casts may be off its surface: by how much at most, and how far each instance goes towards that.
fn draw_coarse(
    scene: &TestScene,
    lights: &[(Vec3, Vec3)],
    random: &mut Random,
    tile: u32,
    error: f32,
    steps: impl Fn(u32) -> u32,
) -> Resources {
    let (mut chunks, occluder_count) = scene.occluder_chunks();
    for chunk in &mut chunks {
        chunk.error = steps(chunk.instance);
    }
    let (low, high) = scene.bounds();
    let parameters = AtlasParameters { tile, occluder_count, far: (high - low).length(), point_area: 0.0, error };
    let vpls: Vec<Vpl> = lights
        .iter()
        .map(|&(position, normal)| Vpl {
            position: position + normal * (random.unit() - 0.5) * 0.5 * VOXEL,
            normal,
            bounce_met: 1,
            incoming: pack_incoming(-normal, 1.5),
            ..Vpl::default()
        })
        .collect();
    let grid = scene.grid(VOXEL);
    let vpls = settled(gpu(), scene, &grid, &vpls);
    let header = VplHeader { count: vpls.len() as u32, ..VplHeader::default() };
    let resources = scene
        .resources(gpu())
        .uniform("parameters", &parameters)
        .uniform("grid", &grid)
        .structs("occluder_chunks", &chunks)
        .structs("occluders", &vec![Occluder::default(); occluder_count as usize])
        .structs("header", &[header])
        .structs("vpls", &vpls)
        .zeroed("atlas", vpls.len() * (tile * tile) as usize);
    run(gpu(), "shadow_atlas/occluders.wgsl", "place_occluders", &resources, [chunks.len() as u32, 1, 1]);
    run(gpu(), "shadow_atlas/rasterize.wgsl", "rasterize", &resources, [vpls.len() as u32, 1, tile_parts(tile)]);
    resources
}

/// Twin of `pack_incoming` in `vpl/types.wgsl`.
pub fn pack_incoming(direction: Vec3, reach: f32) -> u32 {
    let sum = direction.abs().element_sum();
    let p = direction.truncate() / sum;
    let folded = (1.0 - Vec2::new(p.y, p.x).abs()) * Vec2::new(1f32.copysign(p.x), 1f32.copysign(p.y));
    let p = if direction.z >= 0.0 { p } else { folded };
    let byte = |x: f32| u32::from((x * 127.0).round() as i8 as u8);
    u32::from(half::f16::from_f32(reach).to_bits()) << 16 | byte(p.x) << 8 | byte(p.y)
}

/// Distance to the front of the nearest triangle beyond `least`.
pub fn nearest(scene: &TestScene, origin: Vec3, direction: Vec3, least: f32) -> Option<f32> {
    let hits = scene.triangles.iter().filter_map(|t| crate::paths::intersect(t, origin, direction));
    hits.filter(|t| *t > least).min_by(f32::total_cmp)
}

/// Twins of `shadow_atlas/tile.wgsl`.
pub fn from_tile(place: Vec2) -> Vec3 {
    let w = place * 2.0 - 1.0;
    Vec3::new(w.x + w.y, w.x - w.y, 2.0 - 2.0 * w.abs().max_element()) * 0.5
}

pub fn tile_frame(n: Vec3) -> [Vec3; 3] {
    let s = if n.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n.z);
    let tangent = Vec3::new(1.0 + s * n.x * n.x * a, s * n.x * n.y * a, -s * n.x);
    [tangent, n.cross(tangent), n]
}

#[test]
fn every_texel_holds_the_distance_of_a_ray() {
    check_texels(TILE, LIGHTS);
}

/// Nine parts, of which five have 48 x 4 texels and fewer.
#[test]
fn every_texel_of_a_map_in_parts_holds_the_distance_of_a_ray() {
    check_texels(100, 12);
}

fn check_texels(tile: u32, count: usize) {
    let (scene, mut random) = (scene(), Random::new(3));
    let lights = surface_points(&scene, &mut random, count);
    let resources = draw(&scene, &lights, &mut random, tile);
    let vpls: Vec<Vpl> = resources.read_structs("vpls").expect("reads back");
    let words = resources.read_words("atlas").expect("reads back");
    let (low, high) = scene.bounds();
    let far = (high - low).length();
    let mut wrong = 0;
    for (light, vpl) in vpls.iter().enumerate() {
        let off = vpl.position - lights[light].0;
        let (above, aside) = (off.dot(lights[light].1).abs(), off.length());
        // The direction it came from is known to half a degree.
        assert!(
            above < 1e-4 && aside < 0.01 * VOXEL,
            "light {light} is {above} above its surface, {aside} off its place"
        );
        let [x, y, z] = tile_frame(vpl.normal);
        for texel in 0..tile * tile {
            let place = (Vec2::new((texel % tile) as f32, (texel / tile) as f32) + 0.5) / tile as f32;
            let d = from_tile(place);
            let direction = (x * d.x + y * d.y + z * d.z).normalize();
            let word = words[light * (tile * tile) as usize + texel as usize];
            let exact = nearest(&scene, vpl.position, direction, 1e-4);
            let agree = match exact {
                Some(distance) => (((word >> 18) as f32 - distance / far * 16383.0).abs()) < 2.0,
                None => word == TILE_EMPTY,
            };
            wrong += usize::from(!agree);
        }
    }
    let texels = count * (tile * tile) as usize;
    assert!(wrong * 2000 < texels, "{wrong} of {texels} texels hold another distance than the ray's");
}

/// What maps say of lights, and points with their normals.
pub fn look(resources: Resources, pairs: &[(usize, Vec3, Vec3)]) -> Vec<bool> {
    const LOOK: &str = "
        #import bevy_bounce::shadow_atlas::lookup::atlas_visible
        #import bevy_bounce::vpl::types::Vpl
        @group(0) @binding(0) var<storage, read> vpls: array<Vpl>;
        @group(0) @binding(1) var<storage, read> points: array<vec4<f32>>;
        @group(0) @binding(2) var<storage, read_write> seen: array<u32>;
        @compute @workgroup_size(64)
        fn look(@builtin(global_invocation_id) id: vec3<u32>) {
            if id.x >= arrayLength(&seen) {
                return;
            }
            let light = u32(points[2u * id.x].w);
            let vpl = vpls[light];
            let point = points[2u * id.x].xyz;
            seen[id.x] = u32(atlas_visible(light, vpl.position, vpl.normal, point, points[2u * id.x + 1u].xyz));
        }";
    let packed: Vec<f32> =
        pairs.iter().flat_map(|(light, p, n)| [p.x, p.y, p.z, *light as f32, n.x, n.y, n.z, 0.0]).collect();
    let resources = resources.floats("points", &packed).zeroed("seen", pairs.len());
    let kernel = gpu().kernel(&compose_source(LOOK, "look.wgsl", &[]).expect("composes"), "look");
    let groups = pairs.len().div_ceil(64) as u32;
    gpu().dispatch(&kernel.expect("the device takes it"), &resources, [groups, 1, 1]).expect("runs");
    resources.read_words("seen").expect("reads back").iter().map(|word| *word != 0).collect()
}

/// What casts may be off its surface, as coarser versions of meshes are: that much of a mesh counts as lit, no more.
#[test]
fn each_mesh_has_an_error_of_its_own() {
    const ERROR: f32 = 0.36;
    let mut scene = TestScene::new(Vec3::splat(0.5));
    let slab = |x: f32| cuboid(Vec3::new(x - 0.4, 1.0, -0.4), Vec3::new(x + 0.4, 1.9, 0.4));
    let floor = [Vec3::new(-3.0, 0.0, -3.0), Vec3::new(-3.0, 0.0, 3.0), Vec3::new(3.0, 0.0, -3.0)];
    for soup in [&[floor][..], &slab(-1.5), &slab(-0.5), &slab(0.5), &slab(1.5)] {
        scene.soup(soup);
    }
    let lights: Vec<(Vec3, Vec3)> = [-1.5, -0.5, 0.5, 1.5].map(|x| (Vec3::new(x, 0.0, 0.1), Vec3::Y)).into();
    let mut random = Random::new(7);
    // The floor's instance comes first.
    let resources = draw_coarse(&scene, &lights, &mut random, TILE, ERROR, |instance| instance.saturating_sub(1));
    let heights = [0.02, 0.07, 0.13, 0.19, 0.3, 0.42];
    let pairs: Vec<(usize, Vec3, Vec3)> = (0..lights.len())
        .flat_map(|light| heights.map(|height| (light, lights[light].0 + Vec3::Y * (1.0 + height), Vec3::NEG_Y)))
        .collect();
    for ((light, position, _), seen) in pairs.iter().zip(look(resources, &pairs)) {
        let allowed = (*light as f32 / 3.0).powi(2) * ERROR;
        let height = position.y - 1.0;
        assert_eq!(seen, height < allowed + 0.01, "mesh {light}, {height} behind its surface, may be off by {allowed}");
    }
}

#[test]
fn maps_agree_with_exact_rays() {
    let (scene, mut random) = (scene(), Random::new(5));
    let lights = surface_points(&scene, &mut random, LIGHTS);
    let resources = draw(&scene, &lights, &mut random, TILE);
    let points = surface_points(&scene, &mut random, 20_000);
    let pairs: Vec<(usize, Vec3, Vec3)> = points
        .into_iter()
        .enumerate()
        .filter(|&(i, (position, normal))| {
            let (from, facing) = lights[i % LIGHTS];
            let to = (position - from).normalize();
            to.dot(facing) > 0.0 && to.dot(normal) < 0.0
        })
        .map(|(i, (position, normal))| (i % LIGHTS, position, normal))
        .collect();
    let seen = look(resources, &pairs);
    let (mut agree, mut lit, mut both) = (0, 0, 0);
    for ((light, position, _), seen) in pairs.iter().zip(seen) {
        let from = lights[*light].0 + lights[*light].1 * 1e-4;
        let to = *position - from;
        let exact = nearest(&scene, from, to.normalize(), 1e-4).is_none_or(|t| t > to.length() - 1e-3);
        agree += usize::from(exact == seen);
        lit += usize::from(exact);
        both += usize::from(exact && seen);
    }
    let share = |count: usize, of: usize| count as f64 / of as f64;
    println!("{} pairs: {:.4} agree, {:.4} of the lit are", pairs.len(), share(agree, pairs.len()), share(both, lit));
    assert!(lit * 3 > pairs.len() && lit * 20 < pairs.len() * 19, "{lit} of {} pairs are lit", pairs.len());
    assert!(share(agree, pairs.len()) >= 0.97, "{agree} of {} pairs agree", pairs.len());
}
