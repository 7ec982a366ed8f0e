//! Small bakes, made once a test binary, and their words as the GPU takes them.

use std::sync::LazyLock;

use bevy::math::Affine3A;
use bevy_bounce::cssm::words::{self, PAGES};
use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::CssmFile;

use crate::gpu::{Gpu, Resources};

/// The project's own Cornell box.
pub fn cornell_box() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| baked_cornell_box(64, 32));
    &FILE
}

/// The same with few texels: one thread on a software adapter may visit them all.
pub fn small_cornell_box() -> &'static CssmFile {
    static FILE: LazyLock<CssmFile> = LazyLock::new(|| baked_cornell_box(24, 16));
    &FILE
}

fn baked_cornell_box(atlas: u32, depth: u32) -> CssmFile {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/cornell_box.glb");
    let source = Source::open(&path).unwrap_or_else(|error| panic!("{error}"));
    let scene = Scene::from_gltf(&source).unwrap_or_else(|error| panic!("{error}"));
    let settings = BakeSettings { atlas, depth, ..BakeSettings::default() };
    bake(&scene, &settings, &()).unwrap_or_else(|error| panic!("{error}")).0
}

/// The smallest page of which there are enough for the file.
pub fn smallest_page_bits(file: &CssmFile) -> u32 {
    let blocks = file.maps.blocks.len() + file.csm.blocks.len();
    (0..32).find(|bits| blocks <= PAGES << bits).expect("a file is smaller than that")
}

/// Binds a bake under the names of the shaders, its blocks in pages of that many words, as a power of two.
pub fn resources(gpu: &Gpu, file: &CssmFile, world_from_object: Affine3A, page_bits: u32) -> Resources {
    let blocks = |index: usize| words::page(file, index, page_bits).concat();
    Resources::new(gpu)
        .words("texels", &file.texels)
        .uniform("bake", &words::parameters(file, world_from_object, page_bits))
        .words("directory", &words::directory(file).concat())
        .words("blocks_a", &blocks(0))
        .words("blocks_b", &blocks(1))
        .words("blocks_c", &blocks(2))
}
