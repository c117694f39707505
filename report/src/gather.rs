//! Content of the page, read from the folder of a run: an object under the names that the template
//! `page/report.html` has for its parts. Parts that are missing are null or empty there.

mod pictures;

use crate::curve;
use crate::error::{ReportError, Result};
use crate::lamps::LampTable;
use crate::mirrors::MirrorTable;
use crate::run::{PROJECT_FILE, RunRecord, folders, read_json};
use eagpt_scene::files;
use eagpt_scene::lamps::{ALL_LAMPS_DIR, LAMPS_FILE, read_lamps};
use serde_json::{Value, json};
use std::path::Path;

/// Metrics of single views: key, heading, decimals.
const METRICS: [(&str, &str, usize); 3] = [
    ("psnr_srgb_db", "PSNR (dB)", 2),
    ("ssim_srgb", "SSIM", 4),
    ("flip_hdr", "HDR-FLIP", 4),
];
/// Metrics of the overview.
const OVERVIEW: [(&str, &str, usize); 4] = [METRICS[0], METRICS[1], METRICS[2], EXPOSURE_SCALE];
/// Parts of the light that a rendering lacks.
const EXPOSURE_SCALE: (&str, &str, usize) = ("exposure_scale", "exposure scale", 3);
/// Reads a run.
///
/// # Errors
/// [`ReportError`] naming the file that is missing or is not what the commands write.
pub(crate) fn gather(dir: &Path) -> Result<Value> {
    let run = RunRecord::read(dir)?;
    let run =
        run.ok_or_else(|| ReportError::content(dir, &"no run.json: not the folder of a run"))?;
    let overview = overview(dir)?;
    let (mut conditions, mut warnings) = (Vec::new(), Vec::new());
    for name in pictures::conditions(&run) {
        conditions.extend(pictures::condition(dir, &run, &name, &mut warnings)?);
    }
    warnings_of_steps(dir, &run, &mut warnings)?;
    let done = run.in_order().into_iter().filter(|(_, step)| step.done);
    let total: f64 = done.map(|(_, step)| step.seconds).sum();
    Ok(json!({
        "title": run.project.file_stem().unwrap_or_default().to_string_lossy(),
        "version": run.version,
        "project": text(&dir.join(PROJECT_FILE))?,
        "overview": overview,
        "facts": facts(dir, &conditions)?,
        "conditions": conditions,
        "layers": pictures::layers(dir, &run)?,
        "masks": pictures::masks(dir, &run)?,
        "lamps": lamps(dir)?,
        "mirrors": MirrorTable::read(&dir.join(folders::TRAIN).join("mirrors.json"))?,
        "curves": curves(dir)?,
        "warnings": warnings,
        "steps": steps(&run),
        "total_time": time(total),
    }))
}

fn text(path: &Path) -> Result<String> {
    Ok(String::from_utf8_lossy(&files::read(path)?).into_owned())
}

/// A number with its name, rounded, with its unit.
fn fact(label: &str, value: &str) -> Value {
    json!({ "label": label, "value": value })
}

/// A rounded number; a value of null is infinite.
fn rounded(value: &Value, decimals: usize) -> String {
    match value.as_f64() {
        Some(value) => format!("{value:.decimals$}"),
        None => "∞".to_owned(),
    }
}

/// The table of modes and conditions; null if nothing was measured.
fn overview(dir: &Path) -> Result<Value> {
    let folder = dir.join(folders::TABLE);
    let Some(table) = read_json::<Value>(&folder.join("table.json"))? else {
        return Ok(Value::Null);
    };
    let conditions = strings(&table["conditions"]);
    let row = |row: &Value| {
        let cells = conditions.iter().flat_map(|condition| {
            OVERVIEW.map(|(key, _, decimals)| {
                let value = row["conditions"][condition]["mean"].get(key);
                value.map_or("–".to_owned(), |value| rounded(value, decimals))
            })
        });
        let seconds = row["seconds_per_frame"].as_f64();
        json!({
            "name": row["name"],
            "cells": cells.collect::<Vec<_>>(),
            "seconds": seconds.map_or("–".to_owned(), |seconds| format!("{seconds:.2}")),
        })
    };
    let rows = table["rows"].as_array().map_or(&[][..], Vec::as_slice);
    Ok(json!({
        "definitions": table["definitions"],
        "headings": OVERVIEW.map(|(_, heading, _)| heading),
        "rows": rows.iter().map(row).collect::<Vec<_>>(),
        "conditions": conditions,
        "latex": text(&folder.join("table.tex"))?,
        "markdown": text(&folder.join("table.md"))?,
    }))
}

fn strings(value: &Value) -> Vec<String> {
    let items = value.as_array().map_or(&[][..], Vec::as_slice);
    let texts = items.iter().filter_map(Value::as_str);
    texts.map(str::to_owned).collect()
}

fn lamps(dir: &Path) -> Result<Option<LampTable>> {
    let folder = dir.join(folders::TRAIN);
    // In several lights, the lamps of all of them.
    let places = [folder.join(ALL_LAMPS_DIR), folder].map(|place| place.join(LAMPS_FILE));
    let listed = places.iter().find(|path| path.exists());
    let lamps = listed.map(|path| read_lamps(path)).transpose()?;
    Ok(lamps.map(|lamps| LampTable::new(&lamps)))
}

/// Loss curves of the trained stages.
fn curves(dir: &Path) -> Result<Vec<Value>> {
    let path = dir.join(folders::TRAIN).join("log.jsonl");
    if !path.exists() {
        return Ok(Vec::new());
    }
    let mut stages: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for line in text(&path)?.lines() {
        let line: Value =
            serde_json::from_str(line).map_err(|e| ReportError::content(&path, &e))?;
        let stage = line["stage"].as_str().unwrap_or_default();
        let point = (line["iteration"].as_f64(), line["smoothed"].as_f64());
        let (Some(iteration), Some(loss)) = point else {
            continue;
        };
        match stages.last_mut() {
            Some((name, points)) if name == stage => points.push((iteration, loss)),
            _ => stages.push((stage.to_owned(), vec![(iteration, loss)])),
        }
    }
    let drawn = stages.into_iter().filter_map(|(stage, points)| {
        let svg = curve::log_curve(&points, "iteration", "loss");
        (!svg.is_empty()).then(|| json!({ "stage": stage, "svg": svg }))
    });
    Ok(drawn.collect())
}

/// A few numbers that say what the run was.
fn facts(dir: &Path, conditions: &[Value]) -> Result<Vec<Value>> {
    let mut facts = Vec::new();
    let mut add = |label: &str, value: &str| facts.push(fact(label, value));
    if let Some(record) = read_json::<Value>(&dir.join(folders::TRAIN).join("record.json"))? {
        if let Some(num) = record["split"]["num_train"].as_u64() {
            add("training views", &num.to_string());
        }
        if let Some(num) = record["split"]["num_test"].as_u64() {
            add("test views", &num.to_string());
        }
        if let Some(device) = record["device"].as_str() {
            add("computed on", device);
        }
        let own_light = &record["measured"]["own_light"];
        if let Some(psnr) = own_light["psnr_srgb_db"].as_f64() {
            let factor = own_light["exposure_scale"].as_f64();
            let factor = factor.map_or(String::new(), |factor| format!(", factor {factor:.2}"));
            add(
                "own light, training views",
                &format!("{psnr:.1} dB{factor}"),
            );
        }
    }
    for condition in conditions {
        let modes = condition["modes"].as_array().into_iter().flatten();
        let best = modes.filter_map(|mode| {
            let mut metrics = mode["metrics"].as_array()?.iter();
            let psnr = metrics.find(|metric| metric["label"] == METRICS[0].1)?;
            Some((psnr["value"].as_str()?.parse::<f64>().ok()?, mode))
        });
        if let Some((psnr, mode)) = best.max_by(|a, b| a.0.total_cmp(&b.0)) {
            let [name, mode] = [condition, mode].map(|of| of["name"].as_str().unwrap_or_default());
            add(&format!("{name}, {mode}"), &format!("{psnr:.2} dB"));
        }
    }
    Ok(facts)
}

/// Warnings of all commands, by the step that gave them.
fn warnings_of_steps(dir: &Path, run: &RunRecord, all: &mut Vec<String>) -> Result<()> {
    for (name, step) in run.in_order() {
        for product in step.products.keys() {
            let path = dir.join(product);
            let records = [
                path.join("record.json"),
                path.with_extension("record.json"),
                path.with_file_name("record.json"),
            ];
            let Some(record) = records.iter().find(|record| record.is_file()) else {
                continue;
            };
            let record: Option<Value> = read_json(record)?;
            let given = record.map(|record| strings(&record["warnings"]));
            all.extend(
                given
                    .unwrap_or_default()
                    .iter()
                    .map(|text| format!("{name}: {text}")),
            );
        }
    }
    Ok(())
}

fn steps(run: &RunRecord) -> Vec<Value> {
    let done = run.in_order().into_iter().filter(|(_, step)| step.done);
    let steps = done.map(|(name, step)| {
        let products = step.products.iter().map(|(path, digest)| {
            let digest: String = digest.chars().take(16).collect();
            (path.display().to_string(), digest)
        });
        let memory = step.peak_memory_mib;
        json!({
            "name": name,
            "command": format!("eagpt {}", step.command.join(" ")),
            "time": time(step.seconds),
            "memory": memory.map_or("–".to_owned(), |mib| format!("{mib:.0} MiB")),
            "products": products.collect::<Vec<_>>(),
        })
    });
    steps.collect()
}

fn time(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
