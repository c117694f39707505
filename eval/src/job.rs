//! The evaluation of a folder of renders against the views of a dataset.
//!
//! Reads `<renders>/<view>.exr` (linear Rec.709) and, where there are any,
//! `<renders>/<channel>/<view>.exr` for the channels `albedo` (linear RGB), `normal` (world-space
//! x, y, z), `depth` (along the optical axis), `emission`, `specular` (F0, linear RGB) and
//! `roughness`. Writes into the output folder
//!
//! | file | content |
//! |---|---|
//! | `metrics.json` | means, views, definitions, split, warnings |
//! | `metrics.csv` | one line for each view, full precision |
//! | `table.md`, `table.tex` | the same for people, with means |
//! | `flip/<view>.png` | HDR-FLIP error, magma from 0 to 1 |
//!
//! One view is in memory at a time. `metrics.json` is written last: if it exists, the other files
//! are complete.
//!
//! Of several pairs of renders and references, several lightings of one room, each condition gets a
//! folder with the files above, and beside these folders `metrics.json`, `metrics.csv`, `table.md`
//! and `table.tex` hold all conditions and their mean.

mod channels;
mod conditions;
mod options;
mod prepared;
mod renders;
mod selection;

#[cfg(test)]
mod tests;

pub use conditions::evaluate;
pub use options::{ConditionsOptions, EvalOptions};
pub use selection::Selection;

use serde::Serialize;

/// Progress messages of an evaluation.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum EvalProgress {
    /// All files exist; the comparison begins.
    Started {
        /// Number of views.
        total: usize,
    },
    /// A view is done.
    View {
        /// Its name.
        name: String,
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A warning; also in `metrics.json`.
    Warning {
        /// The text, one line.
        text: String,
    },
}
