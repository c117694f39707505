//! The scene to show: a file, or that of a run with the dataset it was trained on.

use crate::record::{FILE_NAME, Input, Record};
use anyhow::{Result, bail};
use eagpt_report::run::{RunRecord, folders, read_json};
use std::path::{Path, PathBuf};

/// File name of the scene of a training.
const SCENE_FILE: &str = "scene.ply";

/// A scene, and what a run knows of it.
#[derive(Debug, PartialEq)]
pub(super) struct Source {
    pub(super) scene: PathBuf,
    /// The run's folder; `None` of a file.
    pub(super) run: Option<PathBuf>,
    /// Camera file of the dataset that a run was trained on, if it is still the same.
    pub(super) dataset: Option<PathBuf>,
    /// A dataset that a run names and that is no longer there, or another.
    pub(super) lost: Option<PathBuf>,
}

impl Source {
    /// The scene at `path`: a file, a folder of `eagpt train` or one of `eagpt run`.
    ///
    /// # Errors
    /// If a folder has no scene, or its records cannot be read.
    pub(super) fn find(path: &Path) -> Result<Self> {
        let mut source = Self {
            scene: path.to_owned(),
            run: None,
            dataset: None,
            lost: None,
        };
        if !path.is_dir() {
            return Ok(source);
        }
        let places = [path.to_owned(), path.join(folders::TRAIN)];
        let Some(folder) = places.iter().find(|dir| dir.join(SCENE_FILE).is_file()) else {
            bail!(
                "{}: no {SCENE_FILE} in it or in its {}/: neither a run nor a training that has \
                 ended",
                path.display(),
                folders::TRAIN
            );
        };
        source.scene = folder.join(SCENE_FILE);
        source.run = Some(path.to_owned());
        let record: Option<Record> = read_json(&folder.join(FILE_NAME))?;
        // The first input of a training is the camera file of its dataset.
        let cameras = record.filter(|record| record.command == "train");
        let Some(named) = cameras.and_then(|record| record.inputs.into_iter().next()) else {
            return Ok(source);
        };
        // Named from where the program was called, which need not be where it is called now.
        let run = RunRecord::read(path)?;
        let beside = run.and_then(|run| Some(run.project.parent()?.join(&named.path)));
        for place in [Some(named.path.clone()), beside].into_iter().flatten() {
            if place.is_file() && Input::of(&place)?.blake3 == named.blake3 {
                source.dataset = Some(place);
                return Ok(source);
            }
        }
        source.lost = Some(named.path);
        Ok(source)
    }
}
