//! The error of this crate.

use eagpt_scene::SceneError;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Result with [`ConvertError`].
pub type Result<T, E = ConvertError> = std::result::Result<T, E>;

/// Why a dataset could not be read, written or completed. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum ConvertError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A COLMAP model could not be written; the message is that of the colmap crate.
    #[error(transparent)]
    Colmap(#[from] eagpt_colmap::ColmapError),
    /// An option is out of its range or does not go with the data.
    #[error("option {field}: {problem}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// The problem, with the value.
        problem: String,
    },
    /// A folder has no known layout.
    #[error("{}: format auto: {problem}", path.display())]
    UnknownFormat {
        /// The folder or file.
        path: PathBuf,
        /// The files searched for.
        problem: String,
    },
    /// Frames that cannot be used, all of them.
    #[error("{}: {} of {num_frames} frames cannot be used: {}", path.display(), problems.len(), listed(problems))]
    BadFrames {
        /// The dataset.
        path: PathBuf,
        /// Total number of frames.
        num_frames: usize,
        /// The problem of each.
        problems: Vec<Problem>,
    },
    /// A network or the library that runs it.
    #[error("{}: {problem}", path.display())]
    Network {
        /// The model or the library.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// The axes of normal maps are neither given nor detectable.
    #[error("{}: axes auto: {problem}", path.display())]
    UnclearAxes {
        /// The folder of maps.
        path: PathBuf,
        /// The problem, and what to do about it.
        problem: String,
    },
}

/// A problem of one frame.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Problem {
    /// Name of the frame.
    pub view: String,
    /// The problem, with file, field and value.
    pub problem: String,
}

impl Problem {
    /// A problem of a frame.
    pub fn new(view: &str, problem: impl std::fmt::Display) -> Self {
        Self {
            view: view.to_owned(),
            problem: problem.to_string(),
        }
    }
}

impl ConvertError {
    /// A [`ConvertError::Option`].
    pub fn option(field: &'static str, problem: impl Into<String>) -> Self {
        Self::Option {
            field,
            problem: problem.into(),
        }
    }

    /// A [`SceneError::Invalid`] for `field` of `path`.
    pub fn invalid(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        SceneError::invalid(path, field, problem).into()
    }

    /// A [`SceneError::Unsupported`] for `field` of `path`.
    pub fn unsupported(path: &Path, field: impl Into<String>, problem: impl Into<String>) -> Self {
        SceneError::unsupported(path, field, problem).into()
    }
}

/// Problems in one line; progress messages list the rest.
fn listed(problems: &[Problem]) -> String {
    const MAX_LISTED: usize = 8;
    let mut text = String::new();
    for (index, Problem { view, problem }) in problems.iter().take(MAX_LISTED).enumerate() {
        let separator = if index == 0 { "" } else { "; " };
        // Writing to a string does not fail.
        write!(text, "{separator}{view}: {problem}").unwrap_or_default();
    }
    let more = problems.len().saturating_sub(MAX_LISTED);
    if more > 0 {
        write!(text, "; and {more} more").unwrap_or_default();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_bad_frames_are_one_line() {
        let problems = (0..10).map(|i| Problem::new(&format!("{i:03}"), "no image"));
        let error = ConvertError::BadFrames {
            path: "room".into(),
            num_frames: 30,
            problems: problems.collect(),
        };
        let message = error.to_string();
        assert!(message.starts_with("room: 10 of 30 frames cannot be used: 000: no image; 001: "));
        assert!(message.ends_with("007: no image; and 2 more"), "{message}");
    }
}
