//! Masks to be made, what is told of it, and the result.

use crate::level::Level;
use crate::options::MaskOptions;
use crate::report::MaskReport;
use eagpt_scene::Dataset;
use serde::Serialize;
use std::path::PathBuf;

/// Request of [`super::make_masks`].
#[derive(Debug, Clone)]
pub struct MaskRequest<'a> {
    /// The dataset.
    pub dataset: &'a Dataset,
    /// Where `Emissive-exr/` and `masks/` go: the dataset's folder or another.
    pub out: PathBuf,
    /// The options.
    pub options: MaskOptions,
    /// The same place in lights in which lamps of this one are off: masks are of the light that is
    /// here and not in the darkest of those, and views that none of them has the camera of have no
    /// mask by a threshold. Empty: of all light.
    pub off: Vec<Dataset>,
    /// Folder of labels of lamps.
    pub labels: Option<PathBuf>,
    /// Folder of labels of reflections.
    pub reflections: Option<PathBuf>,
    /// Trained scene that gives depth, where the dataset has none, and emission for
    /// [`crate::MaskSource::Emission`].
    pub scene: Option<PathBuf>,
}

/// Progress messages of the job.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "kebab-case")]
pub enum MaskProgress {
    /// Radiances of views are being counted.
    Measuring {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// A level has been found.
    Level(Level),
    /// Masks are being made.
    Masking {
        /// Number of views done.
        done: usize,
        /// Total number of views.
        total: usize,
    },
    /// Overlays are being written.
    Drawing {
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

/// Result of the job.
#[derive(Debug, Clone)]
pub struct MaskSummary {
    /// All numbers.
    pub report: MaskReport,
    /// Files written, relative to the folder of results.
    pub outputs: Vec<PathBuf>,
    /// Warnings that were reported.
    pub warnings: Vec<String>,
}
