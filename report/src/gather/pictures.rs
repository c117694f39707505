//! Renderings, masks and their numbers.

use super::{METRICS, fact, rounded};
use crate::error::Result;
use crate::picture::Picture;
use crate::run::{ORIGINAL, RunRecord, folders, read_json};
use eagpt_scene::Dataset;
use eagpt_scene::spread::evenly;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most views of a condition whose pictures are embedded.
const MAX_VIEWS: usize = 12;
/// Most pictures of masks and of layers.
const MAX_SAMPLES: usize = 6;
/// Further metrics of a condition, where they were measured.
const MORE_METRICS: [(&str, &str, usize); 11] = [
    super::EXPOSURE_SCALE,
    ("psnr_linear_db", "PSNR linear (dB)", 2),
    ("psnr_pq_db", "PSNR PQ (dB)", 2),
    ("flip_ldr_srgb", "LDR-FLIP", 4),
    ("psnr_srgb_aligned_db", "PSNR, exposure aligned (dB)", 2),
    ("albedo_psnr_srgb_db", "albedo PSNR (dB)", 2),
    ("albedo_psnr_scaled_db", "albedo PSNR, scaled (dB)", 2),
    ("specular_mae", "specular MAE", 4),
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

/// Conditions that were rendered, in the order of the run.
pub(super) fn conditions(run: &RunRecord) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (step, _) in run.in_order() {
        if let ["render", name, _] = parts(step).as_slice()
            && !names.iter().any(|known| known == name)
        {
            names.push((*name).to_owned());
        }
    }
    names
}

fn parts(step: &str) -> Vec<&str> {
    step.split('/').collect()
}

/// Modes in which a condition was rendered, in the order of the run.
fn modes(run: &RunRecord, condition: &str) -> Vec<String> {
    let done = run.in_order().into_iter().filter(|(_, step)| step.done);
    done.filter_map(|(name, _)| match parts(name).as_slice() {
        ["render", of, mode] if *of == condition => Some((*mode).to_owned()),
        _ => None,
    })
    .collect()
}

/// The renderings of one light, and what was measured of them.
pub(super) fn condition(
    dir: &Path,
    run: &RunRecord,
    name: &str,
    warnings: &mut Vec<String>,
) -> Result<Option<Value>> {
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
            shots.push(json!({
                "mode": mode,
                "picture": Picture::of_png(&picture)?,
                "flip": flip.is_file().then(|| Picture::of_png(&flip)).transpose()?,
                "metrics": of_view.map_or_else(Vec::new, |value| listed(value, &METRICS)),
            }));
        }
        let reference = references.get(view).map(|path| Picture::of_light(path));
        views.push(json!({
            "name": view,
            "reference": reference.transpose()?,
            "shots": shots,
        }));
    }
    let means = modes.iter().zip(&measured).map(|(name, metrics)| {
        let mean = metrics.as_ref().map(|all| &all["mean"]);
        let all: Vec<_> = METRICS.into_iter().chain(MORE_METRICS).collect();
        let metrics = mean.map_or_else(Vec::new, |mean| listed(mean, &all));
        json!({ "name": name, "metrics": metrics })
    });
    Ok(Some(json!({
        "name": name,
        "modes": means.collect::<Vec<_>>(),
        "views": views,
        "num_views": names.len(),
    })))
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

/// Those of `wanted` that are in an object of metrics.
fn listed(values: &Value, wanted: &[(&str, &str, usize)]) -> Vec<Value> {
    let found = wanted.iter().filter_map(|&(key, heading, decimals)| {
        Some(fact(heading, &rounded(values.get(key)?, decimals)))
    });
    found.collect()
}

/// Pictures of the quantities that the first mode of the photographed light was rendered with.
pub(super) fn layers(dir: &Path, run: &RunRecord) -> Result<Vec<Value>> {
    let mut galleries = Vec::new();
    let Some(mode) = modes(run, ORIGINAL).into_iter().next() else {
        return Ok(galleries);
    };
    let folder = dir.join(folders::RENDER).join(ORIGINAL).join(mode);
    let names = rendered_views(&folder)?;
    for (layer, title) in LAYERS {
        let pictures = sampled(&folder.join(layer), &names)?;
        if !pictures.is_empty() {
            galleries.push(json!({ "title": title, "pictures": pictures }));
        }
    }
    Ok(galleries)
}

/// Some of the pictures in a folder, with their names.
fn sampled(folder: &Path, names: &[String]) -> Result<Vec<(String, Picture)>> {
    let paths = evenly(names, MAX_SAMPLES);
    let paths = paths.map(|name| (name, folder.join(format!("{name}.png"))));
    let pictures = paths.filter(|(_, path)| path.is_file());
    pictures
        .map(|(name, path)| Ok((name.clone(), Picture::of_png(&path)?)))
        .collect()
}

/// Masks of each light.
pub(super) fn masks(dir: &Path, run: &RunRecord) -> Result<Vec<Value>> {
    let mut galleries = Vec::new();
    for (step, _) in run.in_order() {
        let title = match parts(step).as_slice() {
            [folders::MASKS] => "Emission masks".to_owned(),
            [folders::MASKS, light] => format!("Emission masks: {light}"),
            _ => continue,
        };
        galleries.extend(masks_in(&dir.join(step).join("masks"), &title)?);
    }
    Ok(galleries)
}

fn masks_in(folder: &Path, title: &str) -> Result<Option<Value>> {
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
    let pictures = sampled(&folder.join("overlay"), &names)?;
    Ok(Some(
        json!({ "title": title, "text": text, "pictures": pictures }),
    ))
}
