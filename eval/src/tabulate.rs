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
use crate::metrics::{METRICS, Metric};
use crate::provenance::Provenance;
use crate::report::grid::Grid;
use crate::report::write_all;
use crate::scene_metrics::mean;
use serde::Serialize;
use serde_json::Value;
use std::fmt;
use std::path::{Path, PathBuf};

/// Modes in the order of the paper; others come after them.
const MODES: [&str; 4] = ["0-bounce", "1-bounce", "path", "baked"];
/// Files of [`Table::write`].
pub const FILES: [&str; 4] = ["table.md", "table.tex", "table.csv", "table.json"];
/// Metrics of the table unless others are asked for.
pub const DEFAULT_METRICS: [&str; 4] = ["psnr_srgb_db", "ssim_srgb", "flip_hdr", "exposure_scale"];

/// Options of the table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableOptions {
    /// Evaluations, at least one.
    pub folders: Vec<TableFolder>,
    /// Keys of [`METRICS`], at least one.
    pub metrics: Vec<String>,
}

/// An evaluation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TableFolder {
    /// Folder with a `metrics.json`.
    pub folder: PathBuf,
    /// Name of its row; by default the mode of its renders.
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

/// A table of means in all its forms.
#[derive(Debug)]
pub struct Table {
    grid: Grid,
    csv: String,
    json: Value,
}

impl Table {
    /// Writes the [`FILES`] into `out`, each atomically.
    ///
    /// # Errors
    /// [`SceneError::Io`](eagpt_scene::SceneError) with the file's name.
    pub fn write(&self, out: &Path) -> Result<()> {
        let [markdown, latex, csv, json] = FILES;
        let texts = [
            (markdown, self.markdown()),
            (latex, self.grid.latex()),
            (csv, self.csv.clone()),
        ];
        write_all(out, texts, (json, &self.json))
    }

    /// The table as Markdown, with notes on the provenance of each number.
    pub fn markdown(&self) -> String {
        self.grid.markdown()
    }

    /// Number of rows.
    pub fn num_rows(&self) -> usize {
        self.grid.rows.len()
    }
}

/// The means of modes.
struct ModeTable {
    /// The metrics of each condition.
    metrics: Vec<&'static Metric>,
    /// The modes: those of the paper in its order, then others in the order of appearance.
    cells: Cells<TableCell>,
}

/// Cells by row and condition, both in the order of appearance.
#[derive(Debug, Clone)]
struct Cells<T> {
    conditions: Vec<String>,
    /// The cells of each row by condition; conditions at the end may be missing.
    rows: Vec<(String, Vec<Option<T>>)>,
}

/// A mode of rendering under one condition.
#[derive(Debug, Clone, PartialEq)]
struct TableCell {
    /// Folder it was read from.
    folder: PathBuf,
    /// Mean of each metric of the table; `None` where the evaluation lacks it, infinite for equal
    /// images.
    values: Vec<Option<f64>>,
    /// Provenance of the renders.
    provenance: Provenance,
}

/// Seconds per frame of a row: the mean over the conditions that have it.
fn seconds_per_frame(cells: &[Option<TableCell>]) -> Option<f64> {
    mean(
        cells
            .iter()
            .flatten()
            .filter_map(|cell| cell.provenance.seconds_per_frame),
    )
}

impl<T> Cells<T> {
    fn new() -> Self {
        Self {
            conditions: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Puts a cell into its place; the cell that is there already, if there is one.
    fn put(&mut self, row: &str, condition: &str, cell: T) -> Result<(), &T> {
        let same = |name: &String| name == condition;
        let column = self.conditions.iter().position(same).unwrap_or_else(|| {
            self.conditions.push(condition.to_owned());
            self.conditions.len() - 1
        });
        let row = self
            .rows
            .iter()
            .position(|(name, _)| name == row)
            .unwrap_or_else(|| {
                self.rows.push((row.to_owned(), Vec::new()));
                self.rows.len() - 1
            });
        let cells = &mut self.rows[row].1;
        if cells.len() <= column {
            cells.resize_with(column + 1, || None);
        }
        match &mut cells[column] {
            Some(earlier) => Err(earlier),
            empty => {
                *empty = Some(cell);
                Ok(())
            }
        }
    }

    /// The cell of a row's cells under each condition.
    fn of_row<'a>(&self, cells: &'a [Option<T>]) -> impl Iterator<Item = Option<&'a T>> {
        (0..self.conditions.len()).map(|column| cells.get(column)?.as_ref())
    }

    /// Row, condition and cell of all that are there.
    fn iter(&self) -> impl Iterator<Item = (&str, &str, &T)> {
        self.rows.iter().flat_map(|(row, cells)| {
            let cells = self.conditions.iter().zip(cells);
            cells.filter_map(|(condition, cell)| {
                Some((row.as_str(), condition.as_str(), cell.as_ref()?))
            })
        })
    }
}

/// Puts evaluations into one table, which [`Table::write`] writes.
///
/// # Errors
/// [`EvalError`] naming the file and field: no `metrics.json` or one of another program, renders
/// whose mode is not known and that were given no row, two evaluations for one cell;
/// [`EvalError::Option`] for an unknown metric.
pub fn tabulate(options: &TableOptions) -> Result<Table> {
    let metrics = options
        .metrics
        .iter()
        .map(|key| metric(key))
        .collect::<Result<Vec<_>>>()?;
    let mut cells = Cells::new();
    for folder in &options.folders {
        for found in read::conditions(folder, &metrics)? {
            let folder = found.cell.folder.clone();
            cells
                .put(&found.row, &found.condition, found.cell)
                .map_err(|earlier| EvalError::SameCell {
                    folder,
                    earlier: earlier.folder.clone(),
                    row: found.row.clone(),
                    condition: found.condition.clone(),
                })?;
        }
    }
    let rank = |name: &str| MODES.iter().position(|mode| *mode == name);
    // The sort is stable, so that other modes stay in their order.
    cells
        .rows
        .sort_by_key(|(name, _)| rank(name).unwrap_or(MODES.len()));
    Ok(ModeTable { metrics, cells }.table())
}

fn metric(key: &str) -> Result<&'static Metric> {
    let found = METRICS.iter().find(|metric| metric.key == key);
    found.ok_or_else(|| EvalError::Option {
        field: "metrics",
        value: key.to_owned(),
        expected: "a key of `mean` in metrics.json, as psnr_srgb_db",
    })
}
