//! Why a bake does not come about.

use std::path::Path;

use bevy_bounce_cssm::CssmError;

/// Why a bake does not come about: each says what, where and what to do about it.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum BakeError {
    /// A glTF file that cannot be read or makes no sense.
    #[error("{name}: {problem}")]
    Source {
        /// The file as it was given.
        name: String,
        /// What is wrong, where in it, and what to do about it.
        problem: String,
    },
    /// Texture coordinates or sizes that give no atlas.
    #[error("{0}")]
    Atlas(String),
    /// A setting out of its range.
    #[error("{0}")]
    Setting(String),
    /// A baked file that cannot be read.
    #[error("{path}: {error}")]
    Cssm {
        /// The file as it was given.
        path: String,
        /// What is wrong with it.
        error: CssmError,
    },
    /// More than the format holds.
    #[error("the bake {0}")]
    Format(#[from] CssmError),
    /// A file that cannot be written or read.
    #[error("{path}: {error}; {remedy}")]
    Io {
        /// The file as it was given.
        path: String,
        /// What the system said.
        error: std::io::Error,
        /// What to do about it.
        remedy: &'static str,
    },
}

impl BakeError {
    pub(crate) fn source(name: &str, problem: String) -> Self {
        Self::Source { name: name.to_owned(), problem }
    }

    pub(crate) fn io(path: &Path, error: std::io::Error, remedy: &'static str) -> Self {
        Self::Io { path: path.display().to_string(), error, remedy }
    }
}
