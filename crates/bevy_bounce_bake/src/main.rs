use bevy_bounce_bake::{atlas::*, cube_maps::*, rays::*, scene::*, traversal::*};
use bevy_bounce_cssm::*;
use glam::Vec3;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let t0 = std::time::Instant::now();
    let scene = Scene::from_gltf(&Source::open(a[1].as_ref()).unwrap()).unwrap();
    let atlas = Atlas::build(&scene, a[2].parse().unwrap(), UvSource::Auto).unwrap_or_else(|e| panic!("{e}"));
    let side: usize = a[3].parse().unwrap();
    println!("atlas {:?} texels {} charts {} area {} {:?}", atlas.size, atlas.texels.len(), atlas.charts, atlas.texels.iter().map(|t| t.texel.area).sum::<f32>(), t0.elapsed());
    let strategy: Strategy = a[4].parse().unwrap();
    let blocks = blocks(&atlas, strategy);
    let (min, max) = scene.bounds();
    let diag = min.distance(max);
    let tris: Vec<_> = scene.triangles().collect();
    let bvh = Bvh::new(&tris);
    println!("blocks {} {:?}", blocks.len(), t0.elapsed());
    let cubes: Vec<Vec<CubeMap>> = blocks.iter().map(|b| b.iter().map(|&i| { let t = atlas.texels[i as usize].texel; let n = Vec3::from(t.normal); CubeMap { center: Vec3::from(t.position) + n * diag * 1e-4, normal: n } }).collect()).collect();
    let (maps, stats) = encode_cube_maps(&bvh, &cubes, side, Quantizer::with_far(diag * 1.001), &|_| ()).unwrap();
    let un = atlas.texels.len() * 6 * side * side * 2;
    let dir = maps.directory.len() * 4; let bl = maps.blocks.len() * 4;
    let cst = maps.directory.iter().filter(|d| **d >> 31 == 1).count();
    println!("{stats:?} uncompressed {un} dir {dir} blocks {bl} const {cst}/{} ratio {:.1} time {:?}", maps.directory.len(), un as f64 / (dir + bl) as f64, t0.elapsed());
}
