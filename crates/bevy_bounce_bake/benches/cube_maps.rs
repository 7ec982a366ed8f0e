//! What a cube map costs: casting, encoding, asking. `cargo bench --workspace --bench cube_maps`, on the repository's Cornell
//! box with an atlas of 64 and cube maps of 64.

use std::path::Path;
use std::sync::LazyLock;

use bevy_bounce_bake::cube_maps::{CubeMap, encode_cube_maps};
use bevy_bounce_bake::rays::{Bvh, CubeTile, Layers, PACKET, cast};
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::block::{BlockEncoder, BlockRays, LANES, ROWS};
use bevy_bounce_cssm::{CssmFile, Filter, OpenEnd, Texel};
use divan::{Bencher, black_box, counter::ItemsCount};
use glam::Vec3;

/// Pairs a round of queries.
const PAIRS: usize = 4096;

static SCENE: LazyLock<Scene> = LazyLock::new(|| {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/cornell_box.glb");
    Source::open(&path).and_then(|source| Scene::from_gltf(&source)).expect("the repository has it")
});

static FILE: LazyLock<CssmFile> = LazyLock::new(|| {
    let settings = BakeSettings { atlas: 64, depth: 64, ..BakeSettings::default() };
    bake(&SCENE, &settings, &()).expect("it can be baked").0
});

fn main() {
    divan::main();
}

/// The texels of a block in the middle of the file.
fn block() -> Vec<Texel> {
    let middle = FILE.meta.blocks / 2 * LANES as u32;
    let texels = (0..FILE.meta.texels as usize).filter_map(|index| FILE.texel(index));
    texels.filter(|texel| (middle..middle + LANES as u32).contains(&texel.slot)).collect()
}

/// One packet of a texel's map: first pixel and face.
fn packet(bvh: &Bvh, texel: &Texel, [face, x, y]: [usize; 3], stack: &mut Vec<(u32, f32)>) -> Layers {
    let mut tile = CubeTile::new(face, x, y, FILE.meta.depth as usize);
    tile.origin = Vec3::from(FILE.center(texel));
    let mut layers = Layers::new((0.0, FILE.meta.quantum), 1.0 / FILE.meta.depth as f32);
    cast(bvh, &tile, &mut layers, stack);
    layers
}

/// Packets of 64 rays, both layers.
#[divan::bench]
fn cast_packets(bencher: Bencher) {
    let (bvh, texels, mut stack) = (Bvh::new(&SCENE), block(), Vec::new());
    bencher.counter(ItemsCount::new(texels.len())).bench_local(|| {
        for texel in &texels {
            black_box(packet(&bvh, texel, [2, 24, 24], &mut stack));
        }
    });
}

/// Blocks of 64 texels by 32 pixels: half of each packet of a whole face.
#[divan::bench]
fn encode_blocks(bencher: Bencher) {
    let (bvh, texels, mut stack) = (Bvh::new(&SCENE), block(), Vec::new());
    let side = FILE.meta.depth as usize;
    let places = (0..side).step_by(PACKET).flat_map(|y| (0..side).step_by(PACKET).map(move |x| [2, x, y]));
    let rays = |place: [usize; 3]| {
        let mut rays = BlockRays::ANY;
        for (lane, texel) in texels.iter().enumerate() {
            let layers = packet(&bvh, texel, place, &mut stack);
            for row in 0..ROWS {
                let depth = |layer: &[[f32; PACKET]; PACKET]| 1.0 / layer[row / PACKET][row % PACKET];
                let (first, second) = (depth(&layers.first), depth(&layers.second));
                rays.set(row, lane, FILE.quantizer().interval(first, second, OpenEnd::Unbounded));
            }
        }
        rays
    };
    let blocks: Vec<BlockRays> = places.map(rays).collect();
    let (mut encoder, mut words) = (BlockEncoder::default(), Vec::new());
    bencher.counter(ItemsCount::new(blocks.len())).bench_local(|| {
        words.clear();
        blocks.iter().for_each(|rays| {
            black_box(encoder.encode(rays, &mut words));
        });
    });
}

/// Whole cube maps of 64 texels: cast and encoded.
#[divan::bench]
fn cube_maps(bencher: Bencher) {
    let bvh = Bvh::new(&SCENE);
    let map = |texel: &Texel| CubeMap { center: Vec3::from(FILE.center(texel)), normal: Vec3::from(texel.normal) };
    let blocks = [block().iter().map(map).collect::<Vec<_>>()];
    bencher
        .counter(ItemsCount::new(blocks[0].len()))
        .bench_local(|| encode_cube_maps(&bvh, &blocks, FILE.meta.depth as usize, FILE.quantizer(), &|_| ()));
}

/// From a random texel to a random one's place.
#[divan::bench(args = ["nearest", "pixels", "pixels and texels"])]
fn query(bencher: Bencher, filter: &str) {
    let filter = match filter {
        "nearest" => Filter::Nearest,
        "pixels" => Filter::Pixels,
        _ => Filter::PixelsAndTexels,
    };
    let mut rng = fastrand::Rng::with_seed(1);
    let mut texel = || FILE.texel(rng.usize(0..FILE.meta.texels as usize)).expect("in range");
    let pairs: Vec<(Texel, Texel)> = (0..PAIRS).map(|_| (texel(), texel())).collect();
    bencher.counter(ItemsCount::new(PAIRS)).bench_local(|| {
        let seen = |(texel, other): &(Texel, Texel)| {
            FILE.visibility(texel, texel.cell.map(|at| at as f32 + 0.3), other.position, filter)
        };
        pairs.iter().map(seen).sum::<f32>()
    });
}
