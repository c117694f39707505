//! A run to be done, and its result.

use crate::options::{Stage, TrainOptions};
use crate::own_light::OwnLight;
use eagpt_scene::dataset::Split;
use eagpt_scene::files::Key;
use eagpt_trace::Device;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Policy for an output folder that already holds a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Stop with an error.
    Refuse,
    /// Resume from its newest checkpoint.
    Resume,
    /// Start over; the old run's files go.
    Overwrite,
}

/// Policy for training views that cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BadViews {
    /// Stop with an error that names it.
    Refuse,
    /// Warn and train without it.
    Skip,
}

/// A run to be done.
#[derive(Debug, Clone)]
pub struct TrainRequest {
    /// The dataset's folder or its transforms file.
    pub dataset: PathBuf,
    /// Datasets of the same place in other lights, in its world: all lights are of one geometry and
    /// albedo. They are named like their folders.
    pub other_lights: Vec<PathBuf>,
    /// Folder whose `Emissive-exr` holds the emission masks, of several lights a folder with one of
    /// each one's name that does; without it, those of the datasets.
    pub masks: Option<PathBuf>,
    /// The same of normals, in `Normal-exr`.
    pub normals: Option<PathBuf>,
    /// A scene to start from, instead of the points of the dataset.
    pub start: Option<PathBuf>,
    /// The folder for results.
    pub out: PathBuf,
    /// Options.
    pub options: TrainOptions,
    /// Policy for an earlier run's results.
    pub existing: Existing,
    /// Policy for unusable views.
    pub bad_views: BadViews,
    /// Bytes that images may take in memory; without it, half of what is free.
    pub image_budget: Option<usize>,
    /// Compute device.
    pub device: Device,
    /// Whether somebody watches: the scene is told while it trains, as
    /// [`crate::TrainProgress::Scene`].
    pub is_watched: bool,
    /// Set from outside to stop after the current iteration with a checkpoint.
    pub stop: Arc<AtomicBool>,
}

/// Summary of a finished or stopped run.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainSummary {
    /// The scene file, of several lights that of the first; `None` if the run was stopped before it
    /// was complete.
    pub scene: Option<PathBuf>,
    /// Number of Gaussians.
    pub num_gaussians: usize,
    /// Compute device.
    pub device: String,
    /// How the views were divided, those of the first light.
    pub split: Split,
    /// Names of the lights, where there are several.
    pub lights: Vec<String>,
    /// Everything that decided the result, by part.
    pub fingerprint: Key,
    /// Extent of the point cloud, scene units.
    pub extent: f32,
    /// The light of the scene, solved, against the photographs; `None` where stage 1 was not asked
    /// for, where nothing emits, or where it was stopped.
    pub own_light: Option<OwnLight>,
    /// Seconds of each stage in this process.
    pub stage_seconds: Vec<(Stage, f64)>,
    /// Warnings given.
    pub warnings: Vec<String>,
}
