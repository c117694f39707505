//! The error of this crate.

use eagpt_colmap::ColmapError;
use eagpt_scene::SceneError;

/// Result with [`SynthError`].
pub type Result<T, E = SynthError> = std::result::Result<T, E>;

/// Why nothing could be simulated. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum SynthError {
    /// A file could not be read, written or understood.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The COLMAP model could not be written.
    #[error(transparent)]
    Colmap(#[from] ColmapError),
    /// An option has an impossible value.
    #[error("option {field}: {problem}")]
    Option {
        /// The option's name.
        field: &'static str,
        /// The problem, with the value.
        problem: String,
    },
}
