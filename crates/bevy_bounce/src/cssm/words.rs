//! Baked files as the GPU takes them: the files' own words, one file after the other, cut into pages that fit a binding.

use bevy::math::Affine3A;
use bevy::prelude::*;
use bevy_bounce_cssm::{CssmFile, Meta, TEXEL_WORDS};
use bevy_bounce_shaders::types::{CSSM_OBJECTS, CSSM_TOP_NODES, CssmBake, CssmBakes};

use super::tree::Tree;

/// Pages of blocks that a kernel binds: with what else it binds, eight storage buffers.
pub const PAGES: usize = 3;
/// Words of a page as a power of two: 128 MiB, the largest binding that every device allows.
pub const PAGE_BITS: u32 = 25;
/// Words of light that a texel has in the largest of its arrays: two nodes.
const LIGHT_WORDS: usize = 8;
/// Words in it of the tree over the objects.
const TOP_WORDS: usize = 4 * CSSM_TOP_NODES;

/// What does not fit the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLarge {
    /// Which part.
    pub section: &'static str,
    /// Words it has, with those of the bakes before.
    pub words: usize,
    /// Words there may be.
    pub limit: usize,
}

/// Words of the same kind of several bakes.
pub struct Pieces<'a> {
    pieces: Vec<&'a [u32]>,
    words: usize,
    section: &'static str,
    limit: usize,
}

impl<'a> Pieces<'a> {
    fn new(section: &'static str, limit: usize) -> Self {
        Self { pieces: Vec::new(), words: 0, section, limit }
    }

    fn check(&self, more: usize) -> Result<(), TooLarge> {
        let words = self.words + more;
        if words > self.limit { Err(TooLarge { section: self.section, words, limit: self.limit }) } else { Ok(()) }
    }

    /// Appends a piece and says where it begins.
    fn add(&mut self, piece: &'a [u32]) -> u32 {
        let start = self.words;
        self.pieces.push(piece);
        self.words += piece.len();
        start as u32
    }

    /// One after the other.
    pub fn all(&self) -> &[&'a [u32]] {
        &self.pieces
    }

    /// What of them lies in a range of words.
    fn range(&self, start: usize, end: usize) -> Vec<&'a [u32]> {
        let mut before = 0;
        let cut = |piece: &&'a [u32]| {
            let at = |word: usize| word.saturating_sub(before).min(piece.len());
            let part = &piece[at(start)..at(end)];
            before += piece.len();
            part
        };
        self.pieces.iter().map(cut).collect()
    }
}

/// The words of bakes, and the objects that have them.
pub struct Words<'a> {
    /// Records of texels.
    pub texels: Pieces<'a>,
    /// Of each bake, that of the cube maps, then that of the maps from outside.
    pub directory: Pieces<'a>,
    /// Of each bake, its nodes, then its leaves.
    pub trees: Pieces<'a>,
    /// The objects so far.
    pub table: CssmBakes,
    blocks: Pieces<'a>,
}

impl<'a> Words<'a> {
    /// None yet; pages have `2^page_bits` words.
    pub fn new(page_bits: u32) -> Self {
        let page = 1 << page_bits;
        Self {
            texels: Pieces::new("texels", page),
            directory: Pieces::new("directory", page),
            trees: Pieces::new("hierarchy", page),
            blocks: Pieces::new("blocks", PAGES * page),
            table: CssmBakes { page_bits, ..CssmBakes::default() },
        }
    }

    /// Appends a bake with its hierarchy, if it fits. What is returned makes [objects](Self::object) of it.
    pub fn bake(&mut self, file: &'a CssmFile, tree: &'a Tree) -> Result<CssmBake, TooLarge> {
        self.texels.check(file.texels.len())?;
        self.directory.check(file.maps.directory.len() + file.csm.directory.len())?;
        self.trees.check(4 * tree.words.len())?;
        self.blocks.check(file.maps.blocks.len() + file.csm.blocks.len())?;
        let Meta { bounds_min, bounds_max, csm_center, .. } = file.meta;
        Ok(CssmBake {
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
            levels: tree.levels(),
            reach: tree.reach,
            atlas_width: file.meta.atlas[0],
            atlas_height: file.meta.atlas[1],
            first_texel: self.texels.add(&file.texels) / TEXEL_WORDS as u32,
            first_node: self.trees.add(tree.words.as_flattened()) / 4,
            directory: self.directory.add(&file.maps.directory),
            csm_directory: self.directory.add(&file.csm.directory),
            blocks: self.blocks.add(&file.maps.blocks),
            csm_blocks: self.blocks.add(&file.csm.blocks),
            ..CssmBake::default()
        })
    }

    /// Appends an object of a bake, if there is room for its light.
    pub fn object(&mut self, bake: CssmBake, world_from_object: Affine3A) -> Result<(), TooLarge> {
        let lights = self.table.lights + bake.texel_count;
        let (words, limit) = (LIGHT_WORDS * lights as usize + TOP_WORDS, 1 << self.table.page_bits);
        if words > limit {
            return Err(TooLarge { section: "light", words, limit });
        }
        let (words, limit) = (self.table.count as usize + 1, CSSM_OBJECTS);
        let slot = self.table.objects.get_mut(self.table.count as usize);
        let slot = slot.ok_or(TooLarge { section: "objects", words, limit })?;
        *slot = placed(CssmBake { first_light: self.table.lights, ..bake }, world_from_object);
        self.table.lights = lights;
        self.table.count += 1;
        Ok(())
    }

    /// A page of blocks: of each bake, those of its cube maps, then those of its maps from outside.
    pub fn page(&self, index: usize) -> Vec<&'a [u32]> {
        let bits = self.table.page_bits;
        self.blocks.range(index << bits, (index + 1) << bits)
    }
}

fn rows(affine: Affine3A) -> [Vec4; 3] {
    let rows = affine.matrix3.transpose();
    std::array::from_fn(|i| Vec3::from(rows.col(i)).extend(affine.translation[i]))
}

/// The same object, standing elsewhere.
pub fn placed(bake: CssmBake, world_from_object: Affine3A) -> CssmBake {
    let [world_from_object_x, world_from_object_y, world_from_object_z] = rows(world_from_object);
    let [object_from_world_x, object_from_world_y, object_from_world_z] = rows(world_from_object.inverse());
    CssmBake {
        world_from_object_x,
        world_from_object_y,
        world_from_object_z,
        object_from_world_x,
        object_from_world_y,
        object_from_world_z,
        ..bake
    }
}
