//! What can be wrong with a file.

/// What is wrong with a baked file: the part, and what to do about it.
#[derive(thiserror::Error, Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CssmError {
    /// Not this kind of file.
    #[error("is no CSSM file: it does not start with its magic number; give a file that `bounce-bake bake` wrote")]
    Magic,
    /// From a newer program.
    #[error(
        "has version {found} of the format, and version {known} is understood; bake it anew, or update bevy_bounce"
    )]
    Version {
        /// Of the file.
        found: u32,
        /// The newest that can be read.
        known: u32,
    },
    /// Too short, or longer than it says.
    #[error("is damaged: {found} bytes are there and its header says {expected}; copy it again or bake it anew")]
    Length {
        /// In bytes.
        found: u64,
        /// By the header, in bytes.
        expected: u64,
    },
    /// Some byte is not what was written.
    #[error("is damaged: its checksum is {found:08x} and should be {expected:08x}; copy it again or bake it anew")]
    Checksum {
        /// Of the bytes that are there.
        found: u32,
        /// By the header.
        expected: u32,
    },
    /// A part that makes no sense.
    #[error("is damaged in its section `{section}`: {problem}; bake it anew")]
    Section {
        /// Name of the section.
        section: &'static str,
        /// What is wrong in it.
        problem: String,
    },
    /// A part is too large for the format.
    #[error("{section} would take {size} words, and the format holds {limit}; bake with a smaller --atlas or --depth")]
    TooLarge {
        /// Name of the section.
        section: &'static str,
        /// In 32-bit words.
        size: u64,
        /// In 32-bit words.
        limit: u64,
    },
}

impl CssmError {
    pub(crate) fn section(section: &'static str, problem: impl Into<String>) -> Self {
        Self::Section { section, problem: problem.into() }
    }
}
