//! The error of training.

use eagpt_render::RenderError;
use eagpt_scene::SceneError;
use eagpt_trace::TraceError;
use std::path::PathBuf;

/// Result with [`TrainError`].
pub type Result<T, E = TrainError> = std::result::Result<T, E>;

/// Why a run could not start or go on. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// A file could not be read, written or understood.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The engine gave up.
    #[error(transparent)]
    Trace(#[from] TraceError),
    /// A view could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// An option has an impossible value.
    #[error("option {field}: {problem}")]
    Option {
        /// The option's name, as in a TOML file.
        field: String,
        /// Problem, with the value.
        problem: String,
    },
    /// A layer of options is wrong.
    #[error("{layer}: {problem}")]
    Layer {
        /// A file, or an argument.
        layer: String,
        /// Problem, with the option and the value.
        problem: String,
    },
    /// The dataset is readable but cannot be trained on.
    #[error("{}: {problem}", path.display())]
    Dataset {
        /// The dataset.
        path: PathBuf,
        /// The missing part.
        problem: String,
    },
    /// The job would need more memory than the machine has.
    #[error(
        "training needs about {needed_mib} MiB of memory and the machine has {available_mib} MiB free: {advice}"
    )]
    Memory {
        /// Estimate, MiB.
        needed_mib: u64,
        /// Free memory, MiB.
        available_mib: u64,
        /// Remedy.
        advice: String,
    },
    /// A value stopped being a number, or the loss ran away.
    #[error(
        "{stage} stage, iteration {iteration}, view {view}: {what}; the last good checkpoint is kept"
    )]
    Diverged {
        /// "radiance" or "albedo".
        stage: &'static str,
        /// Iteration, counted from 1.
        iteration: u32,
        /// Name of the view.
        view: String,
        /// The parameter class or the loss, with the value.
        what: String,
    },
}

#[cfg(feature = "gpu")]
impl From<eagpt_trace::gpu::GpuError> for TrainError {
    fn from(error: eagpt_trace::gpu::GpuError) -> Self {
        Self::Trace(error.into())
    }
}
