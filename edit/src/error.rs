//! The error of editing.

use eagpt_scene::SceneError;
use std::path::PathBuf;

/// Result with [`EditError`].
pub type Result<T, E = EditError> = std::result::Result<T, E>;

/// Why a script could not be read or replayed. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// A file could not be read, written or understood.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The script says something that cannot be, or that does not fit the scene.
    #[error("{}: line {line}: {key}: {problem}", path.display())]
    Script {
        /// The script.
        path: PathBuf,
        /// Line of the key or value, counted from 1.
        line: usize,
        /// Where in the script, as `step[0].then[1].move`; "TOML" if it is no TOML.
        key: String,
        /// What is wrong, with the value.
        problem: String,
    },
}
