//! Content of the page, read from the folder of a run.

use crate::content::{
    Condition, Content, Curve, Fact, Gallery, Mode, Overview, OverviewRow, Shot, Step, View,
};
use crate::curve;
use crate::error::{ReportError, Result};
use crate::lamps::LampTable;
use crate::picture::Picture;
use crate::run::{ORIGINAL, PROJECT_FILE, RunRecord, folders, read_json};
use eagpt_scene::lamps::{ALL_LAMPS_DIR, LAMPS_FILE, read_lamps};
use eagpt_scene::{Dataset, files};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most views of a condition whose pictures are embedded.
const MAX_VIEWS: usize = 12;
/// Most pictures of masks and of layers.
const MAX_SAMPLES: usize = 6;
/// Metrics of single views: key, heading, decimals.
const METRICS: [(&str, &str, usize); 3] = [
    ("psnr_srgb_db", "PSNR (dB)", 2),
    ("ssim_srgb", "SSIM", 4),
    ("flip_hdr", "HDR-FLIP", 4),
];
/// Metrics of the overview.
const OVERVIEW: [(&str, &str, usize); 4] = [METRICS[0], METRICS[1], METRICS[2], EXPOSURE_SCALE];
/// What the light of a rendering lacks.
const EXPOSURE_SCALE: (&str, &str, usize) = ("exposure_scale", "exposure scale", 3);
/// Further metrics of a condition, where they were measured.
const MORE_METRICS: [(&str, &str, usize); 10] = [
    EXPOSURE_SCALE,
    ("psnr_linear_db", "PSNR linear (dB)", 2),
    ("psnr_pq_db", "PSNR PQ (dB)", 2),
    ("flip_ldr_srgb", "LDR-FLIP", 4),
    ("psnr_srgb_aligned_db", "PSNR, exposure aligned (dB)", 2),
    ("albedo_psnr_srgb_db", "albedo PSNR (dB)", 2),
    ("albedo_psnr_scaled_db", "albedo PSNR, scaled (dB)", 2),
    ("normal_mean_deg", "normals (°)", 2),
    ("depth_mae", "depth MAE", 4),
    ("emission_iou", "emission IoU", 3),
];
/// Quantities of the camera rays that have pictures, and what they are called.
const LAYERS: [(&str, &str); 3] = [
    ("albedo", "Diffuse albedo"),
    ("normal", "Normals"),
    ("emission", "Emission"),
];

/// Reads a run.
///
/// # Errors
/// [`ReportError`] naming the file that is missing or is not what the commands write.
pub fn gather(dir: &Path) -> Result<Content> {
    let run = RunRecord::read(dir)?;
    let run =
        run.ok_or_else(|| ReportError::content(dir, &"no run.json: not the folder of a run"))?;
    let mut content = Content {
        title: run
            .project
            .file_stem()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned()),
        version: run.version.clone(),
        ..Content::default()
    };
    let project = dir.join(PROJECT_FILE);
    content.project = String::from_utf8_lossy(&files::read(&project)?).into_owned();
    content.overview = overview(dir, &mut content.definitions)?;
    for name in conditions(&run) {
        let condition = condition(dir, &run, &name, &mut content.warnings)?;
        content.conditions.extend(condition);
    }
    content.layers = layers(dir, &run)?;
    content.masks = masks(dir, &run)?;
    content.lamps = lamps(dir)?;
    content.curves = curves(dir)?;
    content.facts = facts(dir, &content)?;
    warnings(dir, &run, &mut content.warnings)?;
    steps(&run, &mut content);
    Ok(content)
}

/// Conditions that were rendered, in the order of the run.
fn conditions(run: &RunRecord) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (step, _) in run.in_order() {
        if let Some(["render", name, _]) = parts(step).as_deref()
            && !names.iter().any(|known| known == name)
        {
            names.push((*name).to_owned());
        }
    }
    names
}

fn parts(step: &str) -> Option<Vec<&str>> {
    Some(step.split('/').collect())
}

/// Modes in which a condition was rendered, in the order of the run.
fn modes(run: &RunRecord, condition: &str) -> Vec<String> {
    let done = run.in_order().into_iter().filter(|(_, step)| step.done);
    done.filter_map(|(name, _)| match parts(name).as_deref() {
        Some(["render", of, mode]) if *of == condition => Some((*mode).to_owned()),
        _ => None,
    })
    .collect()
}

fn condition(
    dir: &Path,
    run: &RunRecord,
    name: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<Condition>> {
    let modes = modes(run, name);
    let Some(first) = modes.first() else {
        return Ok(None);
    };
    let rendered = dir.join(folders::RENDER).join(name);
    let names = rendered_views(&rendered.join(first))?;
    let eval = dir.join(folders::EVAL).join(name);
    let mut measured = Vec::new();
    for mode in &modes {
        measured.push(read_json::<Value>(&eval.join(mode).join("metrics.json"))?);
    }
    let references = references(run, &eval.join(first), warnings)?;
    let mut views = Vec::new();
    for view in evenly(&names, MAX_VIEWS) {
        let mut shots = Vec::new();
        for (mode, metrics) in modes.iter().zip(&measured) {
            let picture = rendered.join(mode).join(format!("{view}.png"));
            if !picture.is_file() {
                continue;
            }
            let flip = eval.join(mode).join("flip").join(format!("{view}.png"));
            let of_view = metrics.as_ref().and_then(|all| {
                let views = all["views"].as_array()?;
                views.iter().find(|one| one["name"] == view.as_str())
            });
            shots.push(Shot {
                mode: mode.clone(),
                picture: Picture::of_png(&picture)?,
                flip: flip.is_file().then(|| Picture::of_png(&flip)).transpose()?,
                metrics: of_view.map_or_else(Vec::new, |value| listed(value, &METRICS)),
            });
        }
        let reference = references.get(view).map(|path| Picture::of_light(path));
        views.push(View {
            name: view.clone(),
            reference: reference.transpose()?,
            shots,
        });
    }
    let means = modes.iter().zip(&measured).map(|(name, metrics)| {
        let mean = metrics.as_ref().map(|all| &all["mean"]);
        let all: Vec<_> = METRICS.into_iter().chain(MORE_METRICS).collect();
        Mode {
            name: name.clone(),
            metrics: mean.map_or_else(Vec::new, |mean| listed(mean, &all)),
        }
    });
    Ok(Some(Condition {
        name: name.to_owned(),
        has_reference: views.iter().any(|view| view.reference.is_some()),
        modes: means.collect(),
        num_views: names.len(),
        views,
    }))
}

/// Names of the views in a folder of renderings, as its record lists them.
fn rendered_views(folder: &Path) -> Result<Vec<String>> {
    let record: Option<Value> = read_json(&folder.join("record.json"))?;
    let outputs = record
        .as_ref()
        .and_then(|record| record["outputs"].as_array());
    let names = outputs.into_iter().flatten().filter_map(Value::as_str);
    let is_layer = |name: &str| {
        let first = name.split('/').next().unwrap_or_default();
        ["normal", "depth", "albedo", "emission", "alpha"].contains(&first)
    };
    let views = names.filter_map(|name| name.strip_suffix(".png"));
    Ok(views
        .filter(|name| !is_layer(name))
        .map(str::to_owned)
        .collect())
}

/// Files of the references by view.
fn references(
    run: &RunRecord,
    eval: &Path,
    warnings: &mut Vec<String>,
) -> Result<BTreeMap<String, PathBuf>> {
    let record: Option<Value> = read_json(&eval.join("record.json"))?;
    let dataset = record
        .as_ref()
        .and_then(|record| record["options"]["dataset"].as_str());
    let Some(named) = dataset.map(PathBuf::from) else {
        return Ok(BTreeMap::new());
    };
    // Named from where the program was called, which need not be where it is called now.
    let here = run.project.parent().map(|folder| folder.join(&named));
    let found = [Some(named.clone()), here]
        .into_iter()
        .flatten()
        .find(|path| path.exists());
    let Some(found) = found else {
        warnings.push(format!(
            "{}: the references are no longer there",
            named.display()
        ));
        return Ok(BTreeMap::new());
    };
    let dataset = Dataset::open(&found)?;
    let frames = dataset.frames().iter();
    Ok(frames
        .map(|frame| (frame.name.clone(), frame.files.radiance.clone()))
        .collect())
}

/// At most `most` of `all`, evenly chosen.
fn evenly(all: &[String], most: usize) -> Vec<&String> {
    let num = all.len().min(most);
    (0..num).map(|i| &all[i * all.len() / num]).collect()
}

/// Those of `wanted` that are in an object of metrics.
fn listed(values: &Value, wanted: &[(&str, &str, usize)]) -> Vec<Fact> {
    let found = wanted.iter().filter_map(|&(key, heading, decimals)| {
        let value = values.get(key)?;
        Some(Fact {
            label: heading.to_owned(),
            value: rounded(value, decimals),
        })
    });
    found.collect()
}

/// A rounded number; a value of null is infinite.
fn rounded(value: &Value, decimals: usize) -> String {
    match value.as_f64() {
        Some(value) => format!("{value:.decimals$}"),
        None => "∞".to_owned(),
    }
}

fn overview(dir: &Path, definitions: &mut BTreeMap<String, String>) -> Result<Option<Overview>> {
    let folder = dir.join(folders::TABLE);
    let Some(table) = read_json::<Value>(&folder.join("table.json"))? else {
        return Ok(None);
    };
    let text = |file: &str| -> Result<String> {
        let bytes = files::read(&folder.join(file))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    };
    let empty = Map::new();
    for (key, meaning) in table["definitions"].as_object().unwrap_or(&empty) {
        let meaning = meaning.as_str().unwrap_or_default().to_owned();
        definitions.insert(key.clone(), meaning);
    }
    let conditions: Vec<String> = strings(&table["conditions"]);
    let rows = table["rows"].as_array().map_or(&[][..], Vec::as_slice);
    let row = |row: &Value| {
        let cells = conditions.iter().flat_map(|condition| {
            OVERVIEW.map(|(key, _, decimals)| {
                let value = row["conditions"][condition]["mean"].get(key);
                value.map_or("–".to_owned(), |value| rounded(value, decimals))
            })
        });
        OverviewRow {
            name: row["name"].as_str().unwrap_or_default().to_owned(),
            cells: cells.collect(),
            seconds: row["seconds_per_frame"]
                .as_f64()
                .map_or("–".to_owned(), |seconds| format!("{seconds:.2}")),
        }
    };
    Ok(Some(Overview {
        headings: OVERVIEW.map(|(_, heading, _)| heading).into(),
        rows: rows.iter().map(row).collect(),
        conditions,
        latex: text("table.tex")?,
        markdown: text("table.md")?,
    }))
}

fn strings(value: &Value) -> Vec<String> {
    let items = value.as_array().map_or(&[][..], Vec::as_slice);
    let texts = items.iter().filter_map(Value::as_str);
    texts.map(str::to_owned).collect()
}

/// Pictures of the quantities that the first mode of the photographed light was rendered with.
fn layers(dir: &Path, run: &RunRecord) -> Result<Vec<Gallery>> {
    let mut galleries = Vec::new();
    let Some(mode) = modes(run, ORIGINAL).into_iter().next() else {
        return Ok(galleries);
    };
    let folder = dir.join(folders::RENDER).join(ORIGINAL).join(mode);
    let names = rendered_views(&folder)?;
    for (layer, title) in LAYERS {
        let mut pictures = Vec::new();
        for name in evenly(&names, MAX_SAMPLES) {
            let path = folder.join(layer).join(format!("{name}.png"));
            if path.is_file() {
                pictures.push((name.clone(), Picture::of_png(&path)?));
            }
        }
        if !pictures.is_empty() {
            galleries.push(Gallery {
                title: title.to_owned(),
                text: String::new(),
                pictures,
            });
        }
    }
    Ok(galleries)
}

/// Masks of each light.
fn masks(dir: &Path, run: &RunRecord) -> Result<Vec<Gallery>> {
    let mut galleries = Vec::new();
    for (step, _) in run.in_order() {
        let title = match parts(step).as_deref() {
            Some([folders::MASKS]) => "Emission masks".to_owned(),
            Some([folders::MASKS, light]) => format!("Emission masks: {light}"),
            _ => continue,
        };
        galleries.extend(masks_in(&dir.join(step).join("masks"), title)?);
    }
    Ok(galleries)
}

fn masks_in(folder: &Path, title: String) -> Result<Option<Gallery>> {
    let Some(report) = read_json::<Value>(&folder.join("report.json"))? else {
        return Ok(None);
    };
    let views = report["views"].as_array().map_or(&[][..], Vec::as_slice);
    let with = |verdict: &str| {
        views
            .iter()
            .filter(|view| view["verdict"] == verdict)
            .count()
    };
    let mut text = format!(
        "{} views: {} good, {} without a light, {} with regions that other views do not confirm, {} that lack a light.",
        views.len(),
        with("good"),
        with("empty"),
        with("inconsistent"),
        with("incomplete")
    );
    if let Some(threshold) = report["threshold"].as_f64() {
        text += &format!(" Threshold: {threshold:.3} linear radiance.");
    }
    // Where there is most to see.
    let mut by_coverage: Vec<(f64, &str)> = views
        .iter()
        .filter_map(|view| Some((view["coverage"].as_f64()?, view["name"].as_str()?)))
        .filter(|(coverage, _)| *coverage > 0.0)
        .collect();
    by_coverage.sort_by(|a, b| b.0.total_cmp(&a.0));
    let names: Vec<String> = by_coverage.iter().map(|one| one.1.to_owned()).collect();
    let mut pictures = Vec::new();
    for name in evenly(&names, MAX_SAMPLES) {
        let path = folder.join("overlay").join(format!("{name}.png"));
        if path.is_file() {
            pictures.push((name.clone(), Picture::of_png(&path)?));
        }
    }
    Ok(Some(Gallery {
        title,
        text,
        pictures,
    }))
}

fn lamps(dir: &Path) -> Result<Option<LampTable>> {
    let folder = dir.join(folders::TRAIN);
    // In several lights, the lamps of all of them.
    let places = [folder.join(ALL_LAMPS_DIR), folder].map(|place| place.join(LAMPS_FILE));
    let listed = places.iter().find(|path| path.exists());
    let lamps = listed.map(|path| read_lamps(path)).transpose()?;
    Ok(lamps.map(|lamps| LampTable::new(&lamps)))
}

fn curves(dir: &Path) -> Result<Vec<Curve>> {
    let path = dir.join(folders::TRAIN).join("log.jsonl");
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text = String::from_utf8_lossy(&files::read(&path)?).into_owned();
    let mut stages: Vec<(String, Vec<(f64, f64)>)> = Vec::new();
    for line in text.lines() {
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
    let drawn = stages.into_iter().map(|(stage, points)| Curve {
        svg: curve::log_curve(&points, "iteration", "loss"),
        stage,
    });
    Ok(drawn.filter(|curve| !curve.svg.is_empty()).collect())
}

fn facts(dir: &Path, content: &Content) -> Result<Vec<Fact>> {
    let mut facts = Vec::new();
    let mut add = |label: &str, value: String| {
        facts.push(Fact {
            label: label.to_owned(),
            value,
        });
    };
    if let Some(record) = read_json::<Value>(&dir.join(folders::TRAIN).join("record.json"))? {
        if let Some(num) = record["split"]["num_train"].as_u64() {
            add("training views", num.to_string());
        }
        if let Some(num) = record["split"]["num_test"].as_u64() {
            add("test views", num.to_string());
        }
        if let Some(device) = record["device"].as_str() {
            add("computed on", device.to_owned());
        }
        let own_light = &record["measured"]["own_light"];
        if let Some(psnr) = own_light["psnr_srgb_db"].as_f64() {
            let factor = own_light["exposure_scale"].as_f64();
            let factor = factor.map_or(String::new(), |factor| format!(", factor {factor:.2}"));
            add("own light, training views", format!("{psnr:.1} dB{factor}"));
        }
    }
    for condition in &content.conditions {
        let best = condition.modes.iter().filter_map(|mode| {
            let psnr = mode
                .metrics
                .iter()
                .find(|metric| metric.label == METRICS[0].1)?;
            Some((psnr.value.parse::<f64>().ok()?, &mode.name))
        });
        if let Some((psnr, mode)) = best.max_by(|a, b| a.0.total_cmp(&b.0)) {
            add(
                &format!("{}, {mode}", condition.name),
                format!("{psnr:.2} dB"),
            );
        }
    }
    Ok(facts)
}

/// Warnings of all commands, by the step that gave them.
fn warnings(dir: &Path, run: &RunRecord, all: &mut Vec<String>) -> Result<()> {
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

fn steps(run: &RunRecord, content: &mut Content) {
    let mut total = 0.0;
    for (name, step) in run.in_order().into_iter().filter(|(_, step)| step.done) {
        total += step.seconds;
        let products = step.products.iter();
        content.steps.push(Step {
            name: name.to_owned(),
            command: format!("eagpt {}", step.command.join(" ")),
            time: time(step.seconds),
            memory: step
                .peak_memory_mib
                .map_or("–".to_owned(), |mib| format!("{mib:.0} MiB")),
            products: products
                .map(|(path, digest)| {
                    let digest: String = digest.chars().take(16).collect();
                    (path.display().to_string(), digest)
                })
                .collect(),
        });
    }
    content.total_time = time(total);
}

fn time(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
