//! Progress messages and report of the job.

use super::{Axes, Reference, Space};
use serde::Serialize;
use std::path::PathBuf;

/// Progress messages of the job.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum NormalProgress {
    /// The network is being run on views.
    Estimating {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// Views are being compared with the dataset.
    Comparing {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// Interpretation of the maps.
    Reading(Reading),
    /// Normals are being written.
    Writing {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A warning about the result.
    Warning {
        /// The text, one line.
        text: String,
    },
}

/// Interpretation of maps, and its confidence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reading {
    /// Space of the vectors.
    pub space: Space,
    /// Their axes.
    pub axes: Axes,
    /// The reference they were compared with.
    pub reference: Reference,
    /// Mean cosine to the reference, if there is one.
    pub mean_cosine: Option<f64>,
    /// That of the best of all other readings.
    pub next_best: Option<f64>,
}

/// A view with a map.
#[derive(Debug, Clone, Serialize)]
pub struct NormalView {
    /// Name.
    pub name: String,
    /// The map.
    pub map: PathBuf,
    /// Share of pixels with a normal.
    pub known: f64,
    /// Share of the map's vectors that are turned to the camera.
    pub facing: f64,
    /// Mean angle to the reference, degrees, if there is one.
    pub angle_deg: Option<f64>,
}

/// All numbers.
#[derive(Debug, Clone, Serialize)]
pub struct NormalReport {
    /// Interpretation of the maps.
    pub reading: Reading,
    /// Views with a map.
    pub views: Vec<NormalView>,
    /// Views without, by name.
    pub missing: Vec<String>,
}

/// Result of the job.
#[derive(Debug, Clone)]
pub struct NormalSummary {
    /// All numbers.
    pub report: NormalReport,
    /// Files written, relative to the folder of results.
    pub outputs: Vec<PathBuf>,
    /// Warnings that were reported.
    pub warnings: Vec<String>,
}
