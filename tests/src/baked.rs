//! Small bakes, made once a test binary, and their words as the GPU takes them.

use std::sync::LazyLock;

use bevy::math::{Affine3A, Quat, Vec3};
use bevy_bounce::cssm::top::with_top;
use bevy_bounce::cssm::tree::Tree;
use bevy_bounce::cssm::words::{PAGES, Words};
use bevy_bounce_bake::scene::Part;
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::CssmFile;
use bevy_bounce_examples::scenes::{Block, CornellBox};

use crate::gpu::{Gpu, Resources};
use crate::scene::cuboid;

/// The project's own Cornell box.
pub fn cornell_box() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| baked(&scene("cornell_box.glb"), 64, 32));
    &FILE
}

/// The same with few texels: one thread on a software adapter may visit them all.
pub fn small_cornell_box() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| baked(&scene("cornell_box.glb"), 24, 16));
    &FILE
}

/// The Cornell box without its short block, and that block by itself, in the space of its node; with atlases of those sizes.
pub fn cornell_box_in_two(atlases: [u32; 2]) -> [CssmFile; 2] {
    let whole = scene("cornell_box.glb");
    let is_block = |part: &Part| part.name.contains(CornellBox::BLOCKS[1].name);
    let [mut room, mut block] = [whole.clone(), whole];
    room.parts.retain(|part| !is_block(part));
    block.parts.retain(is_block);
    let Block { base, half_turn: [sine, cosine], .. } = CornellBox::BLOCKS[1];
    let back = Quat::from_xyzw(0.0, sine, 0.0, cosine).inverse();
    for part in &mut block.parts {
        for position in &mut part.positions {
            *position = (back * (Vec3::from(position.to_array()) - base)).to_array().into();
        }
        for normal in part.normals.iter_mut().flatten() {
            *normal = (back * Vec3::from(normal.to_array())).to_array().into();
        }
    }
    [baked(&room, atlases[0], 32), baked(&block, atlases[1], 32)]
}

/// A block of half a metre a side about the origin, with few texels.
pub fn small_block() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| {
        let corners = cuboid(Vec3::splat(-0.25), Vec3::splat(0.25));
        let indices = (0..12).map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner)).collect();
        let positions = corners.as_flattened().iter().map(|p| p.to_array().into()).collect();
        let block = Scene::from_mesh("block", positions, indices).unwrap_or_else(|error| panic!("{error}"));
        baked(&block, 16, 16)
    });
    &FILE
}

/// The balls in the box, with their lamp.
pub fn glossy_box() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| baked(&scene("glossy_box.glb"), 112, 32));
    &FILE
}

fn scene(name: &str) -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets").join(name);
    let source = Source::open(&path).unwrap_or_else(|error| panic!("{error}"));
    Scene::from_gltf(&source).unwrap_or_else(|error| panic!("{error}"))
}

fn baked(scene: &Scene, atlas: u32, depth: u32) -> CssmFile {
    let settings = BakeSettings { atlas, depth, ..BakeSettings::default() };
    bake(scene, &settings, &()).unwrap_or_else(|error| panic!("{error}")).0
}

/// The smallest page of which there are enough for the file.
pub fn smallest_page_bits(file: &CssmFile) -> u32 {
    let blocks = file.maps.blocks.len() + file.csm.blocks.len();
    (0..32).find(|bits| blocks <= PAGES << bits).expect("a file is smaller than that")
}

/// Binds objects, each with where it stands, under the names of the shaders; blocks in pages of that many words, as a power of
/// two.
pub fn resources(gpu: &Gpu, objects: &[(&CssmFile, Affine3A)], page_bits: u32) -> Resources {
    let trees: Vec<Tree> = objects.iter().map(|(file, _)| Tree::build(file)).collect();
    let mut words = Words::new(page_bits);
    for ((file, world_from_object), tree) in objects.iter().zip(&trees) {
        let added = words.bake(file, tree).and_then(|bake| words.object(bake, *world_from_object));
        added.unwrap_or_else(|error| panic!("{error:?}"));
    }
    Resources::new(gpu)
        .uniform("bakes", &with_top(words.table))
        .words("texels", &words.texels.all().concat())
        .words("directory", &words.directory.all().concat())
        .words("blocks_a", &words.page(0).concat())
        .words("blocks_b", &words.page(1).concat())
        .words("blocks_c", &words.page(2).concat())
        .words("tree", &words.trees.all().concat())
}
