//! Writes the project's own assets anew: `cargo run --example make_assets`.

use std::path::Path;
use std::process::ExitCode;

use bevy_bounce_examples::{Error, error, glb};

fn main() -> ExitCode {
    error::exit("make_assets", || {
        let package = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
        let path = Path::new(&package).join("../assets/cornell_box.glb");
        std::fs::write(&path, glb::cornell_box()).map_err(|error| Error::file(&path, error))
    })
}
