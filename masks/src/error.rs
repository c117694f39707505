//! The error of this crate.

use eagpt_scene::SceneError;
use eagpt_trace::TraceError;
use std::path::PathBuf;

/// Result with [`MaskError`].
pub type Result<T, E = MaskError> = std::result::Result<T, E>;

/// Why masks could not be made. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum MaskError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The device that renders depths or emission gave up.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// An option is out of its range.
    #[error("option {field}: {value}, must be {expected}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// Its value.
        value: String,
        /// The range.
        expected: &'static str,
    },
    /// No level separates lights from lit surfaces.
    #[error("{}: threshold auto: {problem}; give a level of linear radiance, or labels", path.display())]
    NoLevel {
        /// The dataset.
        path: PathBuf,
        /// The problem with the histogram of all views.
        problem: String,
    },
    /// A folder of labels has none for any view.
    #[error("{}: no label image is named like a view: the {num_views} views are named like `{example}`, labels `{example}.png`", path.display())]
    NoLabels {
        /// The folder.
        path: PathBuf,
        /// Number of views.
        num_views: usize,
        /// Name of the first view.
        example: String,
    },
}
