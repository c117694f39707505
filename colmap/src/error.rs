//! The error of this crate.

use eagpt_scene::SceneError;
use std::path::{Path, PathBuf};

/// Result with [`ColmapError`].
pub type Result<T, E = ColmapError> = std::result::Result<T, E>;

/// Why a model could not be read, aligned, imported or made. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum ColmapError {
    /// A binary file is wrong.
    #[error("{}: byte {offset}: {problem}", path.display())]
    Binary {
        /// The file.
        path: PathBuf,
        /// Where the reader stood, bytes from the start.
        offset: u64,
        /// The problem, with the value.
        problem: String,
    },
    /// A text file is wrong.
    #[error("{}: line {line}: {problem}", path.display())]
    Text {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: u64,
        /// The problem, with the value.
        problem: String,
    },
    /// A model as a whole, or a folder of images, is not what the job needs.
    #[error("{}: {problem}", path.display())]
    Invalid {
        /// The file or folder.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// No floor, or none of sufficient confidence.
    #[error("alignment: {0}")]
    Align(String),
    /// An option is out of its range or does not go with another one.
    #[error("{option}: {problem}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The problem, with the value.
        problem: String,
    },
    /// The program `colmap` could not be run or did not do its work.
    #[error("colmap: {0}")]
    Program(String),
    /// An error of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl ColmapError {
    /// A [`ColmapError::Invalid`] for `path`.
    pub fn invalid(path: &Path, problem: impl Into<String>) -> Self {
        Self::Invalid {
            path: path.to_owned(),
            problem: problem.into(),
        }
    }

    /// A [`ColmapError::Option`].
    pub fn option(option: &'static str, problem: impl Into<String>) -> Self {
        Self::Option {
            option,
            problem: problem.into(),
        }
    }
}
