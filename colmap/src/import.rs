//! From a model and linear images to a dataset.
//!
//! [`ImportPlan::new`] reads the model, finds the images, aligns the world and chooses the pinhole
//! cameras; problems are found there, before anything is written. [`ImportPlan::run`] writes:
//! images undistorted in linear light, cameras, points, a report.
//!
//! Pixels outside of a lens's image are unknown, which is neither black nor transparent: by default
//! pinhole images are cropped to avoid them. If the user keeps them, their radiance is 0 and
//! `Valid-exr/` marks them.

mod finder;
mod images;
mod options;
mod report;
mod survey;
mod views;
mod writer;

#[cfg(test)]
mod tests;

pub use images::Folder;
pub use options::{AlignedModel, Depth, ImportOptions, Missing, PointFilter, Srgb8};
pub use report::{CameraReport, ImportProgress, ImportReport};
pub use survey::{Survey, SurveyedCamera};

use crate::align::{self, Alignment, Mode};
use crate::error::{ColmapError, Result};
use crate::model::{Form, Model, Observations, Part};
use eagpt_scene::dataset::{DatasetInfo, DatasetWriter, POINTS_FILE, TRANSFORMS_FILE, UpAxis};
use eagpt_scene::exr::Precision;
use eagpt_scene::ply::{self, PointCloud};
use eagpt_scene::{Camera, files};
use finder::find_conditions;
use report::{ConditionReport, PointReport, late_warnings};
use std::path::{Path, PathBuf};
use views::{Condition, Photograph};
use writer::ConditionWriter;

/// File of the report, in the folder of results.
pub const REPORT_FILE: &str = "import.json";
/// Folder of the aligned model, in the folder of results.
pub const MODEL_DIR: &str = "colmap";

/// An import that has been checked and is ready to run.
#[derive(Debug)]
pub struct ImportPlan {
    model_dir: PathBuf,
    form: Form,
    options: ImportOptions,
    /// Model of the dataset: images by name, aligned.
    model: Model,
    alignment: Alignment,
    conditions: Vec<Condition>,
    warnings: Vec<String>,
}

impl ImportPlan {
    /// Reads the model in `model_dir`, finds its images and the floor.
    ///
    /// # Errors
    /// [`ColmapError`]: the model, the options, the images that have no file or another shape than
    /// their camera (all of them in one line), the floor.
    pub fn new(model_dir: &Path, options: &ImportOptions) -> Result<Self> {
        options.validate()?;
        let observations = match options.aligned_model {
            AlignedModel::Write => Observations::Keep,
            AlignedModel::Leave => Observations::Skip,
        };
        let mut model = Model::read(model_dir, observations)?;
        let form = Form::of(model_dir).unwrap_or(Form::Binary);
        if model.images.is_empty() {
            return Err(ColmapError::invalid(
                &Part::Images.path(model_dir, form),
                "no image is registered",
            ));
        }
        let names = views::names(&Part::Images.path(model_dir, form), &model)?;
        let mut warnings = Vec::new();
        let conditions = find_conditions(&model, &names, options, &mut warnings)?;
        let alignment = align::align(&model, &options.align)?;
        model.transform(&alignment.aligned_from_model);
        warnings.extend(alignment.warnings.iter().cloned());
        Ok(Self {
            model_dir: model_dir.to_owned(),
            form,
            options: options.clone(),
            model,
            alignment,
            conditions,
            warnings,
        })
    }

    /// Findings of the alignment.
    pub fn alignment(&self) -> &Alignment {
        &self.alignment
    }

    /// Warnings known before anything is written.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Files that were read: the model's.
    pub fn inputs(&self) -> Vec<PathBuf> {
        let paths = Part::ALL
            .into_iter()
            .map(|part| part.path(&self.model_dir, self.form));
        paths.filter(|path| path.is_file()).collect()
    }

    /// Image files that will be read.
    pub fn images(&self) -> Vec<PathBuf> {
        let photographs = self.conditions.iter().flat_map(|c| &c.photographs);
        photographs.flat_map(Photograph::sources).cloned().collect()
    }

    /// Files that will be written, relative to the folder of results; images without unknown pixels
    /// have fewer.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut all = vec![PathBuf::from(REPORT_FILE)];
        if self.options.aligned_model == AlignedModel::Write {
            let parts = Part::ALL.into_iter().filter(|part| match part {
                Part::Rigs => self.model.rigs.is_some(),
                Part::Frames => self.model.frames.is_some(),
                _ => true,
            });
            all.extend(parts.map(|part| part.path(Path::new(MODEL_DIR), self.form)));
        }
        for condition in &self.conditions {
            let dir = condition.dir();
            all.extend([TRANSFORMS_FILE, POINTS_FILE].map(|file| dir.join(file)));
            all.extend(condition.photographs.iter().flat_map(|photograph| {
                photograph.targets().into_iter().map(|file| dir.join(file))
            }));
        }
        all
    }

    /// Writes the datasets into `out`, and the aligned model if requested. `progress` is called for
    /// every image.
    ///
    /// # Errors
    /// [`ColmapError`] naming the file that cannot be read or written, or a pixel that is not
    /// finite.
    pub fn run(
        &self,
        out: &Path,
        progress: &mut dyn FnMut(ImportProgress),
    ) -> Result<ImportReport> {
        files::create_dir(out)?;
        let points = self.point_cloud();
        let info = self.info();
        let mut report = self.begin_report(points.len());
        let total = self.conditions.iter().map(|c| c.photographs.len()).sum();
        let mut done = 0;
        for (condition, told) in self.conditions.iter().zip(&mut report.conditions) {
            let dir = out.join(condition.dir());
            let precision = match self.options.precision {
                Depth::Half => Precision::Half,
                Depth::Float => Precision::Float,
            };
            let mut writer = ConditionWriter {
                writer: DatasetWriter::create(&dir, precision)?,
                condition: condition.name.as_deref(),
                done,
                total,
                progress: &mut *progress,
            };
            let outcome = writer.write(&condition.photographs)?;
            told.num_unknown_pixels = outcome.num_unknown;
            told.num_negative_pixels = outcome.num_negative;
            for photograph in &condition.photographs {
                let camera = self.camera(photograph);
                writer.writer.list(&photograph.name, camera);
            }
            ply::write_points(&dir.join(POINTS_FILE), &points)?;
            writer.writer.finish(&info)?;
            done += condition.photographs.len();
        }
        report.warn(&mut late_warnings(&report), progress);
        if self.options.aligned_model == AlignedModel::Write {
            self.model.write(&out.join(MODEL_DIR), self.form)?;
        }
        files::write_json(&out.join(REPORT_FILE), &report)?;
        Ok(report)
    }

    /// The report before anything is written.
    fn begin_report(&self, num_kept: usize) -> ImportReport {
        let mut cameras: Vec<CameraReport> = Vec::new();
        for photograph in self.conditions.iter().flat_map(|c| &c.photographs) {
            let image = &self.model.images[photograph.image];
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
            let size = self
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
        let conditions = self.conditions.iter().map(|condition| ConditionReport {
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
            model: self.model_dir.clone(),
            aligned_from_model: self.alignment.aligned_from_model.rows(),
            alignment: self.alignment.clone(),
            cameras,
            points: PointReport {
                num_points: self.model.points.len(),
                num_kept,
            },
            conditions: conditions.collect(),
            warnings: self.warnings.clone(),
        }
    }

    fn camera(&self, photograph: &Photograph) -> Camera {
        let image = &self.model.images[photograph.image];
        let world_from_camera = image.camera_from_world.inverse().affine();
        photograph.undistortion.camera(world_from_camera)
    }

    fn point_cloud(&self) -> PointCloud {
        let filter = &self.options.points;
        let kept = self.model.points.iter().filter(|point| {
            point.track_length >= filter.min_track && point.error_px <= filter.max_error_px
        });
        let mut cloud = PointCloud::default();
        for point in kept {
            cloud.positions.push(point.position.as_vec3());
            cloud.colors_srgb8.push(point.color_srgb8);
        }
        cloud
    }

    fn info(&self) -> DatasetInfo {
        let is_upright = self.alignment.mode != Mode::None;
        DatasetInfo {
            up_axis: is_upright.then_some(UpAxis::Z),
            metres_per_unit: self.alignment.is_metric.then_some(1.0),
            aligned_from_model: Some(self.alignment.aligned_from_model.rows()),
            ..DatasetInfo::default()
        }
    }
}

/// Imports the model in `model_dir` into `out`.
///
/// # Errors
/// As [`ImportPlan::new`] and [`ImportPlan::run`].
pub fn import(
    model_dir: &Path,
    out: &Path,
    options: &ImportOptions,
    progress: &mut dyn FnMut(ImportProgress),
) -> Result<ImportReport> {
    ImportPlan::new(model_dir, options)?.run(out, progress)
}
