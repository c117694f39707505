//! The files that an evaluation leaves.

mod table;

use crate::error::Result;
use crate::job::Evaluation;
use crate::metrics::METRICS;
use eagpt_scene::{SceneError, files};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

const JSON: &str = "metrics.json";
const CSV: &str = "metrics.csv";
const MARKDOWN: &str = "table.md";
const LATEX: &str = "table.tex";

/// The files of [`write`] in the folder `out`.
pub(crate) fn files(out: &Path) -> [PathBuf; 4] {
    [JSON, CSV, MARKDOWN, LATEX].map(|name| out.join(name))
}

/// Writes all files, each atomically, `metrics.json` last.
///
/// # Errors
/// [`SceneError::Io`] with the file's name.
pub(crate) fn write(out: &Path, evaluation: &Evaluation) -> Result<()> {
    files::create_dir(out)?;
    let put =
        |name: &str, text: String| files::write_bytes_atomic(&out.join(name), text.as_bytes());
    put(CSV, csv(evaluation))?;
    put(MARKDOWN, table::markdown(evaluation))?;
    put(LATEX, table::latex(evaluation))?;
    let json = json(evaluation)
        .and_then(|json| serde_json::to_string_pretty(&json))
        .map_err(|e| SceneError::invalid(&out.join(JSON), "content", e.to_string()))?;
    put(JSON, json + "\n")?;
    Ok(())
}

fn json(evaluation: &Evaluation) -> serde_json::Result<Value> {
    let means: Map<String, Value> = evaluation
        .means
        .iter()
        // `json!` turns an infinity into null.
        .map(|mean| (mean.metric.key.to_owned(), json!(mean.value)))
        .collect();
    let definitions: Map<String, Value> = METRICS
        .iter()
        .map(|metric| (metric.key.to_owned(), json!(metric.definition)))
        .collect();
    Ok(json!({
        "mean": means,
        "num_views": evaluation.views.len(),
        "split": evaluation.split,
        "subset": evaluation.subset,
        "warnings": evaluation.warnings,
        "definitions": definitions,
        "views": serde_json::to_value(&evaluation.views)?,
    }))
}

/// One line for each view; an empty field where a view lacks a metric, `inf` for equal images.
fn csv(evaluation: &Evaluation) -> String {
    let mut text = "name".to_owned();
    for metric in evaluation.means.iter().map(|mean| mean.metric) {
        text.push(',');
        text.push_str(metric.key);
    }
    text.push_str(
        ",flip_ppd,flip_start_exposure,flip_stop_exposure,flip_num_exposures,flip_tonemapper\n",
    );
    for view in &evaluation.views {
        text.push_str(&csv_field(&view.name));
        for mean in &evaluation.means {
            text.push(',');
            if let Some(value) = (mean.metric.of)(view) {
                append(&mut text, format_args!("{value}"));
            }
        }
        let flip = &view.image.flip_hdr_parameters;
        append(
            &mut text,
            format_args!(
                ",{},{},{},{},{}\n",
                flip.ppd,
                flip.start_exposure,
                flip.stop_exposure,
                flip.num_exposures,
                flip.tonemapper.name()
            ),
        );
    }
    text
}

/// Quoted where RFC 4180 wants it.
fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

fn append(text: &mut String, arguments: std::fmt::Arguments<'_>) {
    text.write_fmt(arguments)
        .expect("a string takes everything that is written to it");
}
