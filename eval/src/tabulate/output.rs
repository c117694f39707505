//! The table of modes in all its forms.

use super::{ModeTable, Table, TableCell, seconds_per_frame};
use crate::metrics::Metric;
use crate::report::grid::{Column, Grid, shown};
use crate::report::{csv_text, csv_value};
use serde_json::{Map, Value, json};

impl ModeTable {
    pub(super) fn table(&self) -> Table {
        Table {
            grid: self.grid(),
            csv: self.csv(),
            json: self.json(),
        }
    }

    fn grid(&self) -> Grid {
        let metrics = || self.metrics.iter().map(|metric| Column::of(metric));
        let mut columns: Vec<Column> = self
            .cells
            .conditions
            .iter()
            .flat_map(|_| metrics())
            .collect();
        columns.push(Column {
            heading: "s/frame".to_owned(),
            better: None,
        });
        let groups = self.cells.conditions.iter();
        let mut groups: Vec<(String, usize)> = groups
            .map(|name| (name.clone(), self.metrics.len()))
            .collect();
        groups.push((String::new(), 1));
        let rows = self.cells.rows.iter().map(|(name, cells)| {
            let of_conditions = self.cells.of_row(cells).flat_map(|cell| self.shown(cell));
            let seconds = shown(seconds_per_frame(cells), 2);
            (name.clone(), of_conditions.chain([seconds]).collect())
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

    fn shown(&self, cell: Option<&TableCell>) -> Vec<String> {
        let value = |i: usize| cell.and_then(|cell| cell.values[i]);
        let metrics = self.metrics.iter().enumerate();
        metrics
            .map(|(i, metric)| shown(value(i), metric.num_decimals))
            .collect()
    }

    /// Notes on the provenance of each number.
    fn notes(&self) -> Vec<String> {
        let mut notes = vec!["s/frame: mean over the conditions of a row".to_owned()];
        for (row, condition, cell) in self.cells.iter() {
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

    fn csv(&self) -> String {
        let keys = self.metrics.iter().map(|metric| metric.key);
        let heading = ["mode", "condition"].into_iter().chain(keys);
        let heading = heading.chain(["seconds_per_frame", "spp", "denoiser"]);
        let rows = self.cells.iter().map(|(row, condition, cell)| {
            let from = &cell.provenance;
            let values = cell.values.iter().chain([&from.seconds_per_frame]);
            let spp = from.spp.map(|spp| spp.to_string()).unwrap_or_default();
            [row.to_owned(), condition.to_owned()]
                .into_iter()
                .chain(values.map(|value| csv_value(*value)))
                .chain([spp, from.denoiser.clone().unwrap_or_default()])
        });
        csv_text(heading.map(str::to_owned), rows)
    }

    fn json(&self) -> Value {
        let keyed = |value: &dyn Fn(usize, &Metric) -> Option<Value>| -> Map<String, Value> {
            let metrics = self.metrics.iter().enumerate();
            metrics
                .filter_map(|(i, metric)| Some((metric.key.to_owned(), value(i, metric)?)))
                .collect()
        };
        let cell = |cell: &TableCell| {
            json!({
                "folder": cell.folder,
                "render": cell.provenance,
                // As in metrics.json: null is infinite, absent is absent.
                "mean": keyed(&|i, _| cell.values[i].map(|value| json!(value))),
            })
        };
        let rows = self.cells.rows.iter().map(|(name, cells)| {
            let of_conditions = self.cells.conditions.iter().zip(self.cells.of_row(cells));
            let of_conditions: Map<_, _> = of_conditions
                .map(|(name, found)| (name.clone(), found.map(cell).into()))
                .collect();
            json!({
                "name": name,
                "seconds_per_frame": seconds_per_frame(cells),
                "conditions": of_conditions,
            })
        });
        json!({
            "conditions": self.cells.conditions,
            "definitions": keyed(&|_, metric| Some(json!(metric.definition))),
            "rows": rows.collect::<Vec<_>>(),
        })
    }
}
