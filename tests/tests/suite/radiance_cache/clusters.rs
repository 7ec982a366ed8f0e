//! Clusters and the places of caches: the shaders against their twin, and whether every pixel finds one.

use bevy::math::{UVec2, Vec3};
use bevy_bounce_shaders::types::{
    CACHE_HEIGHT, CACHE_WIDTH, CACHES_A_ROW, CLUSTER_FACING_BITS, CLUSTER_SLICE_BITS, CacheCounters, CacheGrid,
    RadianceCache,
};
use bevy_bounce_tests::gpu::{Resources, gpu};
use bevy_bounce_tests::scene::{run, run_with};
use bevy_bounce_tests::twins::clusters::{Clusters, cluster};
use bevy_bounce_tests::twins::random::Random;
use bevy_bounce_tests::twins::{decode_unit, encode_unit};
use wgpu::{FilterMode, TextureFormat};

use crate::sort::radix_sort;
use crate::ssbc::{Eye, room};

fn grid(size: UVec2, tile: u32, capacity: u32, slices: u32) -> CacheGrid {
    let tiles = size.map(|pixels| pixels.div_ceil(tile));
    CacheGrid { size, tiles, tile, capacity, slices, reach: 2.0, ..Default::default() }
}

/// Finds clusters with the shipped kernels; leaves all their buffers.
fn shipped(grid: &CacheGrid, surface: &[[u32; 2]]) -> Resources {
    let (pixels, tiles) = (surface.len() as u32, grid.tiles.element_product());
    let size = [grid.size.x, grid.size.y, 1];
    let resources = Resources::new(gpu())
        .uniform("parameters", grid)
        .texture("surface_texture", TextureFormat::Rg32Uint, size, false, bytemuck::cast_slice(surface))
        .zeroed("frames", tiles as usize)
        .zeroed("pairs", 2 * pixels as usize)
        .zeroed("pair_count", 1)
        .structs("counters", &[CacheCounters::default()])
        .zeroed("blocks", pixels.div_ceil(1024) as usize)
        .zeroed("starts", grid.capacity as usize + 1)
        .zeroed("ranges", 2 * tiles as usize);
    run(gpu(), "radiance_cache/frame.wgsl", "choose_axes", &resources, [tiles, 1, 1]);
    run(gpu(), "radiance_cache/keys.wgsl", "write_keys", &resources, [pixels.div_ceil(64), 1, 1]);
    assert_eq!(resources.read_words("pair_count").expect("reads back"), [pixels]);
    let words = resources.read_words("pairs").expect("reads back");
    let bits = CLUSTER_SLICE_BITS + CLUSTER_FACING_BITS + (u32::BITS - tiles.leading_zeros());
    let sorted = radix_sort(words.as_chunks().0, bits);
    let resources = resources.words("pairs", sorted.as_flattened());
    let path = "radiance_cache/clusters.wgsl";
    let blocks = [pixels.div_ceil(1024), 1, 1];
    run(gpu(), path, "count_differences", &resources, [pixels.div_ceil(256), 1, 1]);
    run(gpu(), path, "choose_coarseness", &resources, [1, 1, 1]);
    run(gpu(), path, "count_blocks", &resources, blocks);
    run(gpu(), path, "scan_blocks", &resources, [1, 1, 1]);
    run(gpu(), path, "number_clusters", &resources, blocks);
    resources
}

fn counters(resources: &Resources) -> CacheCounters {
    resources.read_structs("counters").expect("reads back")[0]
}

fn assert_equal(name: &str, grid: &CacheGrid, surface: &[[u32; 2]]) -> Clusters {
    let twin = cluster(grid, surface);
    let resources = shipped(grid, surface);
    let counted = counters(&resources);
    let read = |name| resources.read_words(name).expect("reads back");
    assert_eq!(read("frames"), twin.frames, "{name}: axes");
    let pairs = read("pairs");
    let order: Vec<u32> = pairs.as_chunks::<2>().0.iter().take(twin.order.len()).map(|[_, pixel]| *pixel).collect();
    assert_eq!(order, twin.order, "{name}: order");
    let keys: Vec<u32> = pairs.as_chunks::<2>().0.iter().map(|[key, _]| *key).collect();
    assert!(pairs.as_chunks::<2>().0.iter().all(|[key, pixel]| *key == twin.keys[*pixel as usize]), "{name}: {keys:?}");
    let clusters = twin.starts.len() as u32 - 1;
    assert_eq!(counted.pixels, twin.order.len() as u32, "{name}: pixels");
    assert_eq!((counted.clusters, counted.merged), (clusters, twin.merged), "{name}: clusters");
    assert_eq!(counted.coarseness, twin.coarseness, "{name}: coarseness");
    assert!(clusters <= grid.capacity, "{name}: {clusters} clusters in {}", grid.capacity);
    if clusters > 0 {
        assert_eq!(read("starts")[..twin.starts.len()], twin.starts, "{name}: starts");
    }
    assert_eq!(read("ranges"), twin.ranges.as_flattened(), "{name}: ranges");
    twin
}

#[test]
fn clusters_equal_their_twin() {
    let mut random = Random::new(3);
    let depth = |random: &mut Random| (random.unit() * 0.1 + 1e-3).to_bits();
    let any = |random: &mut Random| [depth(random), encode_unit(random.direction())];
    for (size, tile) in [([1, 1], 8), ([7, 5], 8), ([64, 36], 8), ([33, 17], 16), ([128, 40], 32), ([9, 200], 24)] {
        let size = UVec2::from(size);
        let count = size.element_product() as usize;
        let room = grid(size, tile, 4096, 8);
        let scattered: Vec<_> = (0..count).map(|_| any(&mut random)).collect();
        assert_equal("all different", &room, &scattered);
        let one = any(&mut random);
        assert_equal("all one", &room, &vec![one; count]);
        assert_equal("no surface", &room, &vec![[0; 2]; count]);
        let holes: Vec<_> = scattered.iter().map(|s| if random.below(3) == 0 { [0; 2] } else { *s }).collect();
        assert_equal("holes", &room, &holes);
        let raw: Vec<_> = (0..count).map(|_| [random.bits() >> 1, random.bits()]).collect();
        assert_equal("any words", &room, &raw);
        let even = CacheGrid { orthographic: 1, slices: 100, ..room };
        assert_equal("orthographic", &even, &scattered);
        let tiles = room.tiles.element_product();
        for capacity in [1, tiles, 2 * tiles, 3 * tiles + 1] {
            let narrow = CacheGrid { capacity, ..room };
            let twin = assert_equal("little room", &narrow, &scattered);
            if count as u32 > 4 * tiles {
                assert!(twin.merged > 0, "{capacity} caches are enough for {count} pixels");
            }
            assert_equal("little room and holes", &narrow, &holes);
        }
    }
}

/// So many pixels that sums over their blocks take more than one round.
#[test]
fn clusters_of_large_pictures_equal_their_twin() {
    let mut random = Random::new(17);
    let size = UVec2::new(700, 400);
    let count = size.element_product() as usize;
    assert!(count.div_ceil(1024) > 256);
    let mut any = || [(random.unit() * 0.1 + 1e-3).to_bits(), encode_unit(random.direction())];
    let scattered: Vec<_> = (0..count).map(|_| any()).collect();
    let twin = assert_equal("large", &grid(size, 24, 8192, 8), &scattered);
    assert!(twin.merged > 0, "there is room for all clusters");
    let holes: Vec<_> = scattered.iter().enumerate().map(|(i, s)| if i % 5 == 0 { [0; 2] } else { *s }).collect();
    assert_equal("large, with holes", &grid(size, 24, 1500, 8), &holes);
}

/// A flat tile has one cluster, an edge of a room two or three: no more than the normals need.
#[test]
fn flat_tiles_have_one_cluster() {
    let size = UVec2::new(16, 8);
    let depth = 0.1_f32.to_bits();
    let facing = |normals: [Vec3; 2]| {
        (0..128).map(|i| [depth, encode_unit(normals[usize::from(i % 8 < 4)].normalize())]).collect::<Vec<_>>()
    };
    let tilted = Vec3::new(0.1, 1.0, 0.05);
    let flat = cluster(&grid(size, 8, 512, 8), &facing([Vec3::Y, tilted]));
    assert_eq!(flat.starts.len() - 1, 2, "{:?}", flat.ranges);
    let edge = cluster(&grid(size, 8, 512, 8), &facing([Vec3::Y, Vec3::X]));
    assert_eq!(edge.starts.len() - 1, 4, "{:?}", edge.ranges);
    let thin = cluster(&grid(size, 8, 512, 8), &facing([Vec3::Y, Vec3::NEG_Y]));
    assert_eq!(thin.starts.len() - 1, 4, "what faces apart is together: {:?}", thin.ranges);
}

/// Adds caches to clusters, and keeps those of the last frame that hold.
fn place_after(
    last: &[RadianceCache],
    eye: &Eye,
    grid: &CacheGrid,
    resources: Resources,
) -> (Resources, Vec<RadianceCache>) {
    let resources = resources
        .bytes("view", &eye.uniform())
        .structs("last", last)
        .zeroed("kept", grid.size.element_product() as usize)
        .structs("caches", &vec![RadianceCache { radius: 9.0, ..Default::default() }; grid.capacity as usize]);
    run(gpu(), "radiance_cache/keep.wgsl", "keep", &resources, [grid.capacity.div_ceil(64), 1, 1]);
    run(gpu(), "radiance_cache/place.wgsl", "place", &resources, [grid.capacity, 1, 1]);
    let caches = resources.read_structs("caches").expect("reads back");
    (resources, caches)
}

fn place(eye: &Eye, grid: &CacheGrid, resources: Resources) -> (Resources, Vec<RadianceCache>) {
    place_after(&vec![RadianceCache::default(); grid.capacity as usize], eye, grid, resources)
}

/// The paper's score, with lengths in halves of the box's diagonal.
fn score(position: Vec3, normal: Vec3, center: Vec3, mean: Vec3, extent: f32) -> f32 {
    let way = (position - center) / extent;
    let out = way.dot(mean);
    (normal.dot(mean) + out) / (1.0 + (way - mean * out).length())
}

#[test]
fn caches_are_where_the_score_is_highest() {
    let eye = Eye::new(UVec2::new(96, 54), Vec3::new(0.3, 1.9, 5.4), Vec3::new(0.0, 1.6, 0.0), 0.65);
    let gbuffer = eye.look(&room());
    let grid = grid(eye.size, 16, 512, 8);
    let twin = cluster(&grid, &gbuffer.surface);
    let (_, caches) = place(&eye, &grid, shipped(&grid, &gbuffer.surface));
    for (cache, members) in caches.iter().zip(twin.starts.windows(2)) {
        let members = &twin.order[members[0] as usize..members[1] as usize];
        let at = |pixel: u32| UVec2::new(pixel % eye.size.x, pixel / eye.size.x);
        let surface = |pixel: &u32| gbuffer.surface_at(at(*pixel)).expect("has a surface");
        let pixel = cache.screen.floor().as_uvec2();
        let chosen = pixel.x + pixel.y * eye.size.x;
        assert!(members.contains(&chosen), "a cache is on a pixel of its cluster");
        let (position, normal, ..) = surface(&chosen);
        assert!(position.distance(cache.position) < 1e-3 * position.length(), "{position} {cache:?}");
        assert!(normal.distance(cache.normal) < 1e-3);
        let positions: Vec<Vec3> = members.iter().map(|pixel| surface(pixel).0).collect();
        let low = positions.iter().fold(Vec3::INFINITY, |low, p| low.min(*p));
        let high = positions.iter().fold(Vec3::NEG_INFINITY, |high, p| high.max(*p));
        let extent = 0.5 * low.distance(high);
        let mean = members.iter().map(|pixel| decode_unit(gbuffer.surface[*pixel as usize][1])).sum::<Vec3>();
        if members.len() > 1 && mean.length() > 0.1 {
            let of = |p: Vec3, n: Vec3| score(p, n, 0.5 * (low + high), mean.normalize(), extent);
            let best = members.iter().map(|pixel| of(surface(pixel).0, surface(pixel).1)).fold(f32::MIN, f32::max);
            assert!(of(position, normal) > best - 1e-2, "{} of {best}", of(position, normal));
        }
        let reach = positions.iter().map(|p| p.distance(cache.position)).fold(0.0, f32::max);
        assert!(cache.radius > 1.9 * reach, "{} of {reach}", cache.radius);
    }
}

/// The same frame again has the same caches to the bit, and a camera that creeps keeps nearly all of them. What lies off its
/// surface is not kept; what is kept still lights all of its cluster.
#[test]
fn caches_stay_where_they_hold() {
    let look = |at: Vec3| Eye::new(UVec2::new(96, 54), at, at + Vec3::new(-0.3, -0.3, -5.4), 0.65);
    let at = Vec3::new(0.3, 1.9, 5.4);
    let caches_after = |last: &[RadianceCache], eye: &Eye| {
        let gbuffer = eye.look(&room());
        let grid = grid(eye.size, 16, 512, 8);
        let resources = shipped(&grid, &gbuffer.surface);
        let clusters = counters(&resources).clusters as usize;
        let (_, caches) = place_after(last, eye, &grid, resources);
        assert!(caches[clusters..].iter().all(|cache| cache.radius == 0.0), "what is no cache is none");
        let twin = cluster(&grid, &gbuffer.surface);
        for (cache, members) in caches.iter().zip(twin.starts.windows(2)) {
            let reach = twin.order[members[0] as usize..members[1] as usize].iter().map(|pixel| {
                let surface = gbuffer.surface_at(UVec2::new(pixel % eye.size.x, pixel / eye.size.x));
                surface.expect("has a surface").0.distance(cache.position)
            });
            assert!(cache.radius > 1.9 * reach.fold(0.0, f32::max), "{cache:?}");
        }
        caches
    };
    let held = |caches: &[RadianceCache], last: &[RadianceCache]| {
        let is_held = |cache: &&RadianceCache| last.iter().any(|other| other.position == cache.position);
        let (all, held) = (caches.iter().filter(|cache| cache.radius > 0.0), caches.iter().filter(|c| c.radius > 0.0));
        held.filter(is_held).count() as f32 / all.count() as f32
    };
    let none = vec![RadianceCache::default(); 512];
    let first = caches_after(&none, &look(at));
    assert_eq!(first, caches_after(&first, &look(at)), "the same frame again");
    // A pixel at that distance.
    let pixel = 5.4 * 2.0 * (0.65_f32 / 2.0).tan() / 54.0;
    let crept = look(at + Vec3::X * 0.05 * pixel);
    let kept = held(&caches_after(&first, &crept), &first);
    assert!(kept > 0.9, "{kept} of the caches stay");
    assert!(held(&caches_after(&none, &crept), &first) < 0.1, "they would have stayed anyway");
    let lifted = |cache: &RadianceCache| RadianceCache { position: cache.position + 0.2 * cache.normal, ..*cache };
    let lifted: Vec<_> = first.iter().map(lifted).collect();
    assert_eq!(held(&caches_after(&lifted, &look(at)), &lifted), 0.0, "what is off its surface does not hold");
}

/// A hundred cameras in a room, some with little room for caches: no pixel is without light.
#[test]
fn every_pixel_finds_a_cache() {
    let mut random = Random::new(11);
    let mut most = 0;
    for i in 0..100 {
        let at = Vec3::new(0.0, 2.0, 0.0) + random.vector() * Vec3::new(1.9, 1.9, 4.0);
        let toward = at + random.direction();
        let eye = Eye::new(UVec2::new(64, 36), at, toward, 0.3 + 1.4 * random.unit());
        let gbuffer = eye.look(&room());
        let tiles = 8 * 5;
        let grid = grid(eye.size, 8, if i % 4 == 0 { 2 * tiles } else { 512 }, 1 + random.below(31));
        let (resources, _) = place(&eye, &grid, shipped(&grid, &gbuffer.surface));
        let counted = counters(&resources);
        most = most.max(counted.clusters);
        assert!(counted.clusters <= grid.capacity);
        let size = [64, 36, 1];
        let atlas = [CACHES_A_ROW * CACHE_WIDTH, grid.capacity.div_ceil(CACHES_A_ROW) * CACHE_HEIGHT, 1];
        let resources = resources
            .texture("deferred_texture", TextureFormat::Rgba32Uint, size, false, &[])
            .texture("atlas", TextureFormat::Rgba16Float, atlas, false, &[])
            .sampler("atlas_sampler", FilterMode::Linear)
            .floats("unit", &[1.0])
            .alias("counters", "missing")
            .texture("glossy", TextureFormat::Rgba16Float, size, false, &[])
            .texture("coat", TextureFormat::Rgba16Float, size, false, &[])
            .texture("diffuse", TextureFormat::Rgba16Float, size, false, &[]);
        run_with(gpu(), "radiance_cache/evaluate.wgsl", "evaluate", &["DIFFUSE"], &resources, [8, 5, 1]);
        let counted = counters(&resources);
        let lit = gbuffer.surface.iter().filter(|surface| surface[0] != 0).count();
        assert_eq!((counted.missing, counted.pixels as usize), (0, lit), "camera {i}");
    }
    println!("at most {most} clusters");
}
