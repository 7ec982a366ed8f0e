//! Coherent surface shadow maps.
mod bits;
pub mod block;
pub mod container;
mod error;
mod interval;
mod maps;
pub mod octahedral;
mod runs;
mod texel;
pub use error::*;
pub use interval::*;
pub use maps::*;
pub use texel::*;
