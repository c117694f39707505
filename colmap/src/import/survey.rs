//! The contents of a model, and what a search for its floor sees, whether or not it finds one.

use super::options::{ImportOptions, PointFilter};
use crate::align::gravity::GravityReport;
use crate::align::{self, Alignment};
use crate::error::{ColmapError, Result};
use crate::model::{CameraId, Model, Observations};
use serde::Serialize;
use std::path::Path;

/// Contents of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Survey {
    /// Registered images.
    pub num_images: usize,
    /// The cameras.
    pub cameras: Vec<SurveyedCamera>,
    /// All points.
    pub num_points: usize,
    /// Points with as many observations and as small an error as a point that is kept.
    pub num_good_points: usize,
    /// Conditions for a good point.
    pub filter: PointFilter,
    /// The cameras' vertical; `None` if they do not tell.
    pub gravity: Option<GravityReport>,
    /// Good points above the highest, between, and below the lowest of the cameras along the
    /// vertical.
    pub points_by_height: Option<[usize; 3]>,
}

/// A camera of a model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SurveyedCamera {
    /// Its number.
    pub id: CameraId,
    /// Name of the camera model.
    pub model: &'static str,
    /// Width and height of its images.
    pub size: [u32; 2],
    /// Its registered images.
    pub num_images: usize,
}

impl Survey {
    /// Reads the model in `model_dir`, and searches for the floor as an import does.
    ///
    /// # Errors
    /// If the model cannot be read or an option is out of its range. A floor that is not found is
    /// the error inside, [`ColmapError::Align`].
    pub fn new(
        model_dir: &Path,
        options: &ImportOptions,
    ) -> Result<(Self, Result<Alignment, ColmapError>)> {
        options.validate()?;
        let model = Model::read(model_dir, Observations::Skip)?;
        let cameras = model.cameras.iter().map(|camera| SurveyedCamera {
            id: camera.id,
            model: camera.lens.model().name(),
            size: camera.lens.size().into(),
            num_images: model
                .images
                .iter()
                .filter(|i| i.camera == camera.id)
                .count(),
        });
        let seen = align::look(&model, &options.align);
        let survey = Self {
            num_images: model.images.len(),
            cameras: cameras.collect(),
            num_points: model.points.len(),
            num_good_points: seen.num_points,
            filter: PointFilter {
                min_track: options.align.min_track,
                max_error_px: options.align.max_error_px,
            },
            gravity: seen.gravity,
            points_by_height: seen.points_by_height,
        };
        let alignment = align::align(&model, &options.align);
        Ok((survey, alignment))
    }
}
