//! The baker as its users meet it.

mod command;
mod lossless;
mod materials;
#[cfg(feature = "processor")]
mod processor;
mod progress;
mod scenes;
mod visibility;
