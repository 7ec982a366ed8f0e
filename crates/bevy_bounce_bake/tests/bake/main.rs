//! The baker as its users meet it.

mod command;
mod lossless;
#[cfg(feature = "processor")]
mod processor;
mod scenes;
mod visibility;
