//! Bakes coherent surface shadow maps.
pub mod atlas;
pub mod cube_maps;
mod error;
pub mod rays;
pub mod scene;
pub mod traversal;
pub use error::BakeError;
