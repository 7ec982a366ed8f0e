//! The light of voxels and of caches, shader by shader.

use std::f32::consts::PI;

use bevy::math::{UVec3, Vec2, Vec3, Vec4};
use bevy_bounce_shaders::types::{
    CACHE_COARSE_EDGE, CACHE_EDGE, CACHE_HEIGHT, CACHE_WIDTH, CACHES_A_ROW, CacheCounters, Grid, LIGHT_DIRECTIONAL,
    LIGHT_POINT, Light, LightVolume, RadianceCache, VoxelGroups, Vpl, VplHeader,
};
use bevy_bounce_tests::compose::compose_source;
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{TestScene, cuboid, matte, run, run_over_triangles, voxelize};
use bevy_bounce_tests::twins::random::Random;
use bevy_bounce_tests::twins::ssbc::half_texels;
use half::f16;
use wgpu::{FilterMode, TextureFormat};

const HALF: TextureFormat = TextureFormat::Rgba16Float;

fn texels(resources: &Resources, name: &str) -> Vec<Vec4> {
    let bytes = resources.read_texture(name).unwrap_or_else(|error| panic!("{error}"));
    let halves: Vec<f32> = bytes.as_chunks().0.iter().map(|c| f16::from_le_bytes(*c).to_f32()).collect();
    halves.as_chunks().0.iter().map(|c| Vec4::from_array(*c)).collect()
}

/// The square is the hemisphere: there and back, and equal areas are equal solid angles.
#[test]
fn directions_of_a_cache_are_even() {
    const MAP: &str = "
        #import bevy_bounce::radiance_cache::hemisphere::{square_to_hemisphere, hemisphere_to_square}
        @group(0) @binding(0) var<storage, read_write> directions: array<vec4<f32>>;
        @group(0) @binding(1) var<storage, read_write> back: array<vec2<f32>>;
        @compute @workgroup_size(64)
        fn map(@builtin(global_invocation_id) id: vec3<u32>) {
            let square = (vec2<f32>(vec2<u32>(id.x % 64u, id.x / 64u)) + 0.5) / 64.0;
            let direction = square_to_hemisphere(square);
            directions[id.x] = vec4<f32>(direction, 0.0);
            back[id.x] = hemisphere_to_square(direction);
        }";
    let resources = Resources::new(gpu()).zeroed("directions", 4 * 4096).zeroed("back", 2 * 4096);
    let kernel = gpu().kernel(&compose_source(MAP, "map.wgsl", &[]).expect("composes"), "map").expect("compiles");
    gpu().dispatch(&kernel, &resources, [64, 1, 1]).expect("runs");
    let read = |name| resources.read_floats(name).expect("reads back");
    let directions: Vec<Vec3> =
        read("directions").as_chunks::<4>().0.iter().map(|v| Vec3::new(v[0], v[1], v[2])).collect();
    let back: Vec<Vec2> = read("back").as_chunks::<2>().0.iter().map(|v| Vec2::from_array(*v)).collect();
    for (i, (direction, back)) in directions.iter().zip(&back).enumerate() {
        let square = (Vec2::new((i % 64) as f32, (i / 64) as f32) + 0.5) / 64.0;
        assert!((direction.length() - 1.0).abs() < 1e-5 && direction.z > 0.0, "{direction}");
        assert!(back.distance(square) < 1e-4, "{square} comes back as {back}");
    }
    // Moments of the cosine over the hemisphere: 1/2 and 1/3; none across.
    let mean = |f: &dyn Fn(&Vec3) -> f32| directions.iter().map(f).sum::<f32>() / 4096.0;
    assert!((mean(&|d| d.z) - 0.5).abs() < 1e-3 && (mean(&|d| d.z * d.z) - 1.0 / 3.0).abs() < 1e-3);
    assert!(mean(&|d| d.x).abs() < 1e-4 && mean(&|d| d.x * d.y).abs() < 1e-4);
    // Every octant of the azimuth has its share. Octants are turned, for on their own edges there are texels.
    for octant in 0..8 {
        let within = |d: &&Vec3| ((d.y.atan2(d.x) / (PI / 4.0) + 0.5).floor() as i32 + 8) % 8 == octant && d.z > 0.5;
        let count = directions.iter().filter(within).count();
        assert!((count as f32 / 256.0 - 1.0).abs() < 0.05, "{count} of 256 in octant {octant}");
    }
}

/// Caches in a volume of one level, of which every half of each axis is those texels.
fn create(dims: u32, volume: [&[Vec4]; 3], normals: &[Vec3]) -> Resources {
    let size = [2 * dims + 1, dims, dims];
    let grid = Grid { voxel_size: 1.0, dims: UVec3::splat(dims), ..Default::default() };
    let parameters = LightVolume { dims: UVec3::splat(dims), gap: 1, ..Default::default() };
    let cache = |normal: &Vec3| RadianceCache {
        position: Vec3::splat(0.5 * dims as f32 + 0.1),
        normal: *normal,
        radius: 1.0,
        ..Default::default()
    };
    let caches: Vec<_> = normals.iter().map(cache).collect();
    let atlas = [CACHES_A_ROW * CACHE_WIDTH, CACHE_HEIGHT, 1];
    let resources = Resources::new(gpu())
        .structs("counters", &[CacheCounters { clusters: normals.len() as u32, ..Default::default() }])
        .structs("caches", &caches)
        .texture("atlas", HALF, atlas, false, &[])
        .uniform("grid", &grid)
        .uniform("volume", &parameters)
        .texture("light_x", HALF, size, true, &half_texels(volume[0]))
        .texture("light_y", HALF, size, true, &half_texels(volume[1]))
        .texture("light_z", HALF, size, true, &half_texels(volume[2]))
        .sampler("light_sampler", FilterMode::Linear)
        .uniform("voxel_groups", &VoxelGroups::default())
        .alias("light_x", "group_x")
        .alias("light_y", "group_y")
        .alias("light_z", "group_z");
    run(gpu(), "radiance_cache/create.wgsl", "create", &resources, [normals.len() as u32 + 3, 1, 1]);
    resources
}

/// Texels of each level of a cache.
fn levels(atlas: &[Vec4], index: u32) -> [Vec<Vec4>; 5] {
    std::array::from_fn(|level| {
        let coarse = (level as u32).wrapping_sub(1);
        let corner = if level == 0 { [0, 0] } else { [(coarse & 1) * 8, CACHE_EDGE + (coarse >> 1) * 8] };
        let edge = if level == 0 { CACHE_EDGE } else { CACHE_COARSE_EDGE };
        let texel = |i: u32| {
            let (x, y) = (index * CACHE_WIDTH + corner[0] + i % edge, corner[1] + i / edge);
            atlas[(y * CACHES_A_ROW * CACHE_WIDTH + x) as usize]
        };
        (0..edge * edge).map(texel).collect()
    })
}

/// Light that is the same from everywhere is the same at every level.
#[test]
fn constant_light_comes_back() {
    let light = Vec4::new(3.0, 0.5, 20.0, 1.0);
    let texels_of_volume = vec![light; 17 * 8 * 8];
    let mut random = Random::new(5);
    let normals: Vec<_> = (0..12).map(|_| random.direction()).collect();
    let volume = texels_of_volume.as_slice();
    let atlas = texels(&create(8, [volume; 3], &normals), "atlas");
    for cache in 0..12 {
        for (level, values) in levels(&atlas, cache).iter().enumerate() {
            for value in values {
                assert!((*value / light - 1.0).abs().max_element() < 2e-3, "level {level}: {value}, not {light}");
            }
        }
    }
}

/// Twin of `lobe_weight`.
fn lobe_weight(level: usize, cosine: f32) -> f32 {
    if level == 4 {
        return cosine.max(0.0);
    }
    let alpha = [0.22_f32, 0.4, 0.65, 1.0][level].powi(2);
    let d = (0.5 + 0.5 * cosine) * (alpha * alpha - 1.0) + 1.0;
    cosine.max(0.0) * alpha * alpha / (d * d)
}

/// Twin of `square_to_hemisphere`, at the middle of a texel.
fn direction(texel: usize, edge: u32) -> Vec3 {
    let p = (Vec2::new((texel as u32 % edge) as f32, (texel as u32 / edge) as f32) + 0.5) / edge as f32 * 2.0 - 1.0;
    let (radius, angle) =
        if p.y.abs() > p.x.abs() { (p.y, PI / 2.0 - PI / 4.0 * p.x / p.y) } else { (p.x, PI / 4.0 * p.y / p.x) };
    let scale = radius * (2.0 - radius * radius).sqrt();
    Vec3::new(angle.cos() * scale, angle.sin() * scale, 1.0 - radius * radius)
}

#[test]
fn levels_are_convolved_as_their_twin() {
    let mut random = Random::new(9);
    let mut noise = || (0..17 * 8 * 8).map(|_| (random.vector() * 0.5 + 0.5).extend(1.0) * 0.5).collect::<Vec<_>>();
    let volume: [Vec<Vec4>; 3] = std::array::from_fn(|_| noise());
    let [x, y, z] = volume.each_ref().map(Vec::as_slice);
    let atlas = texels(&create(8, [x, y, z], &[Vec3::Y, Vec3::new(0.6, -0.8, 0.0)]), "atlas");
    for cache in 0..2 {
        let levels = levels(&atlas, cache);
        let spread =
            levels[0].iter().map(|v| v.x).fold(0.0, f32::max) - levels[0].iter().map(|v| v.x).fold(9.0, f32::min);
        assert!(spread > 0.05, "there is nothing to convolve: {spread}");
        for (level, values) in levels.iter().enumerate().skip(1) {
            for (texel, value) in values.iter().enumerate() {
                let axis = direction(texel, CACHE_COARSE_EDGE);
                let (mut sum, mut weights) = (Vec4::ZERO, 0.0);
                for (i, light) in levels[0].iter().enumerate() {
                    let weight = lobe_weight(level, axis.dot(direction(i, CACHE_EDGE)));
                    sum += *light * weight;
                    weights += weight;
                }
                let error = (sum / weights - *value).abs().max_element();
                assert!(error < 3e-3, "level {level}, texel {texel}: {value}, expected {}", sum / weights);
            }
        }
    }
}

/// Coverage is the mean of four columns, of each the one in front and what is left of the one behind; light is weighted by it.
#[test]
fn a_coarser_level_keeps_surfaces_closed() {
    let mut random = Random::new(21);
    let size = UVec3::new(20, 8, 8);
    let count = size.element_product() as usize;
    let mut level = || {
        let texel = |_| {
            let coverage = [0.0, 0.0, 0.25, 0.5, 1.0][random.below(5) as usize];
            (random.vector() * 2.0 + 4.0).extend(1.0) * coverage
        };
        (0..count).map(texel).collect::<Vec<Vec4>>()
    };
    let finer: [Vec<Vec4>; 3] = std::array::from_fn(|_| level());
    let half = (size / 2).to_array();
    let mut resources = Resources::new(gpu()).uniform("volume", &LightVolume::default());
    for (name, texels) in ["finer_x", "finer_y", "finer_z"].iter().zip(&finer) {
        resources = resources.texture(name, HALF, size.to_array(), true, &half_texels(texels));
    }
    for name in ["level_x", "level_y", "level_z"] {
        resources = resources.texture(name, HALF, half, true, &[]);
    }
    run(gpu(), "radiance_cache/reduce.wgsl", "reduce", &resources, [3, 1, 1]);
    for (axis, (name, finer)) in ["level_x", "level_y", "level_z"].iter().zip(&finer).enumerate() {
        for (i, value) in texels(&resources, name).iter().enumerate() {
            let at = UVec3::new(i as u32 % half[0], i as u32 / half[0] % half[1], i as u32 / half[0] / half[1]);
            let corner = |c: u32| at * 2 + (UVec3::new(c, c >> 1, c >> 2) & 1);
            let place = |p: UVec3| ((p.z * size.y + p.y) * size.x + p.x) as usize;
            // What faces up the axis is in the first half, and is seen from above.
            let front = u32::from(at.x * 2 < half[0]) << axis;
            let column = |c: u32| {
                let (front, back) = (finer[place(corner(c ^ front))], finer[place(corner(c ^ front ^ (1 << axis)))]);
                front + back * (back.w.min(1.0 - front.w) / back.w.max(1e-6))
            };
            let expected: Vec4 = (0..8).filter(|c| c & (1 << axis) == 0).map(column).sum::<Vec4>() / 4.0;
            assert!((expected - *value).abs().max_element() < 5e-3, "{name} {at}: {value}, expected {expected}");
        }
    }
}

/// The scene's first level of the light volume by lights and emission; its grid, and the texture of what faces up and down.
fn lit(scene: &TestScene) -> (Grid, Vec<Vec4>, [u32; 3]) {
    let grid = scene.grid(0.2);
    let cells = grid.cell_capacity as usize;
    let dims = grid.dims.map(|voxels| voxels.next_multiple_of(2));
    let volume =
        LightVolume { dims, gap: 2, last_level: 1, first_group_cell: grid.cell_capacity, ..Default::default() };
    let size = [2 * dims.x + 2, dims.y, dims.z];
    let mut resources = voxelize(gpu(), scene, &grid, None)
        .uniform("volume", &volume)
        .zeroed("places", cells)
        .zeroed("unit", 4)
        .zeroed("irradiance", 8 * cells)
        .zeroed("emission_sums", 3 * cells)
        .structs("header", &[VplHeader::default()])
        .structs("vpls", &[Vpl::default()])
        .zeroed("densities", 2 * 4096);
    for name in ["level_x", "level_y", "level_z"] {
        resources = resources.texture(name, HALF, size, true, &[]);
    }
    // What shines, over its own triangles.
    let chunks = resources.read_words("emissive_chunks").expect("reads back");
    let resources = resources.words("chunks", &chunks).zeroed("queue", 1 + 3 * 64);
    let voxels = grid.dims.element_product().div_ceil(64);
    run_over_triangles(gpu(), &["ACCUMULATE", "EMISSION"], &resources, 1);
    run(gpu(), "radiance_cache/places.wgsl", "list_places", &resources, [voxels, 1, 1]);
    let resources = resources.floats("unit", &[UNIT]);
    run(gpu(), "radiance_cache/light.wgsl", "light_cells", &resources, [(cells as u32).div_ceil(64), 1, 1]);
    run(gpu(), "radiance_cache/volume.wgsl", "fill", &resources, dims.map(|d| d.div_ceil(4)).to_array());
    (grid, texels(&resources, "level_y"), size)
}

/// Radiance that counts as 1, cd/m^2.
const UNIT: f32 = 0.5;

/// A floor, and a lamp that shines over its corner.
fn floor_and_lamp() -> TestScene {
    let mut scene = TestScene::new(Vec3::splat(0.5));
    scene.soup(&cuboid(Vec3::new(-2.0, -0.1, -2.0), Vec3::new(2.0, 0.0, 2.0)));
    let mut lamp = matte(Vec3::ZERO);
    lamp.emissive = Vec3::new(40.0, 20.0, 10.0);
    scene.materials.push(lamp);
    scene.mesh(&cuboid(Vec3::new(-1.9, 0.3, -1.9), Vec3::new(-1.4, 0.8, -1.4)), 1, 0, Default::default());
    scene
}

/// A sun through a one-sided panel: its back lets light pass, its front does not.
#[test]
fn cells_have_the_light_of_a_sun_through_backs() {
    let corners =
        [Vec3::new(0.0, 1.0, -2.0), Vec3::new(0.0, 1.0, 2.0), Vec3::new(2.0, 1.0, 2.0), Vec3::new(2.0, 1.0, -2.0)];
    let [a, b, c, d] = corners;
    for (name, panel, passes) in [("front", [[a, b, c], [a, c, d]], false), ("back", [[a, c, b], [a, d, c]], true)] {
        let mut scene = floor_and_lamp();
        scene.soup(&panel);
        let (kind, direction, color) = (LIGHT_DIRECTIONAL, Vec3::NEG_Y, Vec3::splat(100.0));
        scene.lights.push(Light { kind, direction, color, cumulative_power: 1.0, ..Default::default() });
        let (grid, up, size) = lit(&scene);
        for (x, z) in (-4..9).flat_map(|x| (-9..10).map(move |z| (x as f32 * 0.2 + 0.07, z as f32 * 0.2 + 0.07))) {
            let voxel = ((Vec3::new(x, 0.0, z) - grid.origin) / grid.voxel_size).floor().as_uvec3();
            let found = up[((voxel.z * size[1] + voxel.y) * size[0] + voxel.x) as usize].x;
            let is_lit = passes || x < 0.0;
            let expected = if is_lit { 0.5 * 100.0 / PI / UNIT } else { 0.0 };
            assert!((found - expected).abs() <= 0.01 * expected, "{name} at {x} {z}: {found}, expected {expected}");
        }
    }
}

/// A floor, half of it in the shadow of a plate, under a point light; a lamp in the corner.
#[test]
fn cells_have_the_light_of_lamps_and_their_own() {
    let mut scene = floor_and_lamp();
    scene.soup(&cuboid(Vec3::new(0.0, 1.0, -2.0), Vec3::new(2.0, 1.1, 2.0)));
    let position = Vec3::new(0.0, 2.0, 0.0);
    let color = Vec3::new(100.0, 50.0, 25.0);
    scene.lights.push(Light { position, kind: LIGHT_POINT, color, cumulative_power: 1.0, ..Default::default() });
    let (grid, up, size) = lit(&scene);
    let at = |p: Vec3| {
        let voxel = ((p - grid.origin) / grid.voxel_size).floor().as_uvec3();
        (up[((voxel.z * size[1] + voxel.y) * size[0] + voxel.x) as usize], voxel)
    };
    let (mut lit, mut dark) = (0, 0);
    for (x, z) in (-9..10).flat_map(|x| (-9..10).map(move |z| (x as f32 * 0.2 + 0.07, z as f32 * 0.2 + 0.07))) {
        let (texel, voxel) = at(Vec3::new(x, 0.0, z));
        let center = grid.origin + (voxel.as_vec3() + 0.5) * grid.voxel_size;
        let way = position - center.with_y(0.0);
        let expected = color * (0.5 / PI / UNIT * way.y / way.length().powi(3));
        assert!(texel.w > 0.99, "the floor is closed at {x} {z}: {texel}");
        // The lamp throws a shadow, too.
        let behind_lamp = x < -0.8 && z < -0.8;
        if x < -0.3 && !behind_lamp {
            lit += 1;
            assert!((texel.truncate() / expected - 1.0).abs().max_element() < 0.03, "{texel}, expected {expected}");
        } else if (0.3..1.7).contains(&x) {
            dark += 1;
            assert_eq!(texel.truncate(), Vec3::ZERO, "light behind the plate at {x} {z}");
        }
    }
    assert!(lit > 100 && dark > 100);
    let (texel, _) = at(Vec3::new(-1.65, 0.8, -1.65));
    assert!((texel.truncate() / (scene.materials[1].emissive / UNIT) - 1.0).abs().max_element() < 0.02, "{texel}");
}
