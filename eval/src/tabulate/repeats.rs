//! Evaluations of several seeds in one table: mean and standard deviation, and published values
//! beside them.
//!
//! A cell is a row and a condition, with an evaluation for each seed. The files are those of the
//! table of modes, `table.md`, `table.tex`, `table.csv` (one line for each cell) and, last,
//! `table.json`.

use super::{FILES, TableFolder, metric, position_or_push, read};
use crate::error::{EvalError, Result};
use crate::metrics::Metric;
use crate::report::grid::{Column, Grid, shown};
use crate::report::{append, csv_field, csv_value, write_all};
use eagpt_scene::SceneError;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Key of the seconds that a frame took, beside those of metrics.
pub const SECONDS: &str = "seconds_per_frame";
/// Decimals of seconds in tables: images without bounces take hundredths.
const SECONDS_DECIMALS: usize = 3;

/// Options of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RepeatOptions {
    /// Cells in the order of their rows; conditions are in the order of appearance.
    pub cells: Vec<RepeatCell>,
    /// Keys of [`crate::METRICS`], at least one.
    pub metrics: Vec<String>,
}

/// A row under a condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RepeatCell {
    /// Its row.
    pub row: String,
    /// Its condition, as in the evaluations.
    pub condition: String,
    /// Folders with a `metrics.json` of this condition, one for each seed, at least one.
    pub folders: Vec<PathBuf>,
    /// Values to compare with, by key: those of metrics and [`SECONDS`], and others, which are only
    /// in the JSON.
    #[serde(default)]
    pub published: BTreeMap<String, f64>,
}

/// Mean and standard deviation over the seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spread {
    /// Mean; JSON has null for an infinite one.
    pub mean: f64,
    /// Standard deviation of the sample, divided by n − 1; `None` for one seed or an infinite mean.
    pub sd: Option<f64>,
    /// The values, in the order of the folders.
    pub values: Vec<f64>,
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

/// A table of means over seeds.
#[derive(Debug, Clone)]
pub struct RepeatTable {
    metrics: Vec<&'static Metric>,
    conditions: Vec<String>,
    rows: Vec<(String, Vec<Option<Filled>>)>,
    notes: Vec<String>,
}

#[derive(Debug, Clone)]
struct Filled {
    folders: Vec<PathBuf>,
    /// A spread for each metric, and for the seconds last.
    spreads: Vec<Option<Spread>>,
    published: BTreeMap<String, f64>,
}

/// Puts evaluations into one table, which [`RepeatTable::write`] writes; `notes` stand below it.
///
/// # Errors
/// As [`super::tabulate`]; also if an evaluation has no condition of the cell's name.
pub fn tabulate_repeats(options: &RepeatOptions, notes: Vec<String>) -> Result<RepeatTable> {
    let keys = options.metrics.iter();
    let metrics = keys.map(|key| metric(key)).collect::<Result<Vec<_>>>()?;
    let mut table = RepeatTable {
        metrics,
        conditions: Vec::new(),
        rows: Vec::new(),
        notes,
    };
    for cell in &options.cells {
        table.put(cell)?;
    }
    let num = table.conditions.len();
    for (_, cells) in &mut table.rows {
        cells.resize(num, None);
    }
    Ok(table)
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
        let column = position_or_push(
            &mut self.conditions,
            |name| *name == cell.condition,
            || cell.condition.clone(),
        );
        let row = position_or_push(
            &mut self.rows,
            |(name, _)| *name == cell.row,
            || (cell.row.clone(), Vec::new()),
        );
        let cells = &mut self.rows[row].1;
        if cells.len() <= column {
            cells.resize(column + 1, None);
        }
        if let (Some(earlier), Some(folder)) = (&cells[column], cell.folders.first()) {
            return Err(EvalError::SameCell {
                folder: folder.clone(),
                earlier: earlier.folders.first().cloned().unwrap_or_default(),
                row: cell.row.clone(),
                condition: cell.condition.clone(),
            });
        }
        cells[column] = Some(Filled {
            folders: cell.folders.clone(),
            spreads: values.into_iter().map(Spread::of).collect(),
            published: cell.published.clone(),
        });
        Ok(())
    }

    /// Writes the [`FILES`] into `out`, each atomically.
    ///
    /// # Errors
    /// [`SceneError::Io`] with the file's name.
    pub fn write(&self, out: &Path) -> Result<()> {
        let [markdown, latex, csv, json] = FILES;
        let texts = [
            (markdown, self.markdown()),
            (latex, self.grid().latex()),
            (csv, self.csv()),
        ];
        write_all(out, texts, (json, self.json()))
    }

    /// The table as Markdown, with its notes.
    pub fn markdown(&self) -> String {
        self.grid().markdown()
    }

    /// Keys of the columns of a condition.
    fn keys(&self) -> Vec<&'static str> {
        let metrics = self.metrics.iter().map(|metric| metric.key);
        metrics.chain([SECONDS]).collect()
    }

    fn cells(&self) -> impl Iterator<Item = (&str, &str, &Filled)> {
        self.rows.iter().flat_map(|(row, cells)| {
            let cells = self.conditions.iter().zip(cells);
            cells.filter_map(|(condition, cell)| {
                Some((row.as_str(), condition.as_str(), cell.as_ref()?))
            })
        })
    }

    /// Whether any row of a condition has a published value for a column.
    fn is_published(&self, condition: &str, key: &str) -> bool {
        let mut cells = self.cells().filter(|(_, of, _)| *of == condition);
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
            .rows
            .iter()
            .map(|(name, _)| (name.clone(), Vec::new()))
            .collect();
        for (place, condition) in self.conditions.iter().enumerate() {
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
                for ((_, cells), (_, texts)) in self.rows.iter().zip(&mut rows) {
                    let cell = cells[place].as_ref();
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
        let mut text = "row,condition,num_seeds".to_owned();
        for key in self.keys() {
            append(&mut text, format_args!(",{key},{key}_sd,{key}_published"));
        }
        text.push('\n');
        for (row, condition, cell) in self.cells() {
            let num = cell.folders.len();
            append(
                &mut text,
                format_args!("{},{},{num}", csv_field(row), csv_field(condition)),
            );
            for (key, spread) in self.keys().into_iter().zip(&cell.spreads) {
                csv_value(&mut text, spread.as_ref().map(|spread| spread.mean));
                csv_value(&mut text, spread.as_ref().and_then(|spread| spread.sd));
                csv_value(&mut text, cell.published.get(key).copied());
            }
            text.push('\n');
        }
        text
    }

    fn json(&self) -> serde_json::Result<Value> {
        let mut rows: Vec<Value> = Vec::new();
        for (row, condition, cell) in self.cells() {
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
        Ok(json!({ "definitions": definitions, "cells": rows, "notes": self.notes }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evaluated(root: &Path, name: &str, psnr: f64) -> PathBuf {
        let folder = root.join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let metrics = json!({
            "name": "original",
            "render": {"mode": "path", "seconds_per_frame": 2.0},
            "mean": {"psnr_srgb_db": psnr},
        });
        std::fs::write(folder.join("metrics.json"), metrics.to_string()).unwrap();
        folder
    }

    fn cell(row: &str, folders: Vec<PathBuf>, published: Option<f64>) -> RepeatCell {
        RepeatCell {
            row: row.to_owned(),
            condition: "original".to_owned(),
            folders,
            published: published
                .map(|value| ("psnr_srgb_db".to_owned(), value))
                .into_iter()
                .collect(),
        }
    }

    #[test]
    fn seeds_become_mean_and_deviation_beside_published_values() {
        let root = tempfile::tempdir().unwrap();
        let [a, b, c] = [("a", 27.0), ("b", 29.0), ("c", 20.0)]
            .map(|(name, psnr)| evaluated(root.path(), name, psnr));
        let options = RepeatOptions {
            cells: vec![
                cell("path", vec![a, b], Some(28.65)),
                cell("bounces-3", vec![c], None),
            ],
            metrics: vec!["psnr_srgb_db".to_owned()],
        };
        let table = tabulate_repeats(&options, vec!["a note".to_owned()]).unwrap();
        // The deviation of 27 and 29 about 28: the root of (1 + 1) / 1.
        assert_eq!(
            table.markdown(),
            "| row | original: PSNR sRGB ↑ | original: paper | original: s/frame |\n|---|---:|---:|---:|\n\
             | path | 28.00 ± 1.41 | 28.65 | 2.000 ± 0.000 |\n| bounces-3 | 20.00 | -- | 2.000 |\n\n- a note\n"
        );
        let out = root.path().join("table");
        table.write(&out).unwrap();
        let csv = std::fs::read_to_string(out.join("table.csv")).unwrap();
        assert!(csv.contains("\npath,original,2,28,1.414"), "{csv}");
        assert!(csv.contains("\nbounces-3,original,1,20,,,"), "{csv}");
        let json: Value =
            serde_json::from_slice(&std::fs::read(out.join("table.json")).unwrap()).unwrap();
        assert_eq!(
            json["cells"][0]["values"]["psnr_srgb_db"]["values"],
            json!([27.0, 29.0])
        );
        assert_eq!(json["cells"][0]["published"]["psnr_srgb_db"], 28.65);
    }

    #[test]
    fn cells_are_filled_once_and_from_their_condition() {
        let root = tempfile::tempdir().unwrap();
        let folder = evaluated(root.path(), "a", 27.0);
        let twice = cell("path", vec![folder.clone()], None);
        let other = RepeatCell {
            condition: "relit".to_owned(),
            ..twice.clone()
        };
        for (cells, part) in [
            (vec![twice.clone(), twice.clone()], "path"),
            (vec![other], "no condition is called `relit`"),
        ] {
            let metrics = vec!["psnr_srgb_db".to_owned()];
            let error = tabulate_repeats(&RepeatOptions { cells, metrics }, Vec::new());
            let message = error.unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
