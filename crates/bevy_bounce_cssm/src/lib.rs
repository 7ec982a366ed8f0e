//! Coherent surface shadow maps: visibility between all points of a rigid object's surface, baked once.
//!
//! At each texel of an object's atlas stands a depth cube map. Its value along a ray is any depth strictly between the
//! first and the second surface, so that whatever stands on the first is visible and whatever stands on the second is not;
//! that freedom makes neighbouring maps nearly alike, and they compress by one or two orders of magnitude without loss
//! (Ritschel, Grosch, Kautz and Seidel, *Interactive Global Illumination Based on Coherent Surface Shadow Maps*, 2008).
//!
//! This crate is the file, its codec and the visibility query on the CPU. `bevy_bounce_bake` writes the files.
//!
//! ```no_run
//! use bevy_bounce_cssm::CssmFile;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let file = CssmFile::from_bytes(&std::fs::read("room.cssm")?)?;
//! if let Some(texel) = file.texel_at([17, 4]).and_then(|index| file.texel(index)) {
//!     println!("{}", file.visible(&texel, [0.0, 1.0, 0.0]));
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # The file
//!
//! A [container] of sections, each an array of 32-bit words that a GPU buffer takes as it is:
//!
//! | section | what it holds |
//! |---|---|
//! | meta | [`Meta`]: sizes, units, bounds |
//! | texels | [`Texel`]: ten words a texel, in the order of the traversal |
//! | cells | the texel of each cell of the atlas, row by row |
//! | parts, corners | [`Parts`]: atlas coordinates of the glTF file's triangles |
//! | directory | a word for each block of texels and group of pixels |
//! | blocks | [the blocks](block) that need more than that word |
//! | csm directory, csm blocks | the same for the [maps from outside](csm) |
//!
//! # A query
//!
//! ```text
//! texel --record--> slot = block * 64 + lane
//! point - centre --cube--> face, pixel --> group, row
//! directory[block * groups + face * side * side / 32 + group] --> a code, or the first word of a block
//! block: row's entry --> palette index, or record --> bit planes at the lane --> palette index --> code
//! visible if depth <= code * quantum; code 65535 is no surface at all
//! ```
//!
//! Two reads, slot and directory, where the whole block has one code; otherwise also the head, the row's entry, the ends of
//! its runs or a bit of each plane, an index and the code. No block lies across a multiple of 128 MiB, so
//! that the section can be bound in pieces.
//!
//! # Features
//!
//! `bevy` (default): `CssmAsset`, its loader and its plugin.

#[cfg(feature = "bevy")]
mod asset;
mod bits;
pub mod block;
pub mod container;
pub mod csm;
pub mod cube;
mod error;
mod file;
mod interval;
mod maps;
mod meta;
pub mod octahedral;
mod parts;
mod query;
mod runs;
mod texel;

#[cfg(feature = "bevy")]
pub use asset::{CssmAsset, CssmLoader, CssmLoaderError, CssmPlugin};
pub use error::CssmError;
pub use file::{CssmFile, NO_TEXEL};
pub use interval::{Interval, MAX_FINITE, OpenEnd, Quantizer, UNBOUNDED};
pub use maps::{Maps, MapsBuilder, PAGE_WORDS};
pub use meta::{META_WORDS, Meta};
pub use parts::{NO_CORNER, PART_WORDS, Part, Parts};
pub use query::Filter;
pub use texel::{TEXEL_WORDS, Texel};
