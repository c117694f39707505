//! What the job tells, on its way and in the end.

use super::{Axes, Reference, Space};
use serde::Serialize;
use std::path::PathBuf;

/// What the job tells as it goes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum NormalProgress {
    /// A network has looked at so many views.
    Estimating {
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
    /// So many views were compared with the dataset.
    Comparing {
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
    /// How maps are read.
    Reading(Reading),
    /// So many views have their normals.
    Writing {
        /// Views done.
        done: usize,
        /// Views in all.
        total: usize,
    },
    /// What a reader of the result has to know.
    Warning {
        /// In one line.
        text: String,
    },
}

/// How maps are read, and how sure that is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reading {
    /// Space of the vectors.
    pub space: Space,
    /// Their axes.
    pub axes: Axes,
    /// What they were held against.
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
    /// How maps were read.
    pub reading: Reading,
    /// Views with a map.
    pub views: Vec<NormalView>,
    /// Views without, by name.
    pub missing: Vec<String>,
}

/// What became of it.
#[derive(Debug, Clone)]
pub struct NormalSummary {
    /// All numbers.
    pub report: NormalReport,
    /// Files written, relative to the folder of results.
    pub outputs: Vec<PathBuf>,
    /// Warnings told on the way.
    pub warnings: Vec<String>,
}
