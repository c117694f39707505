//! Results of evaluations.

use crate::metrics::{METRICS, MeanOf, Metric};
use crate::provenance::Provenance;
use crate::regions::Regions;
use crate::scene_metrics::mean;
use crate::view::ViewMetrics;
use eagpt_scene::dataset::{SplitRule, Subset};

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

/// The result of [`crate::evaluate`] for one condition.
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

/// The result of [`crate::evaluate`].
#[derive(Debug, Clone)]
pub struct Conditions {
    /// Means over the conditions that have a metric of their means, each condition with the same
    /// weight however many views it has; in the order of [`METRICS`].
    pub means: Vec<Mean>,
    /// The conditions, in the order of the options.
    pub conditions: Vec<Evaluation>,
}

impl Conditions {
    /// The mean of the metric called `key`, if a condition has it.
    pub fn mean(&self, key: &str) -> Option<f64> {
        mean_of(&self.means, key)
    }
}

impl Mean {
    /// Means over views, in the order of [`METRICS`].
    pub(crate) fn of_views(views: &[ViewMetrics]) -> Vec<Self> {
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

    /// Means over conditions, in the order of [`METRICS`].
    pub(crate) fn of_conditions(conditions: &[Evaluation]) -> Vec<Self> {
        METRICS
            .iter()
            .filter_map(|metric| {
                let of_all = conditions.iter().flat_map(|condition| &condition.means);
                let found: Vec<&Mean> = of_all.filter(|m| m.metric.key == metric.key).collect();
                Some(Mean {
                    metric,
                    value: mean(found.iter().map(|mean| mean.value))?,
                    num_views: found.iter().map(|mean| mean.num_views).sum(),
                })
            })
            .collect()
    }
}
