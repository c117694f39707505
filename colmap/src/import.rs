//! From a model and linear images to a dataset.
//!
//! [`ImportPlan::new`] reads the model, finds the images, aligns the world and chooses the pinhole
//! cameras; problems are found there, before anything is written. [`ImportPlan::run`] writes:
//! images undistorted in linear light, cameras, points, a report.
//!
//! Pixels outside of a lens's image are unknown, which is neither black nor transparent: by default
//! pinhole images are cropped to avoid them. If the user keeps them, their radiance is 0 and
//! `Valid-exr/` marks them.

mod images;
mod report;
mod survey;
mod views;

#[cfg(test)]
mod tests;

pub use images::Folder;
pub use report::{CameraReport, ImportReport};
pub use survey::{Survey, SurveyedCamera};

use crate::align::{self, AlignOptions, Alignment, Mode};
use crate::error::{ColmapError, Result};
use crate::model::{Form, Model, ModelImage, Observations, Part};
use eagpt_scene::dataset::{DatasetInfo, POINTS_FILE, TRANSFORMS_FILE, UpAxis};
use eagpt_scene::exr::Precision;
use eagpt_scene::lens::{Undistortion, undistort::UndistortOptions};
use eagpt_scene::ply::{self, PointCloud};
use eagpt_scene::{Camera, files, words};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use views::Photograph;

/// File of the report, in the folder of results.
pub const REPORT_FILE: &str = "import.json";
/// Folder of the aligned model, in the folder of results.
pub const MODEL_DIR: &str = "colmap";

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

/// A dataset to be written.
#[derive(Debug)]
struct Condition {
    name: Option<String>,
    photographs: Vec<Photograph>,
    unregistered: Vec<String>,
    missing: Vec<String>,
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
        let mut report = report::begin(self, points.len());
        let total = self.conditions.iter().map(|c| c.photographs.len()).sum();
        let mut done = 0;
        for (condition, told) in self.conditions.iter().zip(&mut report.conditions) {
            let dir = out.join(condition.dir());
            let precision = match self.options.precision {
                Depth::Half => Precision::Half,
                Depth::Float => Precision::Float,
            };
            let mut writer = views::ConditionWriter {
                writer: eagpt_scene::dataset::DatasetWriter::create(&dir, precision)?,
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
        report.warn(&mut report::late_warnings(&report), progress);
        if self.options.aligned_model == AlignedModel::Write {
            self.model.write(&out.join(MODEL_DIR), self.form)?;
        }
        files::write_json(&out.join(REPORT_FILE), &report)?;
        Ok(report)
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

impl Condition {
    /// Where its dataset goes, relative to the folder of results.
    fn dir(&self) -> PathBuf {
        self.name
            .as_deref()
            .map_or_else(PathBuf::new, PathBuf::from)
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

/// Finds the photographs of every condition. All problems are collected in one error.
fn find_conditions(
    model: &Model,
    names: &[String],
    options: &ImportOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<Condition>> {
    let mut finder = views::Finder {
        model,
        names,
        options,
        undistortions: BTreeMap::new(),
        problems: Vec::new(),
    };
    let Some(root) = &options.images else {
        let condition = finder.without_images()?;
        return Ok(vec![condition]);
    };
    let mut conditions = Vec::new();
    if options.conditions.is_empty() {
        conditions.push(finder.condition(None, root)?);
    }
    for name in &options.conditions {
        conditions.push(finder.condition(Some(name), &root.join(name))?);
    }
    finder.finish(root)?;
    for condition in &conditions {
        if condition.photographs.iter().any(Photograph::is_srgb8) {
            warnings.push(
                "8-bit sRGB pictures are decoded: light above their white is lost, and lamps are not brighter than paper"
                    .to_owned(),
            );
        }
    }
    warnings.dedup();
    Ok(conditions)
}

/// Names of images for a message.
fn listed(names: &[String]) -> String {
    let names: Vec<String> = names.iter().map(|n| n.escape_debug().to_string()).collect();
    words::listed(&names, 8)
}

/// The undistortion of an image of a size.
fn undistortion(
    model: &Model,
    image: &ModelImage,
    size: (u32, u32),
    options: &UndistortOptions,
) -> Result<Undistortion, String> {
    let camera = model
        .camera(image.camera)
        .ok_or_else(|| format!("camera {} is not there", image.camera))?;
    let lens = camera.lens.resized(size)?;
    Undistortion::new(&lens, options).map_err(|problem| format!("camera {}: {problem}", camera.id))
}
