//! The container: header, section table, sections. All numbers are little-endian.
//!
//! ```text
//! header    0  magic            8 bytes
//!           8  version          u32
//!          12  section count    u32
//!          16  file length      u64   bytes
//!          24  checksum         u32   CRC-32 (IEEE) of the whole file with this field zero
//!          28  zero             u32
//! table    32  per section: id u32, version u32, offset u64 in bytes, length u64 in bytes
//! sections     each starts at a multiple of 16 bytes and holds 32-bit words
//! ```
//!
//! A reader skips sections whose id it does not know. A change that old readers must not overlook raises the version of the
//! file; one within a section raises that section's.

use crate::CssmError;

/// The first bytes of a file. The control characters show when a transfer treated it as text.
pub const MAGIC: [u8; 8] = *b"CSSM\r\n\x1a\n";
/// Version of the container and of the meaning of its sections.
pub const VERSION: u32 = 1;

const HEADER: usize = 32;
const TABLE_ENTRY: usize = 24;
const CHECKSUM_AT: usize = 24;
const ALIGNMENT: usize = 16;
/// More sections than any version has.
const MOST_SECTIONS: u32 = 64;

/// The sections of a file, by their ids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum SectionId {
    /// [`Meta`](crate::Meta).
    Meta = 1,
    /// Records of the texels.
    Texels = 2,
    /// Which texel each cell of the atlas is.
    Cells = 3,
    /// A word for each block of the cube maps.
    Directory = 4,
    /// Blocks of the cube maps.
    Blocks = 5,
    /// A word for each block of the maps from outside.
    CsmDirectory = 6,
    /// Blocks of the maps from outside.
    CsmBlocks = 7,
    /// Records of [`Parts`](crate::Parts).
    Parts = 8,
    /// Atlas coordinates of the parts' triangles.
    Corners = 9,
}

impl SectionId {
    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Meta => "meta",
            Self::Texels => "texels",
            Self::Cells => "cells",
            Self::Directory => "directory",
            Self::Blocks => "blocks",
            Self::CsmDirectory => "csm directory",
            Self::CsmBlocks => "csm blocks",
            Self::Parts => "parts",
            Self::Corners => "corners",
        }
    }

    /// The version that is written and understood.
    const fn version(self) -> u32 {
        1
    }
}

/// A whole file of these sections.
pub fn write(sections: &[(SectionId, &[u32])]) -> Vec<u8> {
    let aligned = |at: usize| at.next_multiple_of(ALIGNMENT);
    let mut at = aligned(HEADER + sections.len() * TABLE_ENTRY);
    let mut file = Vec::new();
    file.extend(MAGIC);
    file.extend(VERSION.to_le_bytes());
    file.extend((sections.len() as u32).to_le_bytes());
    file.resize(HEADER, 0);
    for (id, words) in sections {
        file.extend((*id as u32).to_le_bytes());
        file.extend(id.version().to_le_bytes());
        file.extend((at as u64).to_le_bytes());
        file.extend((words.len() as u64 * 4).to_le_bytes());
        at = aligned(at + words.len() * 4);
    }
    for (_, words) in sections {
        file.resize(aligned(file.len()), 0);
        file.reserve(words.len() * 4);
        words.iter().for_each(|word| file.extend(word.to_le_bytes()));
    }
    file.resize(at, 0);
    let length = file.len() as u64;
    file[16..24].copy_from_slice(&length.to_le_bytes());
    let checksum = crc32fast::hash(&file);
    file[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&checksum.to_le_bytes());
    file
}

/// A file whose header, checksum and section table are in order.
pub struct Container<'a> {
    bytes: &'a [u8],
    table: Vec<(u32, u32, std::ops::Range<usize>)>,
}

impl<'a> Container<'a> {
    /// Checks everything but what is in the sections.
    pub fn open(bytes: &'a [u8]) -> Result<Self, CssmError> {
        if !bytes.starts_with(&MAGIC) {
            return Err(CssmError::Magic);
        }
        let (version, count) = (u32_at(bytes, 8), u32_at(bytes, 12));
        match version {
            Some(VERSION) | None => (),
            Some(found) => return Err(CssmError::Version { found, known: VERSION }),
        }
        let expected = u64_at(bytes, 16).unwrap_or(HEADER as u64);
        let found = bytes.len() as u64;
        if found < HEADER as u64 || found != expected {
            return Err(CssmError::Length { found, expected });
        }
        let expected = u32_at(bytes, CHECKSUM_AT).unwrap_or(0);
        let found = checksum(bytes);
        if found != expected {
            return Err(CssmError::Checksum { found, expected });
        }
        let count = count.filter(|&count| count <= MOST_SECTIONS);
        let count = count.ok_or_else(|| CssmError::section("table", "it has more sections than the format knows"))?;
        let table = (0..count as usize).map(|number| entry(bytes, number)).collect::<Result<_, _>>()?;
        Ok(Self { bytes, table })
    }

    /// The words of a section, or nothing if the file has none.
    pub fn section(&self, id: SectionId) -> Result<Option<Vec<u32>>, CssmError> {
        let Some((_, version, range)) = self.table.iter().find(|(other, ..)| *other == id as u32) else {
            return Ok(None);
        };
        if *version != id.version() {
            let problem = format!("it has version {version}, and version {} is understood", id.version());
            return Err(CssmError::section(id.name(), problem));
        }
        let words = self.bytes[range.clone()].as_chunks().0;
        Ok(Some(words.iter().map(|word| u32::from_le_bytes(*word)).collect()))
    }
}

/// Checksum of a file, its own field taken as zero.
fn checksum(bytes: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&bytes[..CHECKSUM_AT]);
    hasher.update(&[0; 4]);
    hasher.update(&bytes[CHECKSUM_AT + 4..]);
    hasher.finalize()
}

fn entry(bytes: &[u8], number: usize) -> Result<(u32, u32, std::ops::Range<usize>), CssmError> {
    let wrong = |problem: &str| CssmError::section("table", format!("entry {number} {problem}"));
    let at = HEADER + number * TABLE_ENTRY;
    let fields = || Some((u32_at(bytes, at)?, u32_at(bytes, at + 4)?, u64_at(bytes, at + 8)?, u64_at(bytes, at + 16)?));
    let (id, version, offset, length) = fields().ok_or_else(|| wrong("is cut off"))?;
    let end = offset.checked_add(length).filter(|&end| end <= bytes.len() as u64);
    let end = end.ok_or_else(|| wrong("reaches past the end of the file"))?;
    if !offset.is_multiple_of(ALIGNMENT as u64) || !length.is_multiple_of(4) {
        return Err(wrong("is not aligned"));
    }
    Ok((id, version, offset as usize..end as usize))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..at + 4)?.try_into().ok().map(u32::from_le_bytes)
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..at + 8)?.try_into().ok().map(u64::from_le_bytes)
}

/// Puts the right checksum into a file that was changed, so that tests get past it.
#[cfg(test)]
pub fn reseal(bytes: &mut [u8]) {
    if bytes.len() >= HEADER {
        let checksum = checksum(bytes);
        bytes[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&checksum.to_le_bytes());
    }
}
