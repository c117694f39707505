//! The report of an import, for people and for programs, and the messages of its progress.

use crate::align::Alignment;
use eagpt_scene::words;
use serde::Serialize;
use std::path::PathBuf;

/// Report of an import, written as `import.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImportReport {
    /// Folder of the model.
    pub model: PathBuf,
    /// The floor, and the transform.
    pub alignment: Alignment,
    /// Rows of the 4×4 similarity from the model's world to the dataset's.
    pub aligned_from_model: [[f64; 4]; 4],
    /// Cameras of the model and what became of them.
    pub cameras: Vec<CameraReport>,
    /// Points.
    pub points: PointReport,
    /// Datasets.
    pub conditions: Vec<ConditionReport>,
    /// Warnings for the user.
    pub warnings: Vec<String>,
}

/// A camera.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CameraReport {
    /// Number in the model.
    pub camera: u32,
    /// Camera model.
    pub model: &'static str,
    /// Width and height that COLMAP saw.
    pub size: [u32; 2],
    /// Width and height of the images that were read.
    pub image_size: [u32; 2],
    /// Width and height of the images that were written.
    pub pinhole_size: [u32; 2],
    /// fx, fy, cx, cy of the images that were written, pixels.
    pub pinhole: [f64; 4],
    /// Views of this camera in all datasets.
    pub num_views: usize,
}

/// Points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PointReport {
    /// In the model.
    pub num_points: usize,
    /// Observed often and exactly enough.
    pub num_kept: usize,
}

/// A dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionReport {
    /// Name of the condition; null if there is only one.
    pub name: Option<String>,
    /// Views written.
    pub registered: Vec<String>,
    /// Images without a pose in the model.
    pub unregistered: Vec<String>,
    /// Images of the model that have no file.
    pub missing: Vec<String>,
    /// Pixels outside of a lens's image, in all views.
    pub num_unknown_pixels: u64,
    /// Pixels of negative radiance, clamped to 0.
    pub num_negative_pixels: u64,
}

/// Progress messages of an import.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "message", rename_all = "snake_case")]
pub enum ImportProgress {
    /// An image of a condition is written.
    Image {
        /// Name of the condition, if there are several.
        condition: Option<String>,
        /// Name of the view.
        name: String,
        /// Images done.
        done: usize,
        /// Total number of images.
        total: usize,
    },
    /// A warning.
    Warning {
        /// The text.
        text: String,
    },
}

impl ImportReport {
    /// Reports warnings and keeps them.
    pub(super) fn warn(
        &mut self,
        warnings: &mut Vec<String>,
        progress: &mut dyn FnMut(ImportProgress),
    ) {
        for text in warnings.iter() {
            progress(ImportProgress::Warning { text: text.clone() });
        }
        self.warnings.append(warnings);
    }
}

/// Warnings that follow from the images read, and from cameras without views.
pub(super) fn late_warnings(report: &ImportReport) -> Vec<String> {
    let mut warnings = Vec::new();
    for condition in &report.conditions {
        let of = condition
            .name
            .as_ref()
            .map_or(String::new(), |name| format!("{name}: "));
        for (names, what) in [
            (
                &condition.unregistered,
                "images are not registered and were left out",
            ),
            (
                &condition.missing,
                "registered images have no file and were left out",
            ),
        ] {
            if !names.is_empty() {
                warnings.push(format!("{of}{} {what}: {}", names.len(), listed(names)));
            }
        }
        if condition.num_negative_pixels > 0 {
            let num = condition.num_negative_pixels;
            warnings.push(format!("{of}negative light of {num} pixels became 0"));
        }
        if condition.num_unknown_pixels > 0 {
            let num = condition.num_unknown_pixels;
            warnings.push(format!(
                "{of}{num} pixels are outside of the lens's image: Valid-exr/ marks them, and training leaves them out"
            ));
        }
    }
    if report.points.num_kept == 0 {
        warnings.push("no point is observed often and exactly enough: training starts without points3d.ply's help".to_owned());
    }
    warnings
}

/// Names of images for a message.
pub(super) fn listed(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|n| n.escape_debug().to_string()).collect();
    words::listed(&names, 8)
}
