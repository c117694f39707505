//! The table of the mirrors that training has found.

use crate::error::{ReportError, Result};
use eagpt_scene::files;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Headings of the columns.
const HEADINGS: [&str; 6] = [
    "mirror",
    "place",
    "size",
    "reflectance",
    "views",
    "explained",
];

/// Mirrors as texts.
#[derive(Debug, PartialEq, Eq, Serialize)]
pub(crate) struct MirrorTable {
    headings: [&'static str; 6],
    rows: Vec<[String; 6]>,
}

/// What training writes (`mirrors.json`).
#[derive(Deserialize)]
struct Listed {
    mirrors: Vec<Mirror>,
}

#[derive(Deserialize)]
struct Mirror {
    centre: [f64; 3],
    edges: [[f64; 3]; 2],
    is_round: bool,
    reflectance: [f64; 3],
    num_views: usize,
    explained: f64,
}

impl MirrorTable {
    /// The table of the mirrors that the file `path` lists.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a list of mirrors.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = files::read(path)?;
        let listed: Listed =
            serde_json::from_slice(&text).map_err(|e| ReportError::content(path, &e))?;
        let rows = listed.mirrors.iter().zip(1..);
        Ok(Self {
            headings: HEADINGS,
            rows: rows.map(|(mirror, number)| mirror.row(number)).collect(),
        })
    }
}

impl Mirror {
    fn row(&self, number: usize) -> [String; 6] {
        let spaced = |values: [f64; 3]| values.map(|value| format!("{value:.2}")).join(" ");
        let length = |edge: [f64; 3]| edge.map(|value| value * value).iter().sum::<f64>().sqrt();
        let size = self.edges.map(|edge| format!("{:.2}", length(edge)));
        [
            number.to_string(),
            spaced(self.centre),
            size.join(" × ") + if self.is_round { ", round" } else { "" },
            spaced(self.reflectance),
            self.num_views.to_string(),
            format!("{:.0} %", 100.0 * self.explained),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_mirror_is_a_row() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mirrors.json");
        let mirror = json!({
            "centre": [1.0, -0.126, 1.5],
            "edges": [[0.0, 0.6, 0.0], [0.0, 0.6, 0.8]],
            "is_round": true,
            "reflectance": [0.9, 0.85, 0.8],
            "num_views": 12,
            "explained": 0.934,
        });
        let write = |content: &str| std::fs::write(&path, content).unwrap();
        write(&json!({ "iteration": 4750, "mirrors": [mirror] }).to_string());
        let row = &MirrorTable::read(&path).unwrap().rows[0];
        let expected = [
            "1",
            "1.00 -0.13 1.50",
            "0.60 × 1.00, round",
            "0.90 0.85 0.80",
            "12",
            "93 %",
        ];
        assert_eq!(*row, expected);
        write("[]");
        let error = MirrorTable::read(&path).unwrap_err().to_string();
        assert!(error.contains("mirrors.json"), "{error}");
    }
}
