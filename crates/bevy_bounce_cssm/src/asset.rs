//! Baked files as assets.

use bevy_app::{App, Plugin};
use bevy_asset::io::Reader;
use bevy_asset::{Asset, AssetApp, AssetLoader, LoadContext};
use bevy_reflect::TypePath;

use crate::{CssmError, CssmFile};

/// Baked visibility of a rigid object.
#[derive(Asset, TypePath, Clone, Debug, PartialEq)]
pub struct CssmAsset {
    /// What the file holds.
    pub file: CssmFile,
}

/// Loads [`CssmAsset`]s from `.cssm` files.
#[derive(Default, TypePath)]
pub struct CssmLoader;

/// Why a file was not loaded.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum CssmLoaderError {
    /// Its bytes could not be read.
    #[error("{path}: cannot be read: {error}")]
    Io {
        /// The asset.
        path: String,
        /// What the asset source said.
        error: std::io::Error,
    },
    /// Its bytes make no sense.
    #[error("{path}: {error}")]
    Format {
        /// The asset.
        path: String,
        /// What is wrong with them.
        error: CssmError,
    },
}

impl AssetLoader for CssmLoader {
    type Asset = CssmAsset;
    type Settings = ();
    type Error = CssmLoaderError;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _: &(),
        load_context: &mut LoadContext<'_>,
    ) -> Result<CssmAsset, CssmLoaderError> {
        let path = load_context.path().to_string();
        let mut bytes = Vec::new();
        let read = reader.read_to_end(&mut bytes).await;
        read.map_err(|error| CssmLoaderError::Io { path: path.clone(), error })?;
        let file = CssmFile::from_bytes(&bytes).map_err(|error| CssmLoaderError::Format { path, error })?;
        Ok(CssmAsset { file })
    }

    fn extensions(&self) -> &[&str] {
        &["cssm"]
    }
}

/// Makes [`CssmAsset`]s loadable.
pub struct CssmPlugin;

impl Plugin for CssmPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<CssmAsset>().init_asset_loader::<CssmLoader>();
    }
}
