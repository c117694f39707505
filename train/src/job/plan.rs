//! Before the work: where results go, and what the run depends on.

use super::lights::Light;
use super::{Existing, TrainRequest, write_options};
use crate::checkpoint::{self, Checkpoint};
use crate::error::Result;
use crate::options::{Stage, StageChoice, TrainOptions};
use crate::relit::RELIT_DIR;
use eagpt_scene::files::{self, Key, digest};
use eagpt_scene::lamps::{ALL_LAMPS_DIR, LAMPS_FILE};
use eagpt_scene::{Dataset, SceneError};
use std::path::{Path, PathBuf};

/// Folder of the other lights.
const LIGHTS_DIR: &str = "lights";
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

    /// Number of lights, at least 1.
    pub(super) fn num_lights(&self) -> usize {
        self.lights.len()
    }

    /// Prefix of the file names of a light: nothing for the first.
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
    let absolute = |path: &Path| {
        path.canonicalize()
            .map_err(|e| SceneError::io(path, "read", e))
    };
    let root = absolute(dataset.root())?;
    for path in images {
        let size = std::fs::metadata(path)
            .map_err(|e| SceneError::io(path, "read", e))?
            .len();
        // However it is written; a dataset may be moved with its images.
        let whole = absolute(path)?;
        let name = whole.strip_prefix(&root).unwrap_or(&whole);
        inputs.extend_from_slice(format!("{}\0{size}\0", name.display()).as_bytes());
    }
    Ok(digest::of_bytes(&inputs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use eagpt_scene::dataset::EMISSION_DIR;
    use eagpt_testkit::room;

    /// One folder of masks, written in two ways, is one dataset; another folder is another.
    #[test]
    fn masks_elsewhere_have_one_name() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path().join("room");
        let options = room::RoomOptions {
            num_views: 2,
            width: 8,
            height: 8,
            num_samples: 1,
            num_points: 10,
            seed: 0,
        };
        room::write(&root, &options, |_| ()).unwrap();
        let masks = dir.path().join("masks");
        std::fs::create_dir(&masks).unwrap();
        std::fs::rename(root.join(EMISSION_DIR), masks.join(EMISSION_DIR)).unwrap();
        let digest_with = |masks: PathBuf| {
            let dataset = Dataset::open(&root).unwrap();
            digest_of(&dataset.with_masks(&masks).unwrap()).unwrap()
        };
        let digest = digest_with(masks.clone());
        assert_eq!(digest_with(root.join("../masks")), digest);
        let others = dir.path().join("others");
        std::fs::rename(&masks, &others).unwrap();
        assert_ne!(digest_with(others), digest);
    }
}
