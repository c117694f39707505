//! Evaluations of several seeds in one table: mean and standard deviation, and published values
//! beside them.
//!
//! A cell is a row and a condition, with an evaluation for each seed. The files are those of the
//! table of modes, `table.md`, `table.tex`, `table.csv` (one line for each cell) and, last,
//! `table.json`.

#[cfg(test)]
mod tests;

use super::{Cells, Table, TableFolder, metric, read};
use crate::error::{EvalError, Result};
use crate::metrics::Metric;
use crate::report::grid::{Column, Grid, shown};
use crate::report::{csv_text, csv_value};
use eagpt_scene::SceneError;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Key of the seconds that a frame took, beside those of metrics.
pub const SECONDS: &str = "seconds_per_frame";
/// Decimals of seconds in tables: images without bounces take hundredths.
const SECONDS_DECIMALS: usize = 3;

/// Options of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct RepeatOptions {
    /// Cells in the order of their rows; conditions are in the order of appearance.
    pub cells: Vec<RepeatCell>,
    /// Keys of [`crate::METRICS`], at least one.
    pub metrics: Vec<String>,
}

/// A row under a condition.
#[derive(Debug, Clone, PartialEq)]
pub struct RepeatCell {
    /// Its row.
    pub row: String,
    /// Its condition, as in the evaluations.
    pub condition: String,
    /// Folders with a `metrics.json` of this condition, one for each seed, at least one.
    pub folders: Vec<PathBuf>,
    /// Values to compare with, by key: those of metrics and [`SECONDS`], and others, which are only
    /// in the JSON.
    pub published: BTreeMap<String, f64>,
}

/// Mean and standard deviation over the seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Spread {
    /// Mean; JSON has null for an infinite one.
    mean: f64,
    /// Standard deviation of the sample, divided by n − 1; `None` for one seed or an infinite mean.
    sd: Option<f64>,
    /// The values, in the order of the folders.
    values: Vec<f64>,
}

impl Spread {
    /// `None` without values.
    fn of(values: Vec<f64>) -> Option<Self> {
        let num = values.len() as f64;
        if values.is_empty() {
            return None;
        }
        let mean = values.iter().sum::<f64>() / num;
        let squares = || {
            values
                .iter()
                .map(|value| (value - mean).powi(2))
                .sum::<f64>()
        };
        let has_sd = values.len() > 1 && mean.is_finite();
        let sd = has_sd.then(|| (squares() / (num - 1.0)).sqrt());
        Some(Self { mean, sd, values })
    }

    fn shown(&self, num_decimals: usize) -> String {
        let mean = shown(Some(self.mean), num_decimals);
        match self.sd {
            Some(sd) => format!("{mean} ± {}", shown(Some(sd), num_decimals)),
            None => mean,
        }
    }
}

/// Means over seeds.
struct RepeatTable {
    metrics: Vec<&'static Metric>,
    cells: Cells<Filled>,
    notes: Vec<String>,
}

struct Filled {
    folders: Vec<PathBuf>,
    /// A spread for each metric, and for the seconds last.
    spreads: Vec<Option<Spread>>,
    published: BTreeMap<String, f64>,
}

/// Puts evaluations into one table; `notes` stand below it.
///
/// # Errors
/// As [`super::tabulate`]; also if an evaluation has no condition of the cell's name.
pub fn tabulate_repeats(options: &RepeatOptions, notes: Vec<String>) -> Result<Table> {
    let keys = options.metrics.iter();
    let metrics = keys.map(|key| metric(key)).collect::<Result<Vec<_>>>()?;
    let mut table = RepeatTable {
        metrics,
        cells: Cells::new(),
        notes,
    };
    for cell in &options.cells {
        table.put(cell)?;
    }
    Ok(Table {
        grid: table.grid(),
        csv: table.csv(),
        json: table.json(),
    })
}

impl RepeatTable {
    fn put(&mut self, cell: &RepeatCell) -> Result<()> {
        let mut values = vec![Vec::new(); self.metrics.len() + 1];
        for folder in &cell.folders {
            let folder = TableFolder {
                folder: folder.clone(),
                row: Some(cell.row.clone()),
            };
            let mut all = read::conditions(&folder, &self.metrics)?.into_iter();
            let found = all.find(|found| found.condition == cell.condition);
            let found = found.ok_or_else(|| {
                let path = folder.folder.join(crate::report::METRICS_FILE);
                let problem = format!("no condition is called `{}`", cell.condition);
                SceneError::invalid(&path, "name", problem)
            })?;
            let seconds = found.cell.provenance.seconds_per_frame;
            let of_metrics = found.cell.values.into_iter();
            for (all, value) in values.iter_mut().zip(of_metrics.chain([seconds])) {
                all.extend(value);
            }
        }
        let filled = Filled {
            folders: cell.folders.clone(),
            spreads: values.into_iter().map(Spread::of).collect(),
            published: cell.published.clone(),
        };
        let first = |folders: &[PathBuf]| folders.first().cloned().unwrap_or_default();
        self.cells
            .put(&cell.row, &cell.condition, filled)
            .map_err(|earlier| EvalError::SameCell {
                folder: first(&cell.folders),
                earlier: first(&earlier.folders),
                row: cell.row.clone(),
                condition: cell.condition.clone(),
            })?;
        Ok(())
    }

    /// Keys of the columns of a condition.
    fn keys(&self) -> Vec<&'static str> {
        let metrics = self.metrics.iter().map(|metric| metric.key);
        metrics.chain([SECONDS]).collect()
    }

    /// Whether any row of a condition has a published value for a column.
    fn is_published(&self, condition: &str, key: &str) -> bool {
        let mut cells = self.cells.iter().filter(|(_, of, _)| *of == condition);
        cells.any(|(_, _, cell)| cell.published.contains_key(key))
    }

    fn grid(&self) -> Grid {
        let seconds = Column {
            heading: "s/frame".to_owned(),
            better: None,
        };
        let of_metrics = self.metrics.iter();
        let own: Vec<(Column, usize)> = of_metrics
            .map(|metric| (Column::of(metric), metric.num_decimals))
            .chain([(seconds, SECONDS_DECIMALS)])
            .collect();
        let (mut groups, mut columns) = (Vec::new(), Vec::new());
        let mut rows: Vec<(String, Vec<String>)> = self
            .cells
            .rows
            .iter()
            .map(|(name, _)| (name.clone(), Vec::new()))
            .collect();
        for (place, condition) in self.cells.conditions.iter().enumerate() {
            let before = columns.len();
            for (i, key) in self.keys().into_iter().enumerate() {
                let (column, num_decimals) = &own[i];
                let is_published = self.is_published(condition, key);
                columns.push(column.clone());
                if is_published {
                    columns.push(Column {
                        heading: "paper".to_owned(),
                        better: None,
                    });
                }
                for ((_, cells), (_, texts)) in self.cells.rows.iter().zip(&mut rows) {
                    let cell = cells.get(place).and_then(Option::as_ref);
                    let spread = cell.and_then(|cell| cell.spreads[i].as_ref());
                    texts.push(spread.map_or(shown(None, 0), |s| s.shown(*num_decimals)));
                    if is_published {
                        let value = cell.and_then(|cell| cell.published.get(key).copied());
                        texts.push(shown(value, *num_decimals));
                    }
                }
            }
            groups.push((condition.clone(), columns.len() - before));
        }
        Grid {
            corner: "row",
            groups,
            columns,
            rows,
            mean: None,
            notes: self.notes.clone(),
        }
    }

    fn csv(&self) -> String {
        let of_key = |key| ["", "_sd", "_published"].map(|suffix| format!("{key}{suffix}"));
        let heading = ["row", "condition", "num_seeds"].map(str::to_owned);
        let heading = heading
            .into_iter()
            .chain(self.keys().into_iter().flat_map(of_key));
        let rows = self.cells.iter().map(|(row, condition, cell)| {
            let spreads = self.keys().into_iter().zip(&cell.spreads);
            let values = spreads.flat_map(|(key, spread)| {
                let spread = spread.as_ref();
                let published = cell.published.get(key).copied();
                let mean = spread.map(|spread| spread.mean);
                [mean, spread.and_then(|spread| spread.sd), published].map(csv_value)
            });
            let num_seeds = cell.folders.len().to_string();
            let place = [row.to_owned(), condition.to_owned(), num_seeds];
            place.into_iter().chain(values)
        });
        csv_text(heading, rows)
    }

    fn json(&self) -> Value {
        let mut rows: Vec<Value> = Vec::new();
        for (row, condition, cell) in self.cells.iter() {
            let spreads = self.keys().into_iter().zip(&cell.spreads);
            let values: Map<String, Value> = spreads
                .filter_map(|(key, spread)| Some((key.to_owned(), json!(spread.as_ref()?))))
                .collect();
            rows.push(json!({
                "row": row,
                "condition": condition,
                "folders": cell.folders,
                "values": values,
                "published": cell.published,
            }));
        }
        let definitions = self.metrics.iter();
        let definitions: Map<String, Value> = definitions
            .map(|metric| (metric.key.to_owned(), json!(metric.definition)))
            .collect();
        json!({ "definitions": definitions, "cells": rows, "notes": self.notes })
    }
}
