//! The files of an evaluation.

pub(crate) mod grid;
mod tables;

use crate::error::Result;
use crate::evaluation::{Conditions, Evaluation, Mean};
use crate::metrics::METRICS;
use eagpt_scene::{SceneError, files};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::Path;

/// File of an evaluation for programs: means, views, definitions.
pub const METRICS_FILE: &str = "metrics.json";
const CSV: &str = "metrics.csv";
const MARKDOWN: &str = "table.md";
const LATEX: &str = "table.tex";
/// Names of all files of an evaluation.
pub const RESULT_FILES: [&str; 4] = [METRICS_FILE, CSV, MARKDOWN, LATEX];

/// Definitions of the other fields of `metrics.json`.
const MORE_DEFINITIONS: [(&str, &str); 4] = [
    (
        "light_change",
        "sum of luminance of the references over that under the earlier light, over the pixels of all views that emit under neither; null without an earlier light",
    ),
    (
        "regions",
        "emitter: emission above 0.1; lit: else, luminance above light_change times that under the earlier light; shadow: else; surface: no emitter, earlier light not known. PSNR and luminance over the pixels of all views; PSNR as psnr_srgb_db and psnr_linear_db",
    ),
    (
        "split",
        "rule of the dataset that was rendered, and subset the views of it that were measured; null where neither an option nor record.json of the renders tells",
    ),
    (
        "render",
        "from the record.json of the renders, null where it does not tell; seconds_per_frame: mean wall time of the evaluated views",
    ),
];

/// Writes all files, each atomically, `metrics.json` last.
///
/// # Errors
/// [`SceneError::Io`] with the file's name.
pub(crate) fn write(out: &Path, evaluation: &Evaluation) -> Result<()> {
    let views = tables::views(evaluation);
    let regions = tables::regions(evaluation).map(|grid| grid.markdown());
    let texts = [
        (CSV, csv(evaluation)),
        (MARKDOWN, joined(views.markdown(), regions)),
        (LATEX, views.latex()),
    ];
    write_all(out, texts, (METRICS_FILE, &json(evaluation)))
}

/// As [`write`] for several conditions, whose own files are elsewhere.
///
/// # Errors
/// [`SceneError::Io`] with the file's name.
pub(crate) fn write_conditions(out: &Path, found: &Conditions) -> Result<()> {
    let table = tables::conditions(found);
    let texts = [
        (CSV, conditions_csv(found)),
        (MARKDOWN, table.markdown()),
        (LATEX, table.latex()),
    ];
    let json = json!({
        "mean": means(&found.means),
        "num_conditions": found.conditions.len(),
        "conditions": found.conditions.iter().map(json).collect::<Vec<_>>(),
    });
    write_all(out, texts, (METRICS_FILE, &json))
}

/// Writes texts, each atomically, and at last the JSON file, from which the others can be told to
/// be complete.
///
/// # Errors
/// [`SceneError`] with the file's name.
pub(crate) fn write_all<const N: usize>(
    out: &Path,
    texts: [(&str, String); N],
    (name, value): (&str, &Value),
) -> Result<()> {
    files::create_dir(out)?;
    for (name, text) in texts {
        files::write_bytes_atomic(&out.join(name), text.as_bytes())?;
    }
    let path = out.join(name);
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| SceneError::invalid(&path, "content", e.to_string()))?;
    files::write_bytes_atomic(&path, (text + "\n").as_bytes())?;
    Ok(())
}

fn joined(text: String, more: Option<String>) -> String {
    match more {
        Some(more) => format!("{text}\n{more}"),
        None => text,
    }
}

fn means(means: &[Mean]) -> Map<String, Value> {
    means
        .iter()
        // `json!` turns an infinity into null.
        .map(|mean| (mean.metric.key.to_owned(), json!(mean.value)))
        .collect()
}

fn json(evaluation: &Evaluation) -> Value {
    let of_metrics = METRICS.iter().map(|metric| (metric.key, metric.definition));
    let definitions: Map<String, Value> = of_metrics
        .chain(MORE_DEFINITIONS)
        .map(|(key, definition)| (key.to_owned(), json!(definition)))
        .collect();
    json!({
        "name": evaluation.name,
        "render": evaluation.provenance,
        "mean": means(&evaluation.means),
        "exposure_scale": evaluation.exposure_scale,
        "light_change": evaluation.light_change,
        "regions": evaluation.regions,
        "num_views": evaluation.views.len(),
        "num_rendered": evaluation.num_rendered,
        "split": evaluation.split,
        "subset": evaluation.subset,
        "warnings": evaluation.warnings,
        "definitions": definitions,
        "views": evaluation.views,
    })
}

/// One line for each condition: its means, an empty field where it lacks a metric, `inf` for equal
/// images.
fn conditions_csv(found: &Conditions) -> String {
    let rows = found.conditions.iter().map(|condition| {
        let of_condition = |mean: &Mean| csv_value(condition.mean(mean.metric.key));
        let values = found.means.iter().map(of_condition);
        std::iter::once(condition.name.clone()).chain(values)
    });
    csv_text(csv_heading(&found.means), rows)
}

/// One line for each view; an empty field where a view lacks a metric, `inf` for equal images.
fn csv(evaluation: &Evaluation) -> String {
    let flip = [
        "ppd",
        "start_exposure",
        "stop_exposure",
        "num_exposures",
        "tonemapper",
    ];
    let flip = flip.map(|key| format!("flip_{key}"));
    let rows = evaluation.views.iter().map(|view| {
        let of_view = |mean: &Mean| csv_value((mean.metric.of)(view));
        let flip = &view.image.flip_hdr_parameters;
        let flip = [
            flip.ppd.to_string(),
            flip.start_exposure.to_string(),
            flip.stop_exposure.to_string(),
            flip.num_exposures.to_string(),
            flip.tonemapper.name().to_owned(),
        ];
        let values = evaluation.means.iter().map(of_view);
        std::iter::once(view.name.clone()).chain(values).chain(flip)
    });
    csv_text(csv_heading(&evaluation.means).chain(flip), rows)
}

fn csv_heading(means: &[Mean]) -> impl Iterator<Item = String> {
    let keys = means.iter().map(|mean| mean.metric.key.to_owned());
    std::iter::once("name".to_owned()).chain(keys)
}

/// A field of a value, empty without one.
pub(crate) fn csv_value(value: Option<f64>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

/// A CSV file of a heading and rows.
pub(crate) fn csv_text<R: IntoIterator<Item = String>>(
    heading: impl IntoIterator<Item = String>,
    rows: impl IntoIterator<Item = R>,
) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let heading: Vec<String> = heading.into_iter().collect();
    let rows = rows.into_iter().map(|row| row.into_iter().collect());
    for record in std::iter::once(heading).chain(rows) {
        writer
            .write_record(record)
            .expect("rows are as long as the heading, and memory grows");
    }
    let bytes = writer
        .into_inner()
        .expect("memory takes all that is written to it");
    String::from_utf8(bytes).expect("fields are UTF-8")
}

pub(crate) fn append(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments)
        .expect("a string takes everything that is written to it");
}
