//! Writes the project's own assets anew: `cargo run --example make_assets`.

use std::path::Path;
use std::process::ExitCode;

use bevy_bounce_examples::{Error, error, glb};

fn main() -> ExitCode {
    error::exit("make_assets", || {
        let package = std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_else(|| env!("CARGO_MANIFEST_DIR").into());
        for (name, bytes) in [("cornell_box.glb", glb::cornell_box()), ("glossy_box.glb", glb::glossy_box())] {
            let path = Path::new(&package).join("../assets").join(name);
            std::fs::write(&path, bytes).map_err(|error| Error::file(&path, error))?;
        }
        Ok(())
    })
}
