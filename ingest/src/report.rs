//! The report of stacks to take again, for people (`report.html`) and programs (`report.json`).
//!
//! The page is one file that needs no script and no network: pictures are embedded, charts are
//! inline SVG.

mod curves;

use crate::capture::{Capture, StackReport};
use crate::error::{IngestError, Result};
use crate::problem::Problem;
use crate::warnings::LIMITS;
use curves::Plot;
use eagpt_scene::{SceneError, files};
use minijinja::{AutoEscape, Environment, Value};
use serde::Serialize;
use std::path::Path;

const TEMPLATE: &str = include_str!("report.html");

/// Values of the template.
#[derive(Debug, Serialize)]
struct Page<'a> {
    capture_path: String,
    capture: &'a Capture,
    white_balance: String,
    scale: String,
    version: &'static str,
    num_with_warnings: usize,
    left_out: Vec<String>,
    rows: Vec<Row<'a>>,
    cells: Vec<Vec<String>>,
    titles: Vec<[&'static str; 2]>,
    charts: Vec<Chart>,
    response: Option<Plot>,
    chart_width: f64,
    chart_height: f64,
}

/// Measures of one stack, by name.
#[derive(Debug, Serialize)]
struct Row<'a> {
    name: String,
    warnings: &'a [String],
    num_shots: usize,
    values: Vec<f64>,
    thumbnail: &'a str,
}

/// A chart: one bar for each stack.
#[derive(Debug, Serialize)]
struct Chart {
    title: &'static str,
    unit: &'static str,
    bars: Vec<Bar>,
    /// Height of the line that a warning begins at, from the top; `None`: there is none.
    limit: Option<f64>,
    largest: String,
}

#[derive(Debug, Serialize)]
struct Bar {
    x: f64,
    y: f64,
    width: f64,
    height: f64,
    name: String,
    value: String,
    bad: bool,
}

/// A measure of the table and the charts.
struct Measure {
    title: &'static str,
    unit: &'static str,
    of: fn(&StackReport) -> f64,
    limit: Option<f64>,
    digits: usize,
}

const CHART_WIDTH: f64 = 720.0;
const CHART_HEIGHT: f64 = 60.0;

const MEASURES: [Measure; 8] = [
    Measure {
        title: "clipped in all shots",
        unit: "%",
        of: |stack| 100.0 * stack.quality.clipped_share,
        limit: Some(100.0 * LIMITS.clipped),
        digits: 3,
    },
    Measure {
        title: "dark in all shots",
        unit: "%",
        of: |stack| 100.0 * stack.quality.dark_share,
        limit: Some(100.0 * LIMITS.dark),
        digits: 2,
    },
    Measure {
        title: "noise floor",
        unit: "",
        of: |stack| stack.quality.noise_floor,
        limit: None,
        digits: 6,
    },
    Measure {
        title: "range",
        unit: "stops",
        of: |stack| stack.quality.range_stops,
        limit: None,
        digits: 1,
    },
    Measure {
        title: "error of a stated exposure",
        unit: "%",
        of: |stack| 100.0 * stack.quality.exposure_error,
        limit: Some(100.0 * LIMITS.exposure_error),
        digits: 2,
    },
    Measure {
        title: "changed between two shots",
        unit: "%",
        of: |stack| 100.0 * stack.quality.moved_share,
        limit: Some(100.0 * LIMITS.moved),
        digits: 2,
    },
    Measure {
        title: "sharpness",
        unit: "",
        of: |stack| stack.quality.sharpness,
        limit: None,
        digits: 3,
    },
    Measure {
        title: "largest value",
        unit: "",
        of: |stack| stack.quality.largest,
        limit: None,
        digits: 2,
    },
];

/// `report.json`: the quality measures without the decisions.
#[derive(Debug, Serialize)]
struct JsonReport<'a> {
    num_stacks: usize,
    num_with_warnings: usize,
    left_out: &'a [Problem],
    notes: &'a [String],
    stacks: Vec<JsonStack<'a>>,
}

#[derive(Debug, Serialize)]
struct JsonStack<'a> {
    condition: &'a str,
    position: &'a str,
    warnings: &'a [String],
    quality: &'a crate::capture::Quality,
}

/// Writes `report.json` and `report.html`; `thumbnails` are base64 JPEGs in the order of the
/// stacks.
pub(crate) fn write(
    out: &Path,
    capture_path: &Path,
    capture: &Capture,
    thumbnails: &[&str],
) -> Result<()> {
    let num_with_warnings = capture
        .stacks
        .iter()
        .filter(|stack| !stack.warnings.is_empty())
        .count();
    let json = JsonReport {
        num_stacks: capture.stacks.len(),
        num_with_warnings,
        left_out: &capture.left_out,
        notes: &capture.notes,
        stacks: capture
            .stacks
            .iter()
            .map(|stack| JsonStack {
                condition: &stack.condition,
                position: &stack.position,
                warnings: &stack.warnings,
                quality: &stack.quality,
            })
            .collect(),
    };
    files::write_json(&out.join("report.json"), &json)?;
    let path = out.join("report.html");
    let rows: Vec<Row<'_>> = capture
        .stacks
        .iter()
        .zip(thumbnails)
        .map(|(stack, thumbnail)| Row {
            name: name(stack, capture),
            warnings: &stack.warnings,
            num_shots: stack.shots.len(),
            values: MEASURES.iter().map(|measure| (measure.of)(stack)).collect(),
            thumbnail,
        })
        .collect();
    let cells: Vec<Vec<String>> = rows
        .iter()
        .map(|row| {
            let values = row.values.iter().zip(&MEASURES);
            values
                .map(|(value, measure)| format!("{value:.*}", measure.digits))
                .collect()
        })
        .collect();
    let charts: Vec<Chart> = (0..MEASURES.len())
        .map(|index| chart(index, &rows))
        .collect();
    let titles: Vec<[&str; 2]> = MEASURES
        .iter()
        .map(|measure| [measure.title, measure.unit])
        .collect();
    let left_out: Vec<String> = capture.left_out.iter().map(ToString::to_string).collect();
    let white_balance = capture.color.white_balance;
    let page = render(&Page {
        capture_path: capture_path.display().to_string(),
        capture,
        white_balance: white_balance.map(|v| format!("{v:.4}")).join(", "),
        scale: format!("{:.6}", capture.scale),
        version: env!("CARGO_PKG_VERSION"),
        num_with_warnings,
        left_out,
        rows,
        cells,
        titles,
        charts,
        response: capture.response.as_ref().map(Plot::new),
        chart_width: CHART_WIDTH,
        chart_height: CHART_HEIGHT,
    });
    let page = page.map_err(|error| {
        IngestError::Scene(SceneError::invalid(&path, "template", error.to_string()))
    })?;
    Ok(files::write_bytes_atomic(&path, page.as_bytes())?)
}

fn render(page: &Page<'_>) -> Result<String, Box<dyn std::error::Error>> {
    let values: Value = serde_json::from_str(&serde_json::to_string(page)?)?;
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("report", TEMPLATE)?;
    Ok(environment.get_template("report")?.render(values)?)
}

fn name(stack: &StackReport, capture: &Capture) -> String {
    if capture.conditions.len() > 1 {
        format!("{}/{}", stack.condition, stack.position)
    } else {
        stack.position.clone()
    }
}

fn chart(index: usize, rows: &[Row<'_>]) -> Chart {
    let measure = &MEASURES[index];
    let values = rows.iter().map(|row| row.values[index]);
    let largest = values.clone().fold(measure.limit.unwrap_or(0.0), f64::max);
    let top = if largest > 0.0 { largest } else { 1.0 };
    let step = CHART_WIDTH / rows.len().max(1) as f64;
    let bars = rows
        .iter()
        .zip(values)
        .enumerate()
        .map(|(place, (row, value))| {
            let height = (value / top * CHART_HEIGHT).clamp(0.5, CHART_HEIGHT);
            Bar {
                x: place as f64 * step,
                y: CHART_HEIGHT - height,
                width: (step * 0.85).min(40.0),
                height,
                name: row.name.clone(),
                value: format!("{value:.*}", measure.digits),
                bad: measure.limit.is_some_and(|limit| value > limit),
            }
        })
        .collect();
    Chart {
        title: measure.title,
        unit: measure.unit,
        bars,
        limit: measure
            .limit
            .map(|limit| CHART_HEIGHT * (1.0 - limit / top)),
        largest: format!("{largest:.*}", measure.digits),
    }
}
