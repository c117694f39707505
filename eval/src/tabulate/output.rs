//! The table as files.

use super::{FILES, ModeTable, TableCell, TableRow};
use crate::error::Result;
use crate::metrics::Metric;
use crate::report::grid::{Column, Grid, shown};
use crate::report::{append, csv_field, csv_value, write_all};
use serde_json::{Map, Value, json};
use std::path::Path;

impl ModeTable {
    /// Writes the [`FILES`] into `out`, each atomically.
    ///
    /// # Errors
    /// [`SceneError::Io`](eagpt_scene::SceneError) with the file's name.
    pub fn write(&self, out: &Path) -> Result<()> {
        let [markdown, latex, csv, json] = FILES;
        let texts = [
            (markdown, self.markdown()),
            (latex, self.grid().latex()),
            (csv, self.csv()),
        ];
        write_all(out, texts, (json, self.json()))
    }

    /// The table as Markdown, with notes on the provenance of each number.
    pub fn markdown(&self) -> String {
        self.grid().markdown()
    }

    fn grid(&self) -> Grid {
        let metrics = || self.metrics.iter().map(|metric| Column::of(metric));
        let mut columns: Vec<Column> = self.conditions.iter().flat_map(|_| metrics()).collect();
        columns.push(Column {
            heading: "s/frame".to_owned(),
            better: None,
        });
        let groups = self.conditions.iter();
        let mut groups: Vec<(String, usize)> = groups
            .map(|name| (name.clone(), self.metrics.len()))
            .collect();
        groups.push((String::new(), 1));
        let rows = self.rows.iter().map(|row| {
            let mut values: Vec<String> =
                row.cells.iter().flat_map(|cell| self.shown(cell)).collect();
            values.push(shown(row.seconds_per_frame(), 2));
            (row.name.clone(), values)
        });
        Grid {
            corner: "mode",
            groups,
            columns,
            rows: rows.collect(),
            mean: None,
            notes: self.notes(),
        }
    }

    fn shown(&self, cell: &Option<TableCell>) -> Vec<String> {
        let value = |i: usize| cell.as_ref().and_then(|cell| cell.values[i]);
        let metrics = self.metrics.iter().enumerate();
        metrics
            .map(|(i, metric)| shown(value(i), metric.num_decimals))
            .collect()
    }

    /// Notes on the provenance of each number.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec!["s/frame: mean over the conditions of a row".to_owned()];
        for (row, condition, cell) in self.cells() {
            let from = &cell.provenance;
            let spp = from.spp.map(|spp| format!(", {spp} spp"));
            let denoiser = from
                .denoiser
                .as_ref()
                .map(|name| format!(", denoised by {name}"));
            notes.push(format!(
                "{row}, {condition}: {}{}{}",
                cell.folder.display(),
                spp.unwrap_or_default(),
                denoiser.unwrap_or_default()
            ));
        }
        notes
    }

    fn cells(&self) -> impl Iterator<Item = (&str, &str, &TableCell)> {
        self.rows.iter().flat_map(|row| {
            let cells = self.conditions.iter().zip(&row.cells);
            cells.filter_map(|(condition, cell)| {
                Some((row.name.as_str(), condition.as_str(), cell.as_ref()?))
            })
        })
    }

    fn csv(&self) -> String {
        let mut text = "mode,condition".to_owned();
        for metric in &self.metrics {
            append(&mut text, format_args!(",{}", metric.key));
        }
        text.push_str(",seconds_per_frame,spp,denoiser\n");
        for (row, condition, cell) in self.cells() {
            append(
                &mut text,
                format_args!("{},{}", csv_field(row), csv_field(condition)),
            );
            let from = &cell.provenance;
            for value in cell.values.iter().chain([&from.seconds_per_frame]) {
                csv_value(&mut text, *value);
            }
            let spp = from.spp.map(|spp| spp.to_string()).unwrap_or_default();
            let denoiser = csv_field(from.denoiser.as_deref().unwrap_or_default());
            append(&mut text, format_args!(",{spp},{denoiser}\n"));
        }
        text
    }

    fn json(&self) -> serde_json::Result<Value> {
        let keyed = |value: &dyn Fn(usize, &Metric) -> Option<Value>| -> Map<String, Value> {
            let metrics = self.metrics.iter().enumerate();
            metrics
                .filter_map(|(i, metric)| Some((metric.key.to_owned(), value(i, metric)?)))
                .collect()
        };
        let cell = |cell: &TableCell| -> serde_json::Result<Value> {
            Ok(json!({
                "folder": cell.folder,
                "render": serde_json::to_value(&cell.provenance)?,
                // As in metrics.json: null is infinite, absent is absent.
                "mean": keyed(&|i, _| cell.values[i].map(|value| json!(value))),
            }))
        };
        let row = |row: &TableRow| -> serde_json::Result<Value> {
            let cells = self.conditions.iter().zip(&row.cells);
            let cells = cells
                .map(|(name, found)| {
                    Ok((name.clone(), found.as_ref().map(cell).transpose()?.into()))
                })
                .collect::<serde_json::Result<Map<_, _>>>()?;
            Ok(json!({
                "name": row.name,
                "seconds_per_frame": row.seconds_per_frame(),
                "conditions": cells,
            }))
        };
        Ok(json!({
            "conditions": self.conditions,
            "definitions": keyed(&|_, metric| Some(json!(metric.definition))),
            "rows": self.rows.iter().map(row).collect::<serde_json::Result<Vec<_>>>()?,
        }))
    }
}
