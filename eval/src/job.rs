//! The evaluation of a folder of renders against the views of a dataset.
//!
//! Reads `<renders>/<view>.exr` (linear Rec.709) and, where there are any,
//! `<renders>/<channel>/<view>.exr` for the channels `albedo` (linear RGB), `normal` (world-space
//! x, y, z), `depth` (along the optical axis) and `emission`. Writes into the output folder
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

//! [`evaluate_conditions`] does so for several pairs of renders and references: several lightings
//! of one room. Each condition gets a folder with the files above, and beside these folders
//! `metrics.json`, `metrics.csv`, `table.md` and `table.tex` hold all conditions and their mean.

mod conditions;
mod options;
mod prepared;
mod provenance;
mod renders;
mod selection;
mod view;

#[cfg(test)]
mod tests;

pub use conditions::{Conditions, evaluate_conditions};
pub use options::{ConditionsOptions, EvalOptions};
pub(crate) use provenance::Provenance;
pub use selection::Selection;
pub(crate) use view::{EmittersFrom, ViewMetrics};

use crate::error::Result;
use crate::metrics::{METRICS, MeanOf, Metric};
use crate::regions::Regions;
use crate::scene_metrics::mean;
use eagpt_scene::dataset::{SplitRule, Subset};
use prepared::Prepared;
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

/// Mean of a metric over the views that have it, or over their pixels: see `MeanOf`.
#[derive(Debug, Clone, Copy)]
pub struct Mean {
    /// The metric.
    pub metric: &'static Metric,
    /// The mean; infinite if that of a view is.
    pub value: f64,
    /// Number of views that have the metric.
    pub num_views: usize,
}

/// The result of [`evaluate`].
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Name of the condition.
    pub name: String,
    /// Provenance of the renders.
    pub(crate) provenance: Provenance,
    /// Means of the metrics that at least one view has, in the order of [`METRICS`].
    pub means: Vec<Mean>,
    /// Factor applied to the renders for the aligned metrics: see
    /// `ExposureFit`.
    pub exposure_scale: Option<f64>,
    /// Light after over light before: see `LightChange`.
    pub light_change: Option<f64>,
    /// The error by region, over the pixels of all views.
    pub regions: Regions,
    /// The views, in the order of the dataset.
    pub views: Vec<ViewMetrics>,
    /// Number of rendered views, evaluated or not.
    pub num_rendered: usize,
    /// Rule that divided the views, where it is known.
    pub split: Option<SplitRule>,
    /// The subset that was evaluated, where it is known.
    pub subset: Option<Subset>,
    /// Warnings about the numbers.
    pub warnings: Vec<String>,
}

impl Evaluation {
    /// The mean of the metric called `key`, if a view has it.
    pub fn mean(&self, key: &str) -> Option<f64> {
        mean_of(&self.means, key)
    }
}

fn mean_of(means: &[Mean], key: &str) -> Option<f64> {
    let mean = means.iter().find(|mean| mean.metric.key == key)?;
    Some(mean.value)
}

/// Compares renders with the views of a dataset and writes the results.
///
/// Measured are the views that were rendered and that the dataset has: see [`Selection`]. Before
/// any comparison it checks that sizes fit and that no result is in the way.
///
/// # Errors
/// [`EvalError`](crate::EvalError) naming the file or option: no render of a view, a missing render
/// of the subset that was asked for (all are listed), a render of another size or with values that
/// are not finite, a view that the earlier dataset lacks, results in the output folder without
/// `force`, or whatever reading and writing files returns.
pub fn evaluate(
    options: &EvalOptions,
    progress: &mut dyn FnMut(EvalProgress),
) -> Result<Evaluation> {
    let prepared = Prepared::new(options)?;
    for text in &prepared.warnings {
        progress(EvalProgress::Warning { text: text.clone() });
    }
    let total = prepared.num_views();
    progress(EvalProgress::Started { total });
    let mut done = 0;
    prepared.run(&mut |name| {
        done += 1;
        progress(EvalProgress::View {
            name: name.to_owned(),
            done,
            total,
        });
    })
}

fn means(views: &[ViewMetrics]) -> Vec<Mean> {
    METRICS
        .iter()
        .filter_map(|metric| {
            let values = || views.iter().filter_map(metric.of);
            Some(Mean {
                metric,
                value: match metric.mean {
                    MeanOf::Views => mean(values())?,
                    MeanOf::Pixels(pooled) => pooled(views)?,
                },
                num_views: values().count(),
            })
        })
        .collect()
}
