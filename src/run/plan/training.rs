//! Masks, normals and training, in one light or in several.

use super::Plan;
use crate::command::JobCommand;
use crate::masks::MasksArgs;
use crate::normals::NormalsArgs;
use crate::run::options::Options;
use crate::run::project::Project;
use crate::train::TrainArgs;
use anyhow::Result;
use clap::Args;
use eagpt_report::run::folders;
use eagpt_scene::dataset::{EMISSION_DIR, NORMAL_DIR};
use eagpt_scene::lamps::ALL_LAMPS_DIR;
use eagpt_train::job::light_name;
use std::path::{Path, PathBuf};

/// A light to train on.
pub(super) struct Light {
    /// Name of the folder of its dataset.
    name: String,
    dataset: PathBuf,
}

/// The scene that scripts change: of several lights the one with the lamps of all on, which
/// training leaves beside `scene`.
pub(super) fn all_lamps_on(scene: &Path, num_lights: usize) -> PathBuf {
    match (num_lights, scene.parent(), scene.file_name()) {
        (2.., Some(folder), Some(name)) => folder.join(ALL_LAMPS_DIR).join(name),
        _ => scene.to_owned(),
    }
}

impl Plan {
    /// The lights to train on, the first one that of `dataset`.
    ///
    /// # Errors
    /// If two have the same name.
    pub(super) fn lights(&self, project: &Project, dataset: &Path) -> Result<Vec<Light>> {
        let file = &project.file;
        let of_capture = file.dataset.is_none();
        let others = file.other_lights.iter().map(|other| match of_capture {
            true => self.out.join("dataset").join(other),
            false => other.clone(),
        });
        let mut lights: Vec<Light> = Vec::new();
        for dataset in std::iter::once(dataset.to_owned()).chain(others) {
            let name = light_name(&dataset);
            if lights.iter().any(|known| known.name == name) {
                let problem = format!(
                    "another light is called `{name}`, too: lights have the names of their folders"
                );
                let place = (lights.len() - 1).to_string();
                return Err(project.error(&["other_lights", &place], problem).into());
            }
            lights.push(Light { name, dataset });
        }
        Ok(lights)
    }

    /// Masks, normals and training; returns the scene, in the first light.
    pub(super) fn train(&mut self, project: &Project, lights: &[Light]) -> Result<PathBuf> {
        let Options { mut args, paths } = project.options::<TrainArgs>("train")?;
        let mut datasets = lights.iter().map(|light| light.dataset.clone());
        args.dataset = datasets.next();
        args.other_lights = datasets.collect();
        let mut takes: Vec<PathBuf> = lights.iter().map(|light| light.dataset.clone()).collect();
        takes.extend(paths);
        let taken_twice = |name: &str| {
            let problem = format!("the section [{name}] makes them");
            project.error(&["train", name], problem)
        };
        if project.file.masks.is_some() {
            let command = |mut of: MasksArgs, dataset, out| {
                (of.dataset, of.out) = (dataset, Some(out));
                JobCommand::Masks(of)
            };
            let made = self.maps(project, (folders::MASKS, EMISSION_DIR), lights, command)?;
            takes.extend(made);
            if args.masks.replace(self.out.join(folders::MASKS)).is_some() {
                return Err(taken_twice("masks").into());
            }
        }
        if project.file.normals.is_some() {
            let command = |mut of: NormalsArgs, dataset, out| {
                (of.dataset, of.out) = (dataset, Some(out));
                JobCommand::Normals(of)
            };
            let made = self.maps(project, ("normals", NORMAL_DIR), lights, command)?;
            takes.extend(made);
            if args.normals.replace(self.out.join("normals")).is_some() {
                return Err(taken_twice("normals").into());
            }
        }
        let out = self.out.join(folders::TRAIN);
        let scene = out.join("scene.ply");
        args.out = Some(out);
        self.add("train", JobCommand::Train(args), takes, scene.clone());
        if lights.len() > 1 {
            let step = self.steps.last_mut();
            step.expect("it was just added")
                .products
                .push(all_lamps_on(&scene, lights.len()));
        }
        Ok(scene)
    }

    /// Maps for the views of all lights, by the command of a section; returns their folders.
    fn maps<A: Args>(
        &mut self,
        project: &Project,
        (section, folder): (&str, &str),
        lights: &[Light],
        command: impl Fn(A, PathBuf, PathBuf) -> JobCommand,
    ) -> Result<Vec<PathBuf>> {
        let mut made = Vec::new();
        for Light { name, dataset } in lights {
            let name = match lights.len() {
                1 => section.to_owned(),
                _ => format!("{section}/{name}"),
            };
            let out = self.out.join(&name);
            let maps = out.join(folder);
            let Options { args, paths } = project.options::<A>(section)?;
            let takes = [dataset.clone()].into_iter().chain(paths);
            let command = command(args, dataset.clone(), out);
            self.add(name, command, takes, maps.clone());
            made.push(maps);
        }
        Ok(made)
    }
}
