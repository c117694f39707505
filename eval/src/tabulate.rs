//! The table of the paper: rendering modes as rows, lightings of the room as columns.
//!
//! Reads the `metrics.json` of evaluations, of one condition each or of several, and puts the means
//! of each condition into the row of its mode of rendering. Its files are `table.md`, `table.tex`,
//! `table.csv` (one line for each mode and condition) and, last, `table.json`.

mod output;
mod read;
pub mod repeats;

#[cfg(test)]
mod tests;

use crate::error::{EvalError, Result};
use crate::job::Provenance;
use crate::metrics::{METRICS, Metric};
use crate::scene_metrics::mean;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::PathBuf;

/// Modes in the order of the paper; others come after them.
const MODES: [&str; 4] = ["0-bounce", "1-bounce", "path", "baked"];
/// Files of [`ModeTable::write`].
pub const FILES: [&str; 4] = ["table.md", "table.tex", "table.csv", "table.json"];
/// Metrics of the table unless others are asked for.
pub const DEFAULT_METRICS: [&str; 3] = ["psnr_srgb_db", "ssim_srgb", "flip_hdr"];

/// Options of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableOptions {
    /// Evaluations, at least one.
    pub folders: Vec<TableFolder>,
    /// Keys of [`METRICS`], at least one.
    pub metrics: Vec<String>,
}

/// An evaluation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableFolder {
    /// Folder with a `metrics.json`.
    pub folder: PathBuf,
    /// Name of its row; by default the mode of its renders.
    #[serde(default)]
    pub row: Option<String>,
}

impl fmt::Display for TableFolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.row {
            Some(row) => write!(f, "{row}={}", self.folder.display()),
            None => write!(f, "{}", self.folder.display()),
        }
    }
}

/// A table of means.
#[derive(Debug, Clone)]
pub struct ModeTable {
    /// Names of the conditions, in the order of appearance.
    pub conditions: Vec<String>,
    /// The metrics of each condition.
    pub metrics: Vec<&'static Metric>,
    /// The modes: those of the paper in its order, then others in the order of appearance.
    pub rows: Vec<TableRow>,
}

/// A mode of rendering.
#[derive(Debug, Clone)]
pub struct TableRow {
    /// Its name.
    pub name: String,
    /// Its evaluation under each condition; `None` where there is none.
    pub cells: Vec<Option<TableCell>>,
}

/// A mode of rendering under one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct TableCell {
    /// Folder it was read from.
    pub folder: PathBuf,
    /// Mean of each metric of the table; `None` where the evaluation lacks it, infinite for equal
    /// images.
    pub values: Vec<Option<f64>>,
    /// Provenance of the renders.
    pub(crate) provenance: Provenance,
}

impl TableRow {
    /// Seconds per frame: the mean over the conditions that have it.
    pub(crate) fn seconds_per_frame(&self) -> Option<f64> {
        let cells = self.cells.iter().flatten();
        mean(cells.filter_map(|cell| cell.provenance.seconds_per_frame))
    }
}

/// Puts evaluations into one table, which [`ModeTable::write`] writes.
///
/// # Errors
/// [`EvalError`] naming the file and field: no `metrics.json` or one of another program, renders
/// whose mode is not known and that were given no row, two evaluations for one cell;
/// [`EvalError::Option`] for an unknown metric.
pub fn tabulate(options: &TableOptions) -> Result<ModeTable> {
    let metrics = options
        .metrics
        .iter()
        .map(|key| metric(key))
        .collect::<Result<Vec<_>>>()?;
    let mut table = ModeTable {
        conditions: Vec::new(),
        metrics,
        rows: Vec::new(),
    };
    for folder in &options.folders {
        for found in read::conditions(folder, &table.metrics)? {
            table.put(found)?;
        }
    }
    let rank = |row: &TableRow| MODES.iter().position(|mode| *mode == row.name);
    // The sort is stable, so that other modes stay in their order.
    table
        .rows
        .sort_by_key(|row| rank(row).unwrap_or(MODES.len()));
    for row in &mut table.rows {
        row.cells.resize(table.conditions.len(), None);
    }
    Ok(table)
}

fn metric(key: &str) -> Result<&'static Metric> {
    let found = METRICS.iter().find(|metric| metric.key == key);
    found.ok_or_else(|| EvalError::Option {
        field: "metrics",
        value: key.to_owned(),
        expected: "a key of `mean` in metrics.json, as psnr_srgb_db",
    })
}

impl ModeTable {
    fn put(&mut self, found: read::Found) -> Result<()> {
        let column = position_or_push(
            &mut self.conditions,
            |name| *name == found.condition,
            || found.condition.clone(),
        );
        let row = position_or_push(
            &mut self.rows,
            |row| row.name == found.row,
            || TableRow {
                name: found.row.clone(),
                cells: Vec::new(),
            },
        );
        let cells = &mut self.rows[row].cells;
        if cells.len() <= column {
            cells.resize(column + 1, None);
        }
        if let Some(earlier) = &cells[column] {
            return Err(EvalError::SameCell {
                folder: found.cell.folder,
                earlier: earlier.folder.clone(),
                row: found.row,
                condition: found.condition,
            });
        }
        cells[column] = Some(found.cell);
        Ok(())
    }
}

fn position_or_push<T>(
    items: &mut Vec<T>,
    is_it: impl FnMut(&T) -> bool,
    new: impl FnOnce() -> T,
) -> usize {
    items.iter().position(is_it).unwrap_or_else(|| {
        items.push(new());
        items.len() - 1
    })
}
