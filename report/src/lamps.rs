//! The table of the lamps of a scene, for the page and for terminals.

use eagpt_scene::{Lamp, Lamps};
use serde::Serialize;

/// Headings of the columns.
pub const HEADINGS: [&str; 10] = [
    "lamp",
    "shape",
    "place",
    "size",
    "radiance",
    "power",
    "views",
    "pixels",
    "deviation",
    "factor",
];

/// Lamps as texts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LampTable {
    /// Headings of the columns.
    pub headings: [&'static str; 10],
    /// A row for each lamp, in the order of the file.
    pub rows: Vec<[String; 10]>,
}

impl LampTable {
    /// The table of these lamps.
    pub fn new(lamps: &Lamps) -> Self {
        Self {
            headings: HEADINGS,
            rows: lamps.lamps.iter().map(row).collect(),
        }
    }
}

fn row(lamp: &Lamp) -> [String; 10] {
    let shape = if lamp.one_sided {
        format!("{}, one side", lamp.shape)
    } else {
        lamp.shape.to_string()
    };
    [
        lamp.name.clone(),
        shape,
        spaced(lamp.centre, |value| format!("{value:.2}")),
        lamp.size.map(|value| format!("{value:.2}")).join(" × "),
        spaced(lamp.radiance, rounded),
        spaced(lamp.power, rounded),
        lamp.views.len().to_string(),
        lamp.num_pixels.to_string(),
        format!("{:.1} %", 100.0 * lamp.deviation),
        spaced(lamp.factor, |value| format!("{value:.2}")),
    ]
}

pub(crate) fn spaced(values: [f32; 3], shown: impl Fn(f32) -> String) -> String {
    values.map(shown).join(" ")
}

/// Three significant digits: lamps differ by orders of magnitude.
fn rounded(value: f32) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 => 2,
        v if v >= 0.1 => 3,
        _ => 4,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::LampShape;

    #[test]
    fn a_lamp_is_a_row() {
        let lamp = Lamp {
            name: "wall-1".to_owned(),
            shape: LampShape::Panel,
            centre: [2.0, -0.126, 1.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            size: [1.0, 0.4, 0.0],
            one_sided: true,
            bars: false,
            shade: 0.0,
            reach: 0.0,
            area: 0.4,
            radiance: [330.4, 24.06, 1.505],
            power: [0.25, 0.05, 0.0],
            num_gaussians: 40,
            views: vec!["a".to_owned(), "b".to_owned()],
            num_pixels: 900,
            deviation: 0.042,
            factor: [1.0, 0.9, 1.1],
        };
        let table = LampTable::new(&Lamps { lamps: vec![lamp] });
        assert_eq!(
            table.rows[0],
            [
                "wall-1",
                "panel, one side",
                "2.00 -0.13 1.00",
                "1.00 × 0.40 × 0.00",
                "330 24.1 1.50",
                "0.250 0.0500 0.0000",
                "2",
                "900",
                "4.2 %",
                "1.00 0.90 1.10",
            ]
        );
    }
}
