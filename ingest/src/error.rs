//! The error of this crate.

use eagpt_scene::SceneError;
use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Result with [`IngestError`].
pub type Result<T, E = IngestError> = std::result::Result<T, E>;

/// Why a capture could not be ingested. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum IngestError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An option is out of its range.
    #[error("option {field}: {value}, must be {wanted}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// Its value.
        value: String,
        /// The range.
        wanted: &'static str,
    },
    /// A photograph cannot be used; the user has to mend, replace or leave it out.
    #[error("{}: {field}: {problem}", path.display())]
    Photograph {
        /// The file.
        path: PathBuf,
        /// Which property of it.
        field: Cow<'static, str>,
        /// The problem, with the value.
        problem: String,
    },
    /// The program that is to decode photographs cannot.
    #[error("{}: cannot decode photographs: {problem}", program.display())]
    Decoder {
        /// The program.
        program: PathBuf,
        /// The reason.
        problem: String,
    },
    /// The capture has problems, each of which was reported.
    #[error("{}: {num_problems} in the way of {num_stacks} stacks, see above; --skip-bad continues without the files or stacks concerned", capture.display())]
    BadCapture {
        /// The capture.
        capture: PathBuf,
        /// "1 problem", "3 problems".
        num_problems: String,
        /// Stacks that were found.
        num_stacks: usize,
    },
    /// The response of the camera cannot be recovered from pictures for display.
    #[error("{}: response of the camera: {problem}", capture.display())]
    Response {
        /// The capture.
        capture: PathBuf,
        /// The reason.
        problem: String,
    },
    /// Nothing in the capture can be used.
    #[error("{}: {problem}", capture.display())]
    Empty {
        /// The capture.
        capture: PathBuf,
        /// Why.
        problem: String,
    },
    /// More memory would be needed than there is.
    #[error("{}: {stack}: merging needs {needed_mib} MiB of memory, {available_mib} MiB are free: fewer shots in a stack, or another machine", capture.display())]
    Memory {
        /// The capture.
        capture: PathBuf,
        /// The largest stack.
        stack: String,
        /// Estimate.
        needed_mib: u64,
        /// The system's message.
        available_mib: u64,
    },
    /// The output holds stacks of other options or other photographs.
    #[error("{}: {}: was made with other options or photographs: --force starts over, --out names another folder", out.display(), stack)]
    Stale {
        /// The output folder.
        out: PathBuf,
        /// The first such stack.
        stack: String,
    },
    /// A file is in the way that no earlier run has made.
    #[error("{}: is there already: --force replaces it, --out names another folder", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The job was asked to stop; what is done stays.
    #[error("stopped after {done} of {total} stacks")]
    Stopped {
        /// Stacks done.
        done: usize,
        /// All stacks.
        total: usize,
    },
}

impl IngestError {
    /// A [`Self::Photograph`] for `field` of `path`.
    pub(crate) fn photograph(
        path: &Path,
        field: impl Into<Cow<'static, str>>,
        problem: impl Into<String>,
    ) -> Self {
        Self::Photograph {
            path: path.to_owned(),
            field: field.into(),
            problem: problem.into(),
        }
    }
}
