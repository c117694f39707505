//! Drives an installed `colmap`: features, matches, a sparse model; on the CPU, without a display.
//!
//! The steps are separate calls of the program. Options have been renamed between versions (3.8 to
//! 4.x); those that a step accepts are read from its `--help`, so that one table of settings serves
//! all versions.

mod log;
mod program;

#[cfg(test)]
mod tests;

use crate::MAX_IMAGE_DEPTH;
use crate::error::{ColmapError, Result};
use crate::model::{Form, Model, Observations};
use eagpt_scene::files;
use eagpt_scene::lens::LensModel;
use log::ColmapStep;
use program::Program;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// File of the report, in the folder of the model.
pub const REPORT_FILE: &str = "run.json";
/// File of `colmap`'s output, in the folder of the model.
pub const LOG_FILE: &str = "colmap.log";
/// Temporary folder, in the folder of the model; removed at the end.
pub(crate) const WORK_DIR: &str = "work";

/// Options of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RunOptions {
    /// The program, by its name or path.
    pub program: PathBuf,
    /// Camera model, by COLMAP's name.
    pub camera_model: String,
    /// Which images share a camera.
    pub cameras: Cameras,
    /// Choice of the image pairs that are matched.
    pub matcher: Matcher,
    /// Folder of masks, NAME.EXT.png for the image NAME.EXT: black pixels are ignored.
    pub masks: Option<PathBuf>,
    /// Longer edge of images for feature extraction, pixels; larger images are downsampled.
    pub max_image_size: u32,
    /// Most features of an image.
    pub max_features: u32,
    /// Number of threads; `None`: all.
    pub threads: Option<u32>,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            program: PathBuf::from("colmap"),
            camera_model: LensModel::OpenCv.name().to_owned(),
            cameras: Cameras::Auto,
            matcher: Matcher::Auto,
            masks: None,
            max_image_size: 3200,
            max_features: 8192,
            threads: None,
        }
    }
}

/// Which images share a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Cameras {
    /// Those of a folder if all are in folders, else all
    #[default]
    Auto,
    /// All: one body, one lens, one focal length
    Single,
    /// Those of a folder
    PerFolder,
    /// None
    PerImage,
}

/// Choice of the image pairs that are matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Matcher {
    /// Each with each up to 400 images, beyond that in sequence
    #[default]
    Auto,
    /// Each with each
    Exhaustive,
    /// Each with the 20 that follow in the order of names
    Sequential,
}

/// Most images that [`Matcher::Auto`] matches exhaustively: an hour or two on a few cores.
pub(crate) const MAX_EXHAUSTIVE: usize = 400;

impl RunOptions {
    /// Checks ranges.
    ///
    /// # Errors
    /// The option and its value.
    pub fn validate(&self) -> Result<()> {
        self.camera_model
            .parse::<LensModel>()
            .map_err(|problem| ColmapError::option("camera_model", problem))?;
        for (option, value) in [
            ("max_image_size", self.max_image_size),
            ("max_features", self.max_features),
            ("threads", self.threads.unwrap_or(1)),
        ] {
            if value == 0 || i32::try_from(value).is_err() {
                return Err(ColmapError::option(
                    option,
                    format!("{value} is not 1 to 2147483647"),
                ));
            }
        }
        Ok(())
    }
}

/// Progress messages of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "message", rename_all = "snake_case")]
pub enum RunProgress {
    /// A step begins.
    Step {
        /// "features", "matches" or "model".
        step: &'static str,
    },
    /// A line of the program's log.
    Line {
        /// The step.
        step: &'static str,
        /// The line.
        text: String,
        /// Progress of the step, if the line states it.
        done: Option<Done>,
    },
}

/// Progress of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Done {
    /// Parts done.
    pub done: u64,
    /// Total number of parts.
    pub total: u64,
}

/// Report of a run, written as `run.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RunReport {
    /// Name and version that the program reports.
    pub version: String,
    /// Images with a pose, by name.
    pub registered: Vec<String>,
    /// Images without.
    pub lost: Vec<String>,
    /// Points.
    pub num_points: usize,
    /// Number of models that COLMAP made; the largest one was taken.
    pub num_models: usize,
    /// Matcher that was used.
    pub matcher: Matcher,
}

/// Name and version of an installed COLMAP.
///
/// # Errors
/// [`ColmapError::Program`] if it cannot be started, with how to install it.
pub fn version(program: &Path) -> Result<String> {
    Program::find(program).map(|program| program.version)
}

/// The names of the images COLMAP would see in a folder, relative to it, sorted.
///
/// # Errors
/// If the folder cannot be read or has no pictures of 8 bits.
pub fn list_images(dir: &Path) -> Result<Vec<String>> {
    let mut names = Vec::new();
    let mut num_exr = 0;
    for path in files::list_below(dir, MAX_IMAGE_DEPTH)? {
        let extension = path.extension().unwrap_or_default().to_str();
        match extension.unwrap_or_default().to_ascii_lowercase().as_str() {
            "jpg" | "jpeg" | "png" | "tif" | "tiff" | "bmp" if path.to_str().is_some() => {
                names.push(files::relative_name(dir, &path));
            }
            "exr" => num_exr += 1,
            _ => {}
        }
    }
    names.sort();
    if names.is_empty() {
        let problem = match num_exr {
            0 => "no images (JPEG, PNG, TIFF)".to_owned(),
            num => format!(
                "{num} EXR images, which COLMAP does not read: name a folder of PNG or JPEG pictures of the same names"
            ),
        };
        return Err(ColmapError::invalid(dir, problem));
    }
    Ok(names)
}

/// Runs COLMAP on the images in `images` and writes the largest model into `out`.
///
/// # Errors
/// [`ColmapError::Program`] without the program, where a step fails, or where no model comes out;
/// [`ColmapError`] for images and options.
pub fn run(
    images: &Path,
    out: &Path,
    options: &RunOptions,
    progress: &mut dyn FnMut(RunProgress),
) -> Result<RunReport> {
    options.validate()?;
    let names = list_images(images)?;
    if let Some(masks) = options.masks.as_deref().filter(|masks| !masks.is_dir()) {
        return Err(ColmapError::invalid(masks, "no folder of masks"));
    }
    let program = Program::find(&options.program)?;
    let matcher = match options.matcher {
        Matcher::Auto if names.len() <= MAX_EXHAUSTIVE => Matcher::Exhaustive,
        Matcher::Auto => Matcher::Sequential,
        chosen => chosen,
    };
    let work = out.join(WORK_DIR);
    files::remove_if_there(&work)?;
    let sparse = work.join("sparse");
    files::create_dir(&sparse)?;
    let places = Places {
        images,
        database: work.join("database.db"),
        sparse: &sparse,
    };
    let log_path = out.join(LOG_FILE);
    files::remove_if_there(&log_path)?;
    for step in [ColmapStep::Features, ColmapStep::Matches, ColmapStep::Model] {
        progress(RunProgress::Step { step: step.name() });
        let arguments = arguments(&program, step, matcher, &places, (options, &names))?;
        program.run(step, &arguments, &log_path, progress)?;
    }
    let (model, num_models) = largest(&sparse, &log_path)?;
    model.write(out, Form::Binary)?;
    let registered: HashSet<&str> = model.images.iter().map(|i| i.name.as_str()).collect();
    let (registered, lost) = names
        .into_iter()
        .partition(|name| registered.contains(name.as_str()));
    let report = RunReport {
        version: program.version,
        registered,
        lost,
        num_points: model.points.len(),
        num_models,
        matcher,
    };
    files::write_json(&out.join(REPORT_FILE), &report)?;
    files::remove_if_there(&work)?;
    Ok(report)
}

struct Places<'a> {
    images: &'a Path,
    database: PathBuf,
    sparse: &'a Path,
}

/// The command of a step and its arguments.
fn arguments(
    program: &Program,
    step: ColmapStep,
    matcher: Matcher,
    places: &Places<'_>,
    (options, names): (&RunOptions, &[String]),
) -> Result<Vec<String>> {
    let command = match (step, matcher) {
        (ColmapStep::Features, _) => "feature_extractor",
        (ColmapStep::Matches, Matcher::Sequential) => "sequential_matcher",
        (ColmapStep::Matches, _) => "exhaustive_matcher",
        (ColmapStep::Model, _) => "mapper",
    };
    let mut call = program.call(command)?;
    call.path(&["database_path"], &places.database)?;
    if step != ColmapStep::Matches {
        call.path(&["image_path"], places.images)?;
    }
    let threads = options.threads.map(|num| num.to_string());
    match step {
        ColmapStep::Features => {
            let in_folders = names.iter().all(|name| name.contains('/'));
            let [single, folder] = match options.cameras {
                Cameras::Auto => [!in_folders, in_folders],
                Cameras::Single => [true, false],
                Cameras::PerFolder => [false, true],
                Cameras::PerImage => [false, false],
            };
            call.required(&["ImageReader.camera_model"], &options.camera_model)?;
            call.flag(&["ImageReader.single_camera"], single);
            call.flag(&["ImageReader.single_camera_per_folder"], folder);
            if let Some(masks) = &options.masks {
                call.path(&["ImageReader.mask_path"], masks)?;
            }
            call.required(
                &["FeatureExtraction.use_gpu", "SiftExtraction.use_gpu"],
                "0",
            )?;
            let max_size = options.max_image_size.to_string();
            call.optional(
                &[
                    "FeatureExtraction.max_image_size",
                    "SiftExtraction.max_image_size",
                ],
                &max_size,
            );
            call.optional(
                &["SiftExtraction.max_num_features"],
                &options.max_features.to_string(),
            );
            // Painted walls and doors: features of two thirds of the usual contrast still match.
            call.optional(&["SiftExtraction.peak_threshold"], "0.0045");
            if let Some(threads) = &threads {
                call.optional(
                    &[
                        "FeatureExtraction.num_threads",
                        "SiftExtraction.num_threads",
                    ],
                    threads,
                );
            }
        }
        ColmapStep::Matches => {
            call.required(&["FeatureMatching.use_gpu", "SiftMatching.use_gpu"], "0")?;
            // Cupboards and chairs repeat: guided matching along epipolar lines recovers matches
            // that the ratio test rejected.
            call.optional(
                &[
                    "FeatureMatching.guided_matching",
                    "SiftMatching.guided_matching",
                ],
                "1",
            );
            if matcher == Matcher::Sequential {
                call.optional(&["SequentialMatching.overlap"], "20");
            }
            if let Some(threads) = &threads {
                call.optional(
                    &["FeatureMatching.num_threads", "SiftMatching.num_threads"],
                    threads,
                );
            }
        }
        ColmapStep::Model => {
            call.path(&["output_path"], places.sparse)?;
            // In a small room most pairs see little in common.
            call.optional(&["Mapper.abs_pose_min_num_inliers"], "20");
            if let Some(threads) = &threads {
                call.optional(&["Mapper.num_threads"], threads);
            }
        }
    }
    Ok(call.arguments)
}

/// The model with most images among those in `sparse`, and their number.
fn largest(sparse: &Path, log: &Path) -> Result<(Model, usize)> {
    let mut dirs = files::list(sparse)?;
    dirs.retain(|dir| Form::of(dir).is_some());
    let mut best: Option<Model> = None;
    for dir in &dirs {
        let model = Model::read(dir, Observations::Keep)?;
        let more = |best: &Model| model.images.len() > best.images.len();
        if best.as_ref().is_none_or(more) {
            best = Some(model);
        }
    }
    let best = best
        .filter(|model| !model.images.is_empty())
        .ok_or_else(|| {
            ColmapError::Program(format!(
                "no images could be registered: they need texture and overlap; its output is in {}",
                log.display()
            ))
        })?;
    Ok((best, dirs.len()))
}
