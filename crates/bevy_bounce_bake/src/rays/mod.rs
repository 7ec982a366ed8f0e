//! Rays: every depth cube map is cast in packets of 8 by 8 pixels that share an origin, exact at each pixel's centre.

mod bvh;
mod layers;
mod packet;

pub use bvh::{Bvh, Hit};
pub use layers::{FlatTriangle, Layers, PACKET, Plane};
pub use packet::{Beam, CubeTile, OrthoTile, cast};
