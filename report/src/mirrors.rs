//! The table of the mirrors that training has found.

use crate::error::Result;
use crate::lamps::spaced;
use crate::run::read_json;
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

/// The content of `mirrors.json`, as training writes it.
#[derive(Deserialize)]
struct Listed {
    mirrors: Vec<Mirror>,
}

#[derive(Deserialize)]
struct Mirror {
    centre: [f32; 3],
    edges: [[f32; 3]; 2],
    is_round: bool,
    reflectance: [f32; 3],
    num_views: usize,
    explained: f32,
}

impl MirrorTable {
    /// The table of the mirrors that the file `path` lists; `None` if it is not there.
    ///
    /// # Errors
    /// If the file cannot be read, or is not a list of mirrors.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>> {
        let listed: Option<Listed> = read_json(path)?;
        Ok(listed.map(|listed| Self {
            headings: HEADINGS,
            rows: (1..).zip(&listed.mirrors).map(row).collect(),
        }))
    }
}

fn row((number, mirror): (usize, &Mirror)) -> [String; 6] {
    let decimals = |value: f32| format!("{value:.2}");
    let length = |edge: [f32; 3]| edge.map(|along| along * along).iter().sum::<f32>().sqrt();
    let size = mirror.edges.map(|edge| decimals(length(edge))).join(" × ");
    [
        number.to_string(),
        spaced(mirror.centre, decimals),
        size + if mirror.is_round { ", round" } else { "" },
        spaced(mirror.reflectance, decimals),
        mirror.num_views.to_string(),
        format!("{:.0} %", 100.0 * mirror.explained),
    ]
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
        assert_eq!(MirrorTable::read(&path).unwrap(), None);
        let write = |content: &str| std::fs::write(&path, content).unwrap();
        write(&json!({ "iteration": 4750, "mirrors": [mirror] }).to_string());
        let row = &MirrorTable::read(&path).unwrap().unwrap().rows[0];
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
