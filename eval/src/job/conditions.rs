//! Several lightings of one room, each with its own renders and references.

use super::options::{ConditionsOptions, EvalOptions};
use super::prepared::{Prepared, refuse_existing};
use super::{EvalProgress, Evaluation, Mean, mean_of};
use crate::error::Result;
use crate::metrics::METRICS;
use crate::report;
use crate::scene_metrics::mean;

/// The result of [`evaluate_conditions`].
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

/// Evaluates every condition as [`evaluate`](super::evaluate) does, and writes the results of all
/// together.
///
/// All conditions are checked before any comparison; progress counts the views of all of them.
///
/// # Errors
/// As [`evaluate`](super::evaluate) for each condition.
pub fn evaluate_conditions(
    options: &ConditionsOptions,
    progress: &mut dyn FnMut(EvalProgress),
) -> Result<Conditions> {
    let prepared = options
        .conditions
        .iter()
        .map(Prepared::new)
        .collect::<Result<Vec<_>>>()?;
    if !options.conditions.iter().all(|condition| condition.force) {
        refuse_existing(report::files(&options.out).into_iter())?;
    }
    let names: Vec<String> = options
        .conditions
        .iter()
        .map(EvalOptions::condition)
        .collect();
    for (name, prepared) in names.iter().zip(&prepared) {
        for text in &prepared.warnings {
            progress(EvalProgress::Warning {
                text: format!("{name}: {text}"),
            });
        }
    }
    let total = prepared.iter().map(Prepared::num_views).sum();
    progress(EvalProgress::Started { total });
    let mut done = 0;
    let mut conditions = Vec::with_capacity(prepared.len());
    for (condition, prepared) in names.iter().zip(prepared) {
        conditions.push(prepared.run(&mut |view| {
            done += 1;
            progress(EvalProgress::View {
                name: format!("{condition}/{view}"),
                done,
                total,
            });
        })?);
    }
    let found = Conditions {
        means: means(&conditions),
        conditions,
    };
    report::write_conditions(&options.out, &found)?;
    Ok(found)
}

fn means(conditions: &[Evaluation]) -> Vec<Mean> {
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
