//! Baked visibility for a scene, from its file or made on the spot.

use std::path::Path;

use bevy_bounce_bake::{BakeSettings, Scene, Source, bake};
use bevy_bounce_cssm::CssmFile;

use crate::Error;

/// Reads `file`; without one, bakes `scene` with the default settings, which takes seconds to minutes.
pub fn load(file: Option<&Path>, scene: &Path) -> Result<CssmFile, Error> {
    match file {
        Some(file) => {
            let bytes = std::fs::read(file).map_err(|error| Error::file(file, format!("cannot be read: {error}")))?;
            CssmFile::from_bytes(&bytes).map_err(|error| Error::file(file, error.to_string()))
        }
        None => {
            let source = Source::open(scene).map_err(|error| Error::file(scene, error.to_string()))?;
            let baked = Scene::from_gltf(&source).and_then(|scene| bake(&scene, &BakeSettings::default(), &()));
            Ok(baked.map_err(|error| Error::file(scene, format!("cannot be baked: {error}")))?.0)
        }
    }
}
