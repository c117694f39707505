//! The report of an import, for people and for programs.

use super::{ImportPlan, ImportProgress, listed};
use crate::align::Alignment;
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

pub(super) fn begin(plan: &ImportPlan, num_kept: usize) -> ImportReport {
    let mut cameras: Vec<CameraReport> = Vec::new();
    for photograph in plan.conditions.iter().flat_map(|c| &c.photographs) {
        let image = &plan.model.images[photograph.image];
        let lens = photograph.undistortion.lens();
        let image_size: [u32; 2] = lens.size().into();
        let known = cameras
            .iter_mut()
            .find(|told| told.camera == image.camera.0 && told.image_size == image_size);
        if let Some(known) = known {
            known.num_views += 1;
            continue;
        }
        let pinhole = photograph.undistortion.camera(glam::DAffine3::IDENTITY);
        let size = plan
            .model
            .camera(image.camera)
            .map(|camera| camera.lens.size());
        cameras.push(CameraReport {
            camera: image.camera.0,
            model: lens.model().name(),
            size: size.unwrap_or_default().into(),
            image_size,
            pinhole_size: [pinhole.width, pinhole.height],
            pinhole: [pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy],
            num_views: 1,
        });
    }
    let conditions = plan.conditions.iter().map(|condition| ConditionReport {
        name: condition.name.clone(),
        registered: condition
            .photographs
            .iter()
            .map(|p| p.name.clone())
            .collect(),
        unregistered: condition.unregistered.clone(),
        missing: condition.missing.clone(),
        num_unknown_pixels: 0,
        num_negative_pixels: 0,
    });
    ImportReport {
        model: plan.model_dir.clone(),
        aligned_from_model: plan.alignment.aligned_from_model.rows(),
        alignment: plan.alignment.clone(),
        cameras,
        points: PointReport {
            num_points: plan.model.points.len(),
            num_kept,
        },
        conditions: conditions.collect(),
        warnings: plan.warnings.clone(),
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
