//! The whole file.

use crate::block::LANES;
use crate::container::{self, Container, SectionId};
use crate::{CssmError, Maps, Meta, Parts, Quantizer, TEXEL_WORDS, Texel};

/// A cell of the atlas that shows no surface.
pub const NO_TEXEL: u32 = u32::MAX;

/// Baked visibility of a rigid object. All arrays are as the file has them and as a GPU buffer takes them.
#[derive(Clone, Debug, PartialEq)]
pub struct CssmFile {
    /// Sizes and units.
    pub meta: Meta,
    /// Records of [`TEXEL_WORDS`] words, in the order of the traversal.
    pub texels: Vec<u32>,
    /// Row by row, the texel of each cell of the atlas, or [`NO_TEXEL`].
    pub cells: Vec<u32>,
    /// Atlas coordinates of the source's triangles.
    pub parts: Parts,
    /// Cube maps.
    pub maps: Maps,
    /// Maps from outside.
    pub csm: Maps,
}

impl CssmFile {
    /// Reads a file and checks every number in it that something relies on.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, CssmError> {
        let container = Container::open(bytes)?;
        let section =
            |id: SectionId| container.section(id)?.ok_or_else(|| CssmError::section(id.name(), "it is missing"));
        let file = Self {
            meta: Meta::from_words(&section(SectionId::Meta)?)?,
            texels: section(SectionId::Texels)?,
            cells: section(SectionId::Cells)?,
            parts: Parts { records: section(SectionId::Parts)?, corners: section(SectionId::Corners)? },
            maps: Maps { directory: section(SectionId::Directory)?, blocks: section(SectionId::Blocks)? },
            csm: Maps { directory: section(SectionId::CsmDirectory)?, blocks: section(SectionId::CsmBlocks)? },
        };
        file.check()?;
        Ok(file)
    }

    /// The file's bytes, always the same for the same content.
    pub fn to_bytes(&self) -> Vec<u8> {
        let meta = self.meta.to_words();
        container::write(&[
            (SectionId::Meta, &meta),
            (SectionId::Texels, &self.texels),
            (SectionId::Cells, &self.cells),
            (SectionId::Parts, &self.parts.records),
            (SectionId::Corners, &self.parts.corners),
            (SectionId::Directory, &self.maps.directory),
            (SectionId::Blocks, &self.maps.blocks),
            (SectionId::CsmDirectory, &self.csm.directory),
            (SectionId::CsmBlocks, &self.csm.blocks),
        ])
    }

    /// The texel with this number.
    pub fn texel(&self, index: usize) -> Option<Texel> {
        let start = index.checked_mul(TEXEL_WORDS)?;
        self.texels.get(start..start + TEXEL_WORDS)?.try_into().ok().map(Texel::from_words)
    }

    /// Number of the texel at a cell of the atlas, where there is one.
    pub fn texel_at(&self, [column, row]: [u32; 2]) -> Option<usize> {
        let [width, _] = self.meta.atlas;
        let index = (column < width).then(|| row as usize * width as usize + column as usize)?;
        self.cells.get(index).filter(|&&texel| texel != NO_TEXEL).map(|&texel| texel as usize)
    }

    /// What turns codes of the cube maps into depths.
    pub fn quantizer(&self) -> Quantizer {
        Quantizer::new(self.meta.quantum)
    }

    /// Bytes of what stands for the cube maps: directory, blocks, and the slot in each texel's record.
    pub fn compressed_bytes(&self) -> u64 {
        4 * (self.maps.directory.len() + self.maps.blocks.len() + self.meta.texels as usize) as u64
    }

    /// Bytes of the cube maps at two bytes a pixel.
    pub fn uncompressed_bytes(&self) -> u64 {
        2 * 6 * u64::from(self.meta.depth) * u64::from(self.meta.depth) * u64::from(self.meta.texels)
    }

    fn check(&self) -> Result<(), CssmError> {
        let meta = &self.meta;
        let size = |id: SectionId, words: usize, expected: u64| match words as u64 == expected {
            true => Ok(()),
            false => Err(CssmError::section(id.name(), format!("it has {words} words instead of {expected}"))),
        };
        let (csm_blocks, csm_groups) = meta.csm_shape();
        size(SectionId::Texels, self.texels.len(), u64::from(meta.texels) * TEXEL_WORDS as u64)?;
        size(SectionId::Cells, self.cells.len(), u64::from(meta.atlas[0]) * u64::from(meta.atlas[1]))?;
        size(SectionId::Directory, self.maps.directory.len(), u64::from(meta.blocks) * meta.groups() as u64)?;
        size(SectionId::CsmDirectory, self.csm.directory.len(), (csm_blocks * csm_groups) as u64)?;
        self.check_texels()?;
        self.parts.check()?;
        self.maps.check(SectionId::Directory.name())?;
        self.csm.check(SectionId::CsmDirectory.name())
    }

    fn check_texels(&self) -> Result<(), CssmError> {
        let slots = u64::from(self.meta.blocks) * LANES as u64;
        for (index, words) in self.texels.as_chunks::<TEXEL_WORDS>().0.iter().enumerate() {
            let texel = Texel::from_words(words);
            let finite =
                texel.position.iter().chain(&texel.diffuse).chain([&texel.area]).all(|value| value.is_finite());
            let shows = texel.area > 0.0 && texel.diffuse.iter().all(|share| (0.0..=1.0).contains(share));
            let fits = u64::from(texel.slot) < slots && texel.chart < self.meta.charts;
            let what = match (finite && shows, fits && self.texel_at(texel.cell) == Some(index)) {
                (true, true) => continue,
                (false, _) => "has no area, or reflects less than nothing or more than all",
                (true, false) => "lies outside its maps, its charts or its cell",
            };
            return Err(CssmError::section("texels", format!("texel {index} {what}")));
        }
        let stray = self.cells.iter().position(|&texel| texel != NO_TEXEL && texel >= self.meta.texels);
        match stray {
            Some(cell) => Err(CssmError::section("cells", format!("cell {cell} shows a texel that is not there"))),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests;
