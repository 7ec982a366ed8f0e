//! A baked file as the GPU takes it: the file's own words, cut into pages that fit a binding.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_bounce_cssm::{CssmFile, Meta};
use bevy_bounce_shaders::types::CssmBake;

/// Pages of blocks that a kernel binds: with what else it binds, eight storage buffers.
pub const PAGES: usize = 3;
/// Words of a page as a power of two: 128 MiB, the largest binding that every device allows.
pub const PAGE_BITS: u32 = 25;

/// What of a file does not fit the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge {
    /// Which part.
    pub section: &'static str,
    /// Words it has.
    pub words: usize,
    /// Words there may be.
    pub limit: usize,
}

/// Whether every part of a file fits its bindings of `2^page_bits` words.
pub fn check_size(file: &CssmFile, page_bits: u32) -> Result<(), TooLarge> {
    let page = 1 << page_bits;
    let parts = [
        ("texels", file.texels.len(), page),
        ("directory", file.maps.directory.len() + file.csm.directory.len(), page),
        ("blocks", file.maps.blocks.len() + file.csm.blocks.len(), PAGES * page),
    ];
    let too_large = parts.into_iter().find(|(_, words, limit)| words > limit);
    too_large.map_or(Ok(()), |(section, words, limit)| Err(TooLarge { section, words, limit }))
}

/// The pieces of the file that make up the directory: the cube maps', then that of the maps from outside.
pub fn directory(file: &CssmFile) -> [&[u32]; 2] {
    [&file.maps.directory, &file.csm.directory]
}

/// The pieces of the file that make up a page of blocks: of the cube maps', then of those of the maps from outside.
pub fn page(file: &CssmFile, index: usize, page_bits: u32) -> [&[u32]; 2] {
    let (start, end) = (index << page_bits, (index + 1) << page_bits);
    let cubes = file.maps.blocks.len();
    let cut = |words: &'_ [u32], before: usize| {
        let at = |word: usize| word.saturating_sub(before).min(words.len());
        at(start)..at(end)
    };
    [&file.maps.blocks[cut(&file.maps.blocks, 0)], &file.csm.blocks[cut(&file.csm.blocks, cubes)]]
}

/// How the words are read, and where the object stands.
pub fn parameters(file: &CssmFile, world_from_object: Affine3A, page_bits: u32) -> CssmBake {
    let Meta { bounds_min, bounds_max, csm_center, .. } = file.meta;
    let parameters = CssmBake {
        bounds_min: bounds_min.into(),
        texel_count: file.meta.texels,
        bounds_max: bounds_max.into(),
        depth: file.meta.depth,
        csm_center: csm_center.into(),
        csm_radius: file.meta.csm_radius,
        quantum: file.meta.quantum,
        lift: file.meta.lift,
        csm_quantum: file.meta.csm_quantum,
        csm_grid: file.meta.csm_grid,
        csm_side: file.meta.csm_side,
        csm_directory: file.maps.directory.len() as u32,
        csm_blocks: file.maps.blocks.len() as u32,
        page_bits,
        ..CssmBake::default()
    };
    placed(parameters, world_from_object)
}

fn rows(affine: Affine3A) -> [Vec4; 3] {
    let rows = affine.matrix3.transpose();
    std::array::from_fn(|i| Vec3::from(rows.col(i)).extend(affine.translation[i]))
}

/// The same parameters for an object that stands elsewhere.
pub fn placed(parameters: CssmBake, world_from_object: Affine3A) -> CssmBake {
    let [world_from_object_x, world_from_object_y, world_from_object_z] = rows(world_from_object);
    let [object_from_world_x, object_from_world_y, object_from_world_z] = rows(world_from_object.inverse());
    CssmBake {
        world_from_object_x,
        world_from_object_y,
        world_from_object_z,
        object_from_world_x,
        object_from_world_y,
        object_from_world_z,
        ..parameters
    }
}
