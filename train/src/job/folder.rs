//! Where the results of a run go, and where it takes up.

use super::lights::Light;
use super::request::{Existing, TrainRequest};
use crate::checkpoint::{self, Checkpoint};
use crate::error::Result;
use crate::options::{Stage, StageChoice, TrainOptions};
use crate::relit::RELIT_DIR;
use eagpt_scene::SceneError;
use eagpt_scene::files::{self, Key};
use eagpt_scene::lamps::{ALL_LAMPS_DIR, LAMPS_FILE};
use std::path::{Path, PathBuf};

/// Folder of the other lights.
const LIGHTS_DIR: &str = "lights";
/// Mirrors of the scene, and the folder of the pixels that show them.
const MIRRORS_FILE: &str = "mirrors.json";
const MIRRORS_DIR: &str = "mirrors";
/// The scene in its folder.
const SCENE_FILE: &str = "scene.ply";

/// The files of a run.
pub(super) struct Folder {
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

    pub(super) fn previews(&self) -> PathBuf {
        self.root.join("previews")
    }

    /// Mirrors that were found.
    pub(super) fn mirrors(&self) -> PathBuf {
        self.root.join(MIRRORS_FILE)
    }

    /// Folder of [`Self::mirror_mask`].
    pub(super) fn mirror_masks(&self) -> PathBuf {
        self.root.join(MIRRORS_DIR)
    }

    /// The pixels of a view in a light that show mirrors.
    pub(super) fn mirror_mask(&self, light: usize, view: &str) -> PathBuf {
        let name = format!("{}{}.png", self.prefix(light), view.replace('/', "_"));
        self.mirror_masks().join(name)
    }

    /// Number of lights, at least 1.
    pub(super) fn num_lights(&self) -> usize {
        self.lights.len()
    }

    /// Prefix of the file names of a light: nothing for the first.
    pub(super) fn prefix(&self, light: usize) -> String {
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

    /// The bare lamps that are clean before all are.
    pub(super) fn bare_lamps(&self) -> PathBuf {
        self.checkpoints().join(LAMPS_FILE)
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
                self.mirrors(),
                self.mirror_masks(),
                self.root.join(SCENE_FILE),
                self.root.join(LAMPS_FILE),
                self.root.join(LIGHTS_DIR),
                self.root.join(ALL_LAMPS_DIR),
                self.root.join(RELIT_DIR),
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

/// Creates the output folder and notes the effective options in it: a folder that cannot be written
/// is found before any work.
fn write_options(out: &Path, options: &TrainOptions) -> Result<()> {
    files::create_dir(out)?;
    let path = out.join("train.toml");
    let text = toml::to_string(options)
        .map_err(|e| SceneError::invalid(&path, "options", e.to_string()))?;
    files::write_bytes_atomic(&path, text.as_bytes())?;
    Ok(())
}
