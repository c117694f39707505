//! Before the work: where results go, what the run depends on, whether it fits into memory.

use super::lights::Light;
use super::{Existing, TrainRequest, write_options};
use crate::checkpoint::{self, Checkpoint};
use crate::error::{Result, TrainError};
use crate::options::{Stage, StageChoice, TrainOptions};
use eagpt_scene::files::{self, Key, digest};
use eagpt_scene::lamps::LAMPS_FILE;
use eagpt_scene::machine::available_memory;
use eagpt_scene::{Dataset, SceneError};
use std::path::PathBuf;

/// Bytes a Gaussian takes while it is trained: raw values, moments, gradients (4 × 17 floats), its
/// activated and prepared forms.
const BYTES_PER_GAUSSIAN: u64 = 4 * 17 * 4 + 17 * 4 + 2 * 64 + 64;
/// Bytes that the coefficients of a Gaussian's harmonics take: values, moments, gradients, those of
/// the Gaussian, prepared ones; and its payload as a camera sees it.
const BYTES_PER_HARMONICS: u64 = 6 * 24 * 4 + 64;
/// Bytes that one of several lights takes for each Gaussian: values and moments, and the Gaussian
/// in it when training ends; and its harmonics.
const BYTES_PER_LIGHT: u64 = 3 * 4 * 4 + 17 * 4;
const BYTES_PER_LIGHT_HARMONICS: u64 = 4 * 24 * 4;
/// Bytes a pixel of the current view takes: features and their gradient (16 floats each), some
/// forty recorded hits, images of the loss.
const BYTES_PER_PIXEL: u64 = 2 * 64 + 40 * 12 + 200;
/// Bytes a pixel of a prepared view takes: radiance, normal, mask, opacity, irradiance and where
/// emitters are, all as floats, and the target.
const BYTES_PER_VIEW_PIXEL: u64 = (3 + 3 + 1 + 1 + 4 + 4) * 4 + 3 * 2;

/// Folder of the other lights.
const LIGHTS_DIR: &str = "lights";
/// Folder of the scene in which the lamps of all lights are on.
const ALL_LAMPS_DIR: &str = "all-lamps";
/// The scene in its folder.
const SCENE_FILE: &str = "scene.ply";

/// The files of a run.
pub(crate) struct Folder {
    root: PathBuf,
    /// Names of the lights.
    lights: Vec<String>,
    /// Whether stage 1 alone continues from the end of stage 0 in this folder.
    takes_radiance: bool,
}

/// Where a run takes up.
pub(super) struct Resumed {
    /// The state to continue from; `None` starts over.
    pub(super) checkpoint: Option<Checkpoint>,
    /// Warnings for the user.
    pub(super) warnings: Vec<String>,
}

impl Folder {
    pub(super) fn new(request: &TrainRequest, lights: &[Light]) -> Self {
        Self {
            root: request.out.clone(),
            lights: lights.iter().map(|light| light.name.clone()).collect(),
            takes_radiance: request.options.stage == StageChoice::Albedo && request.start.is_none(),
        }
    }

    pub(super) fn log(&self) -> PathBuf {
        self.root.join("log.jsonl")
    }

    pub(super) fn checkpoints(&self) -> PathBuf {
        self.root.join("checkpoints")
    }

    pub(crate) fn previews(&self) -> PathBuf {
        self.root.join("previews")
    }

    /// What file names of a light begin with: nothing for the first.
    pub(crate) fn prefix(&self, light: usize) -> String {
        match light {
            0 => String::new(),
            _ => format!("{}-", self.lights[light]),
        }
    }

    /// Folder of the scene in a light: its own for the first one.
    fn of_light(&self, light: usize) -> PathBuf {
        match light {
            0 => self.root.clone(),
            _ => self.root.join(LIGHTS_DIR).join(&self.lights[light]),
        }
    }

    /// The scene in a light.
    pub(super) fn scene(&self, light: usize) -> PathBuf {
        self.of_light(light).join(SCENE_FILE)
    }

    /// The lamps that are on in a light.
    pub(super) fn lamps(&self, light: usize) -> PathBuf {
        self.of_light(light).join(LAMPS_FILE)
    }

    /// Scene and lamps with the lamps of all lights on.
    pub(super) fn all_lamps(&self) -> [PathBuf; 2] {
        [SCENE_FILE, LAMPS_FILE].map(|name| self.root.join(ALL_LAMPS_DIR).join(name))
    }

    /// Makes the folder ready and finds out where to take up. A run that may not go on leaves the
    /// folder as it is.
    pub(super) fn prepare(
        &self,
        existing: Existing,
        options: &TrainOptions,
        fingerprint: &Key,
    ) -> Result<Resumed> {
        let resumed = self.take_up(existing, options, fingerprint)?;
        write_options(&self.root, options)?;
        if self.lights.len() > 1 {
            files::create_dir(&self.root.join(ALL_LAMPS_DIR))?;
            for light in 1..self.lights.len() {
                files::create_dir(&self.of_light(light))?;
            }
        }
        Ok(resumed)
    }

    fn take_up(
        &self,
        existing: Existing,
        options: &TrainOptions,
        fingerprint: &Key,
    ) -> Result<Resumed> {
        let occupied = !checkpoint::list(&self.checkpoints())?.is_empty() || self.log().exists();
        let albedo_only = self.takes_radiance;
        if occupied && existing == Existing::Refuse && !albedo_only {
            let problem = "holds an earlier run: --resume continues it, --force starts over, --out names another folder";
            return Err(SceneError::Work {
                path: self.root.clone(),
                problem: problem.to_owned(),
            }
            .into());
        }
        if existing == Existing::Overwrite && !albedo_only {
            for path in [
                self.checkpoints(),
                self.previews(),
                self.log(),
                self.root.join(SCENE_FILE),
                self.root.join(LAMPS_FILE),
                self.root.join(LIGHTS_DIR),
                self.root.join(ALL_LAMPS_DIR),
                self.root.join("record.json"),
            ] {
                files::remove_if_there(&path)?;
            }
        }
        if albedo_only && existing != Existing::Resume {
            return self.end_of_radiance(options, fingerprint);
        }
        if existing != Existing::Resume || !occupied {
            return Ok(Resumed {
                checkpoint: None,
                warnings: Vec::new(),
            });
        }
        if checkpoint::list(&self.checkpoints())?.is_empty() {
            // Killed before its first checkpoint: the run begins again, which gives the same bits.
            return Ok(Resumed {
                checkpoint: None,
                warnings: Vec::new(),
            });
        }
        let (checkpoint, warnings) = checkpoint::newest(&self.checkpoints())?;
        self.check(&checkpoint, fingerprint, true)?;
        Ok(Resumed {
            checkpoint: Some(checkpoint),
            warnings,
        })
    }

    /// The state in which stage 0 ended, for a run of stage 1 alone.
    fn end_of_radiance(&self, options: &TrainOptions, fingerprint: &Key) -> Result<Resumed> {
        let name = Checkpoint::file_name(Stage::Radiance, options.radiance.iterations);
        let path = self.checkpoints().join(name);
        if !path.exists() {
            let problem =
                "is missing: stage 1 continues from the end of stage 0 (same folder, same options)";
            return Err(SceneError::Work {
                path,
                problem: problem.to_owned(),
            }
            .into());
        }
        let checkpoint = Checkpoint::read(&path)?;
        self.check(&checkpoint, fingerprint, false)?;
        Ok(Resumed {
            checkpoint: Some(checkpoint),
            warnings: Vec::new(),
        })
    }

    fn check(&self, checkpoint: &Checkpoint, wanted: &Key, with_albedo: bool) -> Result<()> {
        let part = |part: &str| match part {
            "start" => Some("scene to start from"),
            "radiance" => Some("options of stage 0, seed, split or starting values"),
            "albedo" => {
                (with_albedo && checkpoint.stage == Stage::Albedo).then_some("options of stage 1")
            }
            _ => Some("dataset"),
        };
        let differs = checkpoint.fingerprint.differences(wanted).into_iter();
        let differs: Vec<&str> = differs.filter_map(part).collect();
        if differs.is_empty() {
            return Ok(());
        }
        let problem = format!(
            "cannot continue this run: it was made with another {}",
            differs.join(" and another ")
        );
        Err(SceneError::Work {
            path: self.root.clone(),
            problem,
        }
        .into())
    }
}

/// Everything that decides the result: the datasets, and the options of the stages.
pub(super) fn fingerprint(lights: &[Light], options: &TrainOptions) -> Result<Key> {
    let radiance = (
        options.seed,
        options.split,
        options.num_gaussians,
        &options.init,
        &options.radiance,
    );
    let mut key = Key::new().with("dataset", digest_of(&lights[0].dataset)?);
    for light in &lights[1..] {
        key = key.with(&light_part(&light.name), digest_of(&light.dataset)?);
    }
    let key = (key.with_value("radiance", &radiance)?).with_value("albedo", &options.albedo)?;
    Ok(key)
}

/// Part of the fingerprint that is the dataset of another light than the first.
pub fn light_part(name: &str) -> String {
    format!("light {name}")
}

/// Digest of the camera file, and of names and sizes of all images.
fn digest_of(dataset: &Dataset) -> Result<String> {
    let mut inputs = files::read(dataset.transforms())?;
    let images = dataset.frames().iter().flat_map(|frame| {
        let f = &frame.files;
        [
            Some(&f.radiance),
            f.emission.as_ref(),
            f.normal.as_ref(),
            f.alpha.as_ref(),
            f.clipped.as_ref(),
            f.valid.as_ref(),
        ]
        .into_iter()
        .flatten()
    });
    for path in images {
        let size = std::fs::metadata(path)
            .map_err(|e| SceneError::io(path, "read", e))?
            .len();
        let name = path.strip_prefix(dataset.root()).unwrap_or(path);
        inputs.extend_from_slice(format!("{}\0{size}\0", name.display()).as_bytes());
    }
    Ok(digest::of_bytes(&inputs))
}

/// Memory that a run takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Memory {
    /// Bytes without which it is refused: one view at a time.
    least: u64,
    /// Bytes of the images, all of them prepared.
    images: u64,
    /// Bytes of the largest of them.
    largest_image: u64,
}

/// Plans the memory of training.
///
/// # Errors
/// If the points cannot be read.
fn memory(lights: &[Light], options: &TrainOptions) -> Result<Memory> {
    let pixels = || {
        lights.iter().flat_map(|light| {
            let frames = light.dataset.frames();
            let views = light.split.train.iter();
            views.map(|&i| frames[i].camera.num_pixels() as u64)
        })
    };
    let largest = pixels().max().unwrap_or(0);
    let images: u64 = pixels().sum::<u64>() * BYTES_PER_VIEW_PIXEL;
    let num_gaussians = options.gaussians_for(options.num_points(&lights[0].dataset)?) as u64;
    let bytes_per_gaussian = match options.radiance.harmonics.degree {
        0 => BYTES_PER_GAUSSIAN,
        _ => BYTES_PER_GAUSSIAN + BYTES_PER_HARMONICS,
    };
    let bytes_per_light = match (lights.len(), options.radiance.harmonics.degree) {
        (1, _) => 0,
        (_, 0) => BYTES_PER_LIGHT,
        _ => BYTES_PER_LIGHT + BYTES_PER_LIGHT_HARMONICS,
    };
    let bytes_per_gaussian = bytes_per_gaussian + lights.len() as u64 * bytes_per_light;
    let fixed = num_gaussians * bytes_per_gaussian + largest * BYTES_PER_PIXEL;
    let irradiance = if options.stage == StageChoice::Radiance {
        0
    } else {
        images / 5
    };
    let largest_image = largest * BYTES_PER_VIEW_PIXEL;
    Ok(Memory {
        least: fixed + largest_image + irradiance,
        images,
        largest_image,
    })
}

/// Checks the job's memory against the machine's and says how many bytes images may take.
pub(super) fn image_budget(request: &TrainRequest, lights: &[Light]) -> Result<usize> {
    let Memory {
        least,
        images,
        largest_image,
    } = memory(lights, &request.options)?;
    let Some(available) = available_memory() else {
        return Ok(request.image_budget.unwrap_or(images as usize));
    };
    if least > available {
        return Err(TrainError::Memory {
            needed_mib: least >> 20,
            available_mib: available >> 20,
            advice: "fewer Gaussians (--gaussians) or smaller images would help".to_owned(),
        });
    }
    Ok(request
        .image_budget
        .unwrap_or(((available - least) / 2).min(images) as usize)
        .max(largest_image as usize))
}
