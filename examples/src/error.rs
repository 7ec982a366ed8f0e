//! One line per failure.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Why a run ended early.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum Error {
    /// The help or version text, or what is wrong with the command line.
    #[error("{0}")]
    CommandLine(clap::Error),
    /// A value that makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A file that cannot be read, understood or written.
    #[error("{}: {problem}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What is wrong, where in it, and what to do about it.
        problem: String,
    },
    /// No graphics adapter, or one below the limits.
    #[error("{0}")]
    Adapter(String),
    /// No display to open a window on.
    #[error("no display to open a window on: give --output FILE.png to render without one")]
    NoDisplay,
    /// The renderer stopped.
    #[error("{0}")]
    Render(String),
}

impl Error {
    /// A problem with a file.
    pub fn file(path: impl AsRef<Path>, problem: impl ToString) -> Self {
        Self::File { path: path.as_ref().to_owned(), problem: problem.to_string() }
    }

    /// 2 for bad input and machines that cannot run this, 1 for a failure while rendering.
    pub fn status(&self) -> u8 {
        match self {
            Error::Render(_) => 1,
            _ => 2,
        }
    }
}

/// Runs `body`, prints its error as one line on stderr and turns it into the exit status.
pub fn exit(name: &str, body: impl FnOnce() -> Result<(), Error>) -> ExitCode {
    match body() {
        Ok(()) => ExitCode::SUCCESS,
        Err(Error::CommandLine(error)) if !error.use_stderr() => {
            // A reader that closes its end early is no error.
            drop(error.print());
            ExitCode::SUCCESS
        }
        Err(error) => {
            let message = error.to_string();
            let line = message.lines().next().unwrap_or_default();
            eprintln!("{name}: {}", line.strip_prefix("error: ").unwrap_or(line));
            ExitCode::from(error.status())
        }
    }
}
