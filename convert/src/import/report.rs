//! The report of an import, written as `import.json`.

use super::ImportOptions;
use crate::color::ColorTransform;
use crate::error::Problem;
use crate::source::{SourceDataset, SourceFormat};
use eagpt_scene::Camera;
use eagpt_scene::dataset::UpAxis;
use eagpt_scene::lens::Undistortion;
use glam::{DAffine3, DMat3};
use serde::Serialize;
use std::path::PathBuf;

/// Its file, in the dataset's folder.
pub const REPORT_FILE: &str = "import.json";
/// Share of negative pixels in a view above which a warning is given.
const MAX_NEGATIVE: f64 = 0.01;

/// Report of an import.
#[derive(Debug, Clone, Serialize)]
pub struct ImportReport {
    /// The source's folder.
    pub source: PathBuf,
    /// Its layout.
    pub format: SourceFormat,
    /// Its up axis.
    pub source_up_axis: Option<UpAxis>,
    /// Rows of the rotation from the source's world into the dataset's.
    pub world_from_source: [[f64; 3]; 3],
    /// Colour transform that was applied.
    pub color: ColorTransform,
    /// Rows of the matrix from the source's values to linear Rec.709.
    pub rec709_from_source: [[f64; 3]; 3],
    /// Effective options.
    pub options: ImportOptions,
    /// The lenses and the pinhole cameras that took their place.
    pub lenses: Vec<LensReport>,
    /// Points of the cloud, if there is one.
    pub num_points: Option<usize>,
    /// Views, in their order.
    pub views: Vec<ViewReport>,
    /// Frames that were left out.
    pub left_out: Vec<Problem>,
    /// Findings and decisions.
    pub notes: Vec<String>,
    /// Warnings about the dataset.
    pub warnings: Vec<String>,
}

/// A lens and its pinhole camera.
#[derive(Debug, Clone, Serialize)]
pub struct LensReport {
    /// Name of COLMAP's camera model.
    pub model: &'static str,
    /// Parameters, by COLMAP's order.
    pub params: Vec<f64>,
    /// Width and height of the source's images.
    pub size: [u32; 2],
    /// The camera that took its place; its pose means nothing.
    pub pinhole: Camera,
    /// Whether images keep their pixels.
    pub kept: bool,
}

/// A view.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ViewReport {
    /// Name.
    pub name: String,
    /// Pixels of the dataset's image.
    pub num_pixels: usize,
    /// Pixels of the source's image with a negative value, now 0.
    pub num_negative: usize,
    /// Pixels of the dataset's image that are not known.
    pub num_unknown: usize,
    /// Pixels of the dataset's image with a clipped channel.
    pub num_clipped: usize,
}

impl LensReport {
    pub(super) fn new(undistortion: &Undistortion) -> Self {
        let lens = undistortion.lens();
        Self {
            model: lens.model().name(),
            params: lens.params().to_vec(),
            size: lens.size().into(),
            pinhole: undistortion.camera(DAffine3::IDENTITY),
            kept: undistortion.is_identity(),
        }
    }
}

impl ImportReport {
    pub(super) fn new(source: &SourceDataset, options: &ImportOptions, world: DMat3) -> Self {
        Self {
            source: source.root.clone(),
            format: source.format,
            source_up_axis: source.info.up_axis,
            world_from_source: rows(world),
            color: source.color,
            rec709_from_source: rows(source.color.matrix()),
            options: options.clone(),
            lenses: Vec::new(),
            num_points: None,
            views: Vec::new(),
            left_out: source.problems.clone(),
            notes: source.notes.clone(),
            warnings: source.warnings.clone(),
        }
    }

    /// Adds warnings that follow from all views together.
    pub(super) fn warn_of_views(&mut self) {
        let is_negative =
            |v: &&ViewReport| v.num_negative as f64 > MAX_NEGATIVE * v.num_pixels as f64;
        let negative: Vec<&ViewReport> = self.views.iter().filter(is_negative).collect();
        if let Some(most) = negative.iter().max_by_key(|view| view.num_negative) {
            self.warnings.push(format!(
                "{} views have negative radiances in more than 1 % of their pixels, now 0; {} has most, {}",
                negative.len(),
                most.name,
                most.num_negative
            ));
        }
        let num_masked = self
            .views
            .iter()
            .filter(|view| view.num_unknown > 0)
            .count();
        if num_masked > 0 {
            self.warnings.push(format!(
                "{num_masked} views have pixels that are not known: {} says which, and training and evaluation leave them out",
                eagpt_scene::dataset::VALID_DIR
            ));
        }
        let num_clipped = self
            .views
            .iter()
            .filter(|view| view.num_clipped > 0)
            .count();
        if num_clipped > 0 {
            let pixels: usize = self.views.iter().map(|view| view.num_pixels).sum();
            let clipped: usize = self.views.iter().map(|view| view.num_clipped).sum();
            self.warnings.push(format!(
                "{num_clipped} views have clipped pixels, {:.2} % of all: {} says which, and training takes their light for a lower bound",
                100.0 * clipped as f64 / pixels as f64,
                eagpt_scene::dataset::CLIPPED_DIR
            ));
        }
        if self.num_points.is_none() {
            self.warnings.push(
                "there is no point cloud: training will start from points where the views agree; a points3d.ply with colours in the dataset is better".to_owned(),
            );
        }
        if !self.left_out.is_empty() {
            self.warnings
                .push(format!("{} frames were left out", self.left_out.len()));
        }
    }
}

fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
    matrix.transpose().to_cols_array_2d()
}
