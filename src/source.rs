//! The scene to show: a file, or that of a run or a project with the dataset it was trained on.

use crate::page::PageArgs;
use crate::progress::Reporter;
use crate::record::{FILE_NAME, Input, Record};
use crate::run::project::Project;
use anyhow::{Result, bail};
use eagpt_report::run::{RunRecord, folders, read_json};
use std::path::{Path, PathBuf};

/// File name of the scene of a training.
const SCENE_FILE: &str = "scene.ply";

/// A scene, and what a run knows of it.
#[derive(Debug, PartialEq)]
pub(crate) struct Source {
    pub(crate) scene: PathBuf,
    /// The run's folder; `None` of a file.
    pub(crate) run: Option<PathBuf>,
    /// Camera file of the dataset that a run was trained on, if it is still the same.
    pub(crate) dataset: Option<PathBuf>,
    /// A dataset that a run names and that is no longer there, or another.
    pub(crate) lost: Option<PathBuf>,
}

impl Source {
    /// The scene at `path`: a file, a folder of `eagpt train` or one of `eagpt run`, or that of a
    /// project.
    ///
    /// # Errors
    /// If a folder has no scene, a project is none, or records cannot be read.
    pub(crate) fn find(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Self::of_run(path);
        }
        if path
            .extension()
            .is_some_and(|extension| extension == "toml")
        {
            return Self::of_project(path);
        }
        Ok(Self::of_file(path))
    }

    fn of_file(scene: &Path) -> Self {
        Self {
            scene: scene.to_owned(),
            run: None,
            dataset: None,
            lost: None,
        }
    }

    /// That of the run of a project, or the one that it was given in place of a training.
    fn of_project(path: &Path) -> Result<Self> {
        let project = Project::read(path, None)?;
        match &project.given().scene {
            Some(scene) => Ok(Self {
                run: Some(path.with_extension("")),
                dataset: project.given().dataset.clone(),
                ..Self::of_file(scene)
            }),
            None if project.out.is_dir() => Self::of_run(&project.out),
            None => bail!(
                "{}: has not been run: no {}",
                path.display(),
                project.out.display()
            ),
        }
    }

    fn of_run(path: &Path) -> Result<Self> {
        let mut source = Self::of_file(path);
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

    /// The options of its page: its training views are those of the dataset it was trained on,
    /// unless `args` names one. Where that is not there any more, the user is told.
    ///
    /// # Errors
    /// If standard output cannot be written.
    pub(crate) fn page(&self, args: &PageArgs, reporter: &Reporter) -> Result<PageArgs> {
        let page = args.for_run(self.run.as_deref(), self.dataset.clone());
        if let (None, Some(lost)) = (page.dataset(), &self.lost) {
            let text = format!(
                "{}: the dataset of the training is not there or has changed: --dataset names one",
                lost.display()
            );
            reporter.warning(&text);
            reporter.message(&serde_json::json!({ "message": "warning", "text": text }))?;
        }
        Ok(page)
    }
}
