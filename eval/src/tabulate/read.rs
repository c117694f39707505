//! Reading evaluations back.

use super::{TableCell, TableFolder};
use crate::error::Result;
use crate::metrics::Metric;
use crate::provenance::Provenance;
use crate::report;
use eagpt_scene::{SceneError, files};
use serde::Deserialize;
use std::collections::BTreeMap;

/// The fields of a `metrics.json` that the table needs, of one condition or of several.
#[derive(Deserialize)]
struct Evaluated {
    name: Option<String>,
    #[serde(default)]
    render: Provenance,
    /// Null is infinite.
    mean: BTreeMap<String, Option<f64>>,
    conditions: Option<Vec<Evaluated>>,
}

/// A cell and its place.
pub(super) struct Found {
    pub(super) row: String,
    pub(super) condition: String,
    pub(super) cell: TableCell,
}

/// The conditions of an evaluation.
pub(super) fn conditions(folder: &TableFolder, metrics: &[&'static Metric]) -> Result<Vec<Found>> {
    let path = folder.folder.join(report::METRICS_FILE);
    let invalid = |field: &str, problem: String| SceneError::invalid(&path, field, problem);
    let mut evaluated: Evaluated = serde_json::from_slice(&files::read(&path)?)
        .map_err(|error| invalid("JSON", error.to_string()))?;
    let (conditions, prefix) = match evaluated.conditions.take() {
        Some(conditions) => (conditions, "conditions[]."),
        None => (vec![evaluated], ""),
    };
    let found = |evaluated: Evaluated| {
        let missing =
            |field: &str, what: &str| invalid(&format!("{prefix}{field}"), what.to_owned());
        let row = folder.row.clone().or(evaluated.render.mode.clone());
        Ok(Found {
            row: row
                .ok_or_else(|| missing("render.mode", "not known; ROW=DIR gives the row a name"))?,
            condition: evaluated
                .name
                .ok_or_else(|| missing("name", "missing; evaluate the renders again"))?,
            cell: TableCell {
                folder: folder.folder.clone(),
                values: metrics
                    .iter()
                    .map(|metric| Some(evaluated.mean.get(metric.key)?.unwrap_or(f64::INFINITY)))
                    .collect(),
                provenance: evaluated.render,
            },
        })
    };
    conditions.into_iter().map(found).collect()
}
