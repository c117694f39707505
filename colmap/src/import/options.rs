//! Options of an import.

use crate::align::AlignOptions;
use crate::error::{ColmapError, Result};
use eagpt_scene::lens::undistort::UndistortOptions;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Options of an import.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ImportOptions {
    /// Folder of the linear images; without one, cameras and points alone are imported.
    pub images: Option<PathBuf>,
    /// Folders in `images`, one for each lighting, that share the poses; a dataset is made of each.
    pub conditions: Vec<String>,
    /// Whether 8-bit sRGB pictures are accepted in place of linear images.
    pub srgb8: Srgb8,
    /// Treatment of registered images without a file.
    pub missing: Missing,
    /// Which points are kept.
    pub points: PointFilter,
    /// The pinhole cameras.
    pub undistort: UndistortOptions,
    /// The floor.
    pub align: AlignOptions,
    /// Whether the aligned model is written beside the dataset, in the form it was read in.
    pub aligned_model: AlignedModel,
    /// Precision of the images written.
    pub precision: Depth,
}

/// Whether 8-bit sRGB pictures are accepted in place of linear images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Srgb8 {
    /// No.
    #[default]
    Refuse,
    /// Yes, decoded; light above white is lost.
    Decode,
}

/// Treatment of registered images without a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Missing {
    /// The import is refused.
    #[default]
    Refuse,
    /// The image is left out, and listed.
    Skip,
}

/// Whether the aligned model is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AlignedModel {
    /// No; the transform is in the dataset.
    #[default]
    Leave,
    /// Yes, with rigs and frames.
    Write,
}

/// Precision of the images written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Depth {
    /// 16 bits
    #[default]
    Half,
    /// 32 bits
    Float,
}

/// Which points are kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PointFilter {
    /// Fewest observations.
    pub min_track: u32,
    /// Largest mean reprojection error, pixels.
    pub max_error_px: f64,
}

impl Default for PointFilter {
    fn default() -> Self {
        Self {
            min_track: 3,
            max_error_px: 2.0,
        }
    }
}

impl ImportOptions {
    /// Checks ranges and combinations.
    ///
    /// # Errors
    /// The option and its value.
    pub fn validate(&self) -> Result<()> {
        self.align.validate()?;
        self.undistort
            .validate()
            .map_err(|problem| ColmapError::option("undistort", problem))?;
        if self.points.max_error_px.is_nan() || self.points.max_error_px <= 0.0 {
            let problem = format!("{:?} is not above 0", self.points.max_error_px);
            return Err(ColmapError::option("points.max_error_px", problem));
        }
        if self.images.is_none() && !self.conditions.is_empty() {
            let problem = "conditions are folders of images, and no images are given";
            return Err(ColmapError::option("conditions", problem));
        }
        for (at, name) in self.conditions.iter().enumerate() {
            let is_plain = Path::new(name).components().count() == 1
                && !name.contains(['/', '\\'])
                && !name.starts_with('.')
                && !name.contains(char::is_control);
            if !is_plain {
                let problem = format!("`{}` is not a valid folder name", name.escape_debug());
                return Err(ColmapError::option("conditions", problem));
            }
            if self.conditions[..at].contains(name) {
                return Err(ColmapError::option("conditions", format!("`{name}` twice")));
            }
        }
        Ok(())
    }
}
