//! Bakes coherent surface shadow maps, the files of [`bevy_bounce_cssm`].
//!
//! Three ways to the same bytes: the `bounce-bake` command, the asset processor of the `processor` feature, and [`bake()`].
//!
//! ```no_run
//! use bevy_bounce_bake::{BakeSettings, Source, Scene, bake};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = Scene::from_gltf(&Source::open("room.glb".as_ref())?)?;
//! let (file, report) = bake(&scene, &BakeSettings::default(), &())?;
//! std::fs::write("room.cssm", file.to_bytes())?;
//! println!("{} maps, {:.1} to 1", report.depth_maps, report.ratio);
//! # Ok(())
//! # }
//! ```
//!
//! # Steps
//!
//! | step | module |
//! |---|---|
//! | triangles and colours of a glTF file | [`scene`] |
//! | which place of the surface each texel is | [`atlas`] |
//! | the order in which texels are swept, in blocks of 64 | [`traversal`] |
//! | the first two surfaces along each ray, block by block | [`rays`], [`cube_maps`] |
//! | the fewest runs, and their codes | [`bevy_bounce_cssm::block`] |
//! | the object seen from outside | [`outside`] |
//! | decoded visibility against exact rays | [`verify`](mod@verify) |
//!
//! Blocks do not depend on each other: each is cast and encoded by one thread, and only their words are kept. The memory
//! is that of the result and of a few megabytes a thread, and the bytes do not depend on the number of threads.
//!
//! # Features
//!
//! `processor` (default): baking as a step of Bevy's asset processor. Without it nothing of Bevy is compiled:
//! `cargo install bevy_bounce_bake --no-default-features`.

pub mod atlas;
mod bake;
pub mod cube_maps;
mod error;
mod output;
pub mod outside;
#[cfg(feature = "processor")]
pub mod processor;
mod progress;
pub mod rays;
mod report;
pub mod scene;
pub mod traversal;
pub mod verify;

pub use bake::{BAKER_VERSION, BakeSettings, bake};
pub use error::BakeError;
pub use output::write_atomically;
pub use progress::{Progress, Step};
pub use report::Report;
pub use scene::{Scene, Source};
pub use traversal::Strategy;
pub use verify::verify;
