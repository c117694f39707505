//! The error of this crate.

use eagpt_scene::SceneError;
use std::path::PathBuf;

/// Result with [`EvalError`].
pub type Result<T, E = EvalError> = std::result::Result<T, E>;

/// The first few of some names, and the number of the others.
pub(crate) fn listed(names: &[String]) -> String {
    const MAX_LISTED: usize = 8;
    let mut text = names[..names.len().min(MAX_LISTED)].join(", ");
    if let more @ 1.. = names.len().saturating_sub(MAX_LISTED) {
        text += &format!(" and {more} more");
    }
    text
}

/// Why something could not be measured. Every variant prints as one line.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// A file could not be read or written; the message is that of the scene crate.
    #[error(transparent)]
    Scene(#[from] SceneError),
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
    /// A condition that the truth does not have.
    #[error("condition `{name}`: there are {}", listed(known))]
    Condition {
        /// The condition asked for.
        name: String,
        /// The conditions there are.
        known: Vec<String>,
    },
    /// HDR-FLIP would start at a longer exposure than it stops at.
    #[error("start_exposure {start} is above stop_exposure {stop}")]
    Exposures {
        /// First exposure in stops.
        start: f32,
        /// Last exposure in stops.
        stop: f32,
    },
    /// Views of the dataset have no render.
    #[error("{}: no render for {} of {num_views} views: {}", folder.display(), missing.len(), listed(missing))]
    MissingRenders {
        /// The folder of renders.
        folder: PathBuf,
        /// Names of all views without one.
        missing: Vec<String>,
        /// Number of views asked for.
        num_views: usize,
    },
    /// No render is of a view of the reference.
    #[error("{}: no view in common: {num_rendered} EXR files, of which none is to be measured against {}; its views are called as `{expected}`", folder.display(), reference.display())]
    NothingInCommon {
        /// The folder of renders.
        folder: PathBuf,
        /// Number of rendered views.
        num_rendered: usize,
        /// The reference.
        reference: PathBuf,
        /// The name of one of its views.
        expected: String,
    },
    /// A render does not fit its view.
    #[error("{}: {problem}", path.display())]
    Render {
        /// The file.
        path: PathBuf,
        /// The problem, with the values.
        problem: String,
    },
    /// Two evaluations are of the same mode under the same condition.
    #[error("{}: row {row}, condition {condition}: {} has it already; ROW=DIR gives this one a row of its own", folder.display(), earlier.display())]
    SameCell {
        /// The second evaluation.
        folder: PathBuf,
        /// The first.
        earlier: PathBuf,
        /// Their row.
        row: String,
        /// Their condition.
        condition: String,
    },
}
