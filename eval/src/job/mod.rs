//! The evaluation of a folder of renders against the views of a dataset.
//!
//! Reads `<renders>/<view>.exr` (linear Rec.709) and, where there are any, `<renders>/<channel>/<view>.exr` for the
//! channels `albedo` (linear RGB), `normal` (world-space x, y, z), `depth` (along the optical axis) and `emission`.
//! Writes into the output folder
//!
//! | file | content |
//! |---|---|
//! | `metrics.json` | means, views, definitions, split, warnings |
//! | `metrics.csv` | one line for each view, full precision |
//! | `table.md`, `table.tex` | the same for people, with means |
//! | `flip/<view>.png` | HDR-FLIP error, magma from 0 to 1 |
//!
//! One view is in memory at a time. `metrics.json` is written last: where it is, the other files are complete.

mod renders;

#[cfg(test)]
mod tests;

use crate::error::{EvalError, Result};
use crate::flip::{FlipOptions, magma_rgb8};
use crate::metrics::{METRICS, MeanOf, Metric};
use crate::pair::{ImageMetrics, compare, decibels};
use crate::report;
use crate::scene_metrics::{
    Overlap, albedo_psnr, depth_mae, emission_overlap, mean, normal_mean_deg,
};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::{Dataset, View, files, png};
use renders::Renders;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What to evaluate and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EvalOptions {
    /// Folder of renders.
    pub renders: PathBuf,
    /// Dataset with the references: a folder or its `transforms.json`.
    pub dataset: PathBuf,
    /// Output folder; created.
    pub out: PathBuf,
    /// How views are divided.
    #[serde(default)]
    pub split: SplitRule,
    /// The views to evaluate.
    #[serde(default = "test_views")]
    pub subset: Subset,
    /// Settings of FLIP.
    #[serde(default)]
    pub flip: FlipOptions,
    /// Replace results that are in the output folder.
    #[serde(default)]
    pub force: bool,
}

fn test_views() -> Subset {
    Subset::Test
}

impl EvalOptions {
    /// The test views of the default split, compared with default settings.
    pub fn new(renders: &Path, dataset: &Path, out: &Path) -> Self {
        Self {
            renders: renders.to_owned(),
            dataset: dataset.to_owned(),
            out: out.to_owned(),
            split: SplitRule::default(),
            subset: test_views(),
            flip: FlipOptions::default(),
            force: false,
        }
    }
}

/// What an evaluation tells while it goes on.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum EvalProgress {
    /// All files are there; views will now be compared.
    Started {
        /// Number of views.
        total: usize,
    },
    /// A view is done.
    View {
        /// Its name.
        name: String,
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
    /// Something the user should know; also in `metrics.json`.
    Warning {
        /// One line.
        text: String,
    },
}

/// Metrics of the channels beside radiance; `None` where the render or the reference lacks the channel, or no pixel can
/// be compared.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct SceneMetrics {
    /// See [`crate::scene_metrics::albedo_psnr`]; infinite for equal albedos, which is `null` in JSON.
    #[serde(
        skip_serializing_if = "Option::is_none",
        with = "decibels::optional",
        default
    )]
    pub albedo_psnr_srgb_db: Option<f64>,
    /// The same after a fitted scale.
    #[serde(
        skip_serializing_if = "Option::is_none",
        with = "decibels::optional",
        default
    )]
    pub albedo_psnr_scaled_db: Option<f64>,
    /// See [`normal_mean_deg`].
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub normal_mean_deg: Option<f64>,
    /// See [`depth_mae`].
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub depth_mae: Option<f64>,
    /// See [`emission_overlap`]; kept because the views' overlaps make up that of all pixels.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub emission_overlap: Option<Overlap>,
    /// See [`Overlap::iou`].
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub emission_iou: Option<f64>,
}

/// All metrics of one view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ViewMetrics {
    /// Name of the view.
    pub name: String,
    /// Metrics of radiance.
    #[serde(flatten)]
    pub image: ImageMetrics,
    /// Metrics of the other channels.
    #[serde(flatten)]
    pub scene: SceneMetrics,
}

/// Mean of a metric over the views that have it, or over their pixels: see [`MeanOf`].
#[derive(Debug, Clone, Copy)]
pub struct Mean {
    /// The metric.
    pub metric: &'static Metric,
    /// The mean; infinite if that of a view is.
    pub value: f64,
    /// Number of views that have the metric.
    pub num_views: usize,
}

/// The result of [`evaluate`].
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Means of the metrics that at least one view has, in the order of [`METRICS`].
    pub means: Vec<Mean>,
    /// The views, in the order of the dataset.
    pub views: Vec<ViewMetrics>,
    /// How views were divided.
    pub split: SplitRule,
    /// The views that were evaluated.
    pub subset: Subset,
    /// What a reader of the numbers has to know.
    pub warnings: Vec<String>,
}

impl Evaluation {
    /// The mean of the metric called `key`, if a view has it.
    pub fn mean(&self, key: &str) -> Option<f64> {
        let mean = self.means.iter().find(|mean| mean.metric.key == key)?;
        Some(mean.value)
    }
}

/// Compares renders with the views of a dataset and writes the results.
///
/// Before any comparison it checks that every view has a render, that sizes fit and that no result is in the way.
///
/// # Errors
/// [`EvalError`] naming the file or option: a missing render (all are listed), a render of another size or with values
/// that are not finite, results in the output folder without `force`, or whatever reading and writing files returns.
pub fn evaluate(
    options: &EvalOptions,
    progress: &mut dyn FnMut(EvalProgress),
) -> Result<Evaluation> {
    options.flip.validate()?;
    let dataset = Dataset::open(&options.dataset)?;
    let split = dataset.split(options.split)?;
    let indices = split.indices(options.subset);
    let frames: Vec<_> = indices.iter().map(|&i| &dataset.frames()[i]).collect();
    let renders = Renders::find(&options.renders, &frames)?;
    let map_path = |name: &str| options.out.join("flip").join(format!("{name}.png"));
    if !options.force {
        let maps = frames.iter().map(|frame| map_path(&frame.name));
        refuse_existing(report::files(&options.out).into_iter().chain(maps))?;
    }
    let warnings: Vec<String> = [split.warnings, renders.warnings()].concat();
    for text in &warnings {
        progress(EvalProgress::Warning { text: text.clone() });
    }
    let total = indices.len();
    progress(EvalProgress::Started { total });

    let mut views = Vec::with_capacity(total);
    for (done, &index) in indices.iter().enumerate() {
        let view = dataset.load_view(index)?;
        views.push(evaluate_view(
            &view,
            &renders,
            options,
            &map_path(&view.name),
        )?);
        progress(EvalProgress::View {
            name: view.name,
            done: done + 1,
            total,
        });
    }
    let evaluation = Evaluation {
        means: means(&views),
        views,
        split: options.split,
        subset: options.subset,
        warnings,
    };
    report::write(&options.out, &evaluation)?;
    Ok(evaluation)
}

fn evaluate_view(
    view: &View,
    renders: &Renders,
    options: &EvalOptions,
    map_path: &Path,
) -> Result<ViewMetrics> {
    let radiance = renders.radiance(&view.name)?;
    let comparison = compare(&view.radiance, &radiance, &options.flip)?;
    let error = &comparison.flip_hdr_error;
    if let Some(folder) = map_path.parent() {
        files::create_dir(folder)?;
    }
    png::write_rgb8(map_path, error.width(), error.height(), &magma_rgb8(error))?;
    Ok(ViewMetrics {
        name: view.name.clone(),
        image: comparison.metrics,
        scene: evaluate_channels(view, renders)?,
    })
}

fn evaluate_channels(view: &View, renders: &Renders) -> Result<SceneMetrics> {
    let mut found = SceneMetrics::default();
    if let Some(reference) = &view.albedo
        && let Some(test) = renders.albedo(&view.name)?
        && let Some(albedo) = albedo_psnr(reference, &test, view.emission.as_ref())
    {
        found.albedo_psnr_srgb_db = Some(albedo.srgb_db);
        found.albedo_psnr_scaled_db = Some(albedo.scaled_srgb_db);
    }
    if let Some(reference) = &view.normal
        && let Some(test) = renders.normal(&view.name)?
    {
        found.normal_mean_deg = normal_mean_deg(reference, &test);
    }
    if let Some(reference) = &view.depth
        && let Some(test) = renders.depth(&view.name)?
    {
        found.depth_mae = depth_mae(reference, &test);
    }
    if let Some(reference) = &view.emission
        && let Some(test) = renders.emission(&view.name)?
    {
        let overlap = emission_overlap(reference, &test);
        found.emission_iou = overlap.iou();
        found.emission_overlap = overlap.iou().map(|_| overlap);
    }
    Ok(found)
}

fn means(views: &[ViewMetrics]) -> Vec<Mean> {
    METRICS
        .iter()
        .filter_map(|metric| {
            let values = || views.iter().filter_map(metric.of);
            Some(Mean {
                metric,
                value: match metric.mean {
                    MeanOf::Views => mean(values())?,
                    MeanOf::Pixels(pooled) => pooled(views)?,
                },
                num_views: values().count(),
            })
        })
        .collect()
}

fn refuse_existing(mut paths: impl Iterator<Item = PathBuf>) -> Result<()> {
    match paths.find(|path| path.exists()) {
        Some(path) => Err(EvalError::Exists { path }),
        None => Ok(()),
    }
}
