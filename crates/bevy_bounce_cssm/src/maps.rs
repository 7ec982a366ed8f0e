//! Blocks and the directory that finds them.

use crate::CssmError;
use crate::block::{BlockCode, check, decode};

/// A directory word with this bit holds the block's only code, one without it the block's first word.
const CONSTANT: u32 = 1 << 31;
/// Words a binding may hold by WebGPU's default limit of 128 MiB. No block lies across a multiple of it.
pub const PAGE_WORDS: usize = 1 << 25;

/// Encoded maps of a kind: for each block of 64 lanes, all groups of 32 pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Maps {
    /// For each block, for each group: the first word in `blocks`, or bit 31 and the only code.
    pub directory: Vec<u32>,
    /// Words of the blocks.
    pub blocks: Vec<u32>,
}

impl Maps {
    /// The code of a lane and pixel; nothing outside the maps.
    pub fn code(&self, directory_index: usize, row: usize, lane: usize) -> Option<u16> {
        let entry = *self.directory.get(directory_index)?;
        if entry & CONSTANT != 0 {
            return Some(entry as u16);
        }
        decode(self.blocks.get(entry as usize..)?, row, lane)
    }

    /// Whether every entry of the directory leads to a block that is in order.
    pub(crate) fn check(&self, section: &'static str) -> Result<(), CssmError> {
        for (index, &entry) in self.directory.iter().enumerate() {
            let words = self.blocks.get(entry as usize..);
            let page = |word: usize| word / PAGE_WORDS;
            let fine = match entry & CONSTANT {
                0 => words.and_then(check).is_some_and(|size| page(entry as usize) == page(entry as usize + size - 1)),
                _ => entry & !CONSTANT <= u32::from(u16::MAX),
            };
            if !fine {
                return Err(CssmError::section(section, format!("entry {index} leads to no block")));
            }
        }
        Ok(())
    }
}

/// Puts encoded blocks together.
#[derive(Default)]
pub struct MapsBuilder {
    maps: Maps,
}

impl MapsBuilder {
    /// Appends blocks that were encoded one after the other into `words`.
    pub fn push(&mut self, codes: &[BlockCode], mut words: &[u32]) -> Result<(), CssmError> {
        for code in codes {
            let entry = match *code {
                BlockCode::Constant(code) => CONSTANT | u32::from(code),
                BlockCode::Words(size) => {
                    let blocks = &mut self.maps.blocks;
                    if blocks.len() / PAGE_WORDS != (blocks.len() + size - 1) / PAGE_WORDS {
                        blocks.resize(blocks.len().next_multiple_of(PAGE_WORDS), 0);
                    }
                    let at = blocks.len();
                    if at + size > CONSTANT as usize {
                        let (size, limit) = ((at + size) as u64, u64::from(CONSTANT));
                        return Err(CssmError::TooLarge { section: "blocks", size, limit });
                    }
                    let (block, rest) = words.split_at(size);
                    blocks.extend_from_slice(block);
                    words = rest;
                    at as u32
                }
            };
            self.maps.directory.push(entry);
        }
        if self.maps.directory.len() > PAGE_WORDS {
            let (size, limit) = (self.maps.directory.len() as u64, PAGE_WORDS as u64);
            return Err(CssmError::TooLarge { section: "directory", size, limit });
        }
        Ok(())
    }

    /// All that was pushed.
    pub fn finish(self) -> Maps {
        self.maps
    }
}
