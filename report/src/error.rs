//! The error of this crate.

use eagpt_scene::SceneError;
use std::path::{Path, PathBuf};

/// Result with [`ReportError`].
pub type Result<T, E = ReportError> = std::result::Result<T, E>;

/// Why there is no report. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A file is not what the commands write.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Description of the fault.
        problem: String,
    },
    /// The page could not be made of its template.
    #[error("report: {0}")]
    Page(#[from] minijinja::Error),
}

impl ReportError {
    /// A [`ReportError::Content`].
    pub(crate) fn content(path: &Path, problem: &impl ToString) -> Self {
        Self::Content {
            path: path.to_owned(),
            problem: problem.to_string(),
        }
    }
}
