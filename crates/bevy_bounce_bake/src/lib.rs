//! Bakes coherent surface shadow maps, the files of [`bevy_bounce_cssm`], and [lightmaps](lightmap) for plain Bevy.
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
//! | triangles, colours and holes of a glTF file | [`scene`] |
//! | which place of the surface each texel is | [`atlas`] |
//! | the order in which texels are swept, in blocks of 64 | [`traversal`] |
//! | the first two surfaces along each ray, block by block | [`rays`], [`cube_maps`] |
//! | the fewest runs, and their codes | [`bevy_bounce_cssm::block`] |
//! | the object seen from outside | [`outside`] |
//! | decoded visibility against exact rays | [`verify`](mod@verify) |
//! | instead of maps: light, as textures that Bevy reads | [`lightmap`] |
//!
//! Blocks do not depend on each other: each is cast and encoded by one thread, and only their words are kept. The memory
//! is that of the result and of a few megabytes a thread, and the bytes do not depend on the number of threads.
//!
//! # Measured
//!
//! `bounce-bake bake SCENE.glb -o OUT.cssm --atlas N --depth 64`, release build, on two cores that other programs used too:
//! hence the processor's seconds, over both cores, beside those on the clock. The ratio is to 16 bits a pixel.
//!
//! | scene | atlas | depth maps | at 16 bits | ratio | seconds | processor | peak memory |
//! |---|---|---|---|---|---|---|---|
//! | Cornell box, 34 triangles | 64 | 2,417 | 119 MB | 51.6 | 6.1 | 3.0 | 18 MB |
//! | | 128 | 10,332 | 508 MB | 89.9 | 13.8 | 9.1 | 28 MB |
//! | | 256 | 44,629 | 2.2 GB | 151.4 | 47.7 | 35.7 | 51 MB |
//! | | 512 | 182,664 | 9.0 GB | 228.3 | 137.8 | 108.1 | 124 MB |
//! | a corner with spheres, 2,338 triangles | 64 | 2,269 | 112 MB | 48.3 | 7.0 | 4.6 | 19 MB |
//! | | 128 | 9,907 | 487 MB | 93.8 | 18.4 | 14.2 | 27 MB |
//! | | 256 | 42,383 | 2.1 GB | 162.6 | 76.7 | 49.6 | 50 MB |
//! | Khronos' Lantern, 5,394 triangles | 64 | 854 | 42 MB | 21.9 | 5.2 | 3.5 | 24 MB |
//! | | 128 | 8,424 | 414 MB | 47.1 | 14.0 | 12.9 | 40 MB |
//! | | 256 | 46,943 | 2.3 GB | 82.1 | 110.0 | 63.1 | 87 MB |
//! | | 512 | 216,453 | 10.6 GB | 139.0 | 437.8 | 219.3 | 209 MB |
//!
//! The paper has 15.9, 24.4, 33.4 and 41.5 for its Cornell box at these sizes, in 43 s, 3, 13 and 55 minutes. Scenes of many
//! small charts compress less: an office of 33,225 triangles and 17,364 charts, one of its two materials double-sided, 5.5
//! with an atlas of 256 and depth 32.
//!
//! # Features
//!
//! `processor` (default): baking as a step of Bevy's asset processor. Without it nothing of Bevy is compiled:
//! `cargo install --path crates/bevy_bounce_bake --no-default-features`.

pub mod atlas;
mod bake;
pub mod cube_maps;
mod error;
pub mod lightmap;
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
pub use lightmap::{LightmapFiles, LightmapReport, LightmapSettings, bake_lightmap};
pub use output::write_atomically;
pub use progress::{Progress, Step};
pub use report::Report;
pub use scene::{Scene, Source};
pub use traversal::Strategy;
pub use verify::verify;
