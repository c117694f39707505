//! The project file: a section for each step, whose keys are the options of a command.

use super::section::{self, Section};
use crate::render::Mode;
use anyhow::{Context, Result};
use clap::ValueEnum;
pub(crate) use eagpt_report::run::ORIGINAL;
use eagpt_scene::dataset::Subset;
use eagpt_scene::script::ScriptFile;
use eagpt_scene::{SceneError, files};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Content of a project file, its paths resolved.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ProjectFile {
    /// Folder for all results; by default the file's name without its extension.
    pub(crate) out: Option<PathBuf>,
    /// Seed of every command that has one.
    pub(crate) seed: Option<u32>,
    /// Dataset to start from.
    pub(crate) dataset: Option<PathBuf>,
    /// Lights that are trained on together with that of the dataset: datasets, or names of
    /// `conditions` of a capture.
    pub(crate) other_lights: Vec<PathBuf>,
    /// RAW brackets to start from.
    pub(crate) capture: Option<PathBuf>,
    /// Virtual room to take RAW brackets of: a scene file, or the name of a scene.
    pub(crate) simulate: Option<String>,
    /// Lightings, each a folder of the capture; the first is the one to train on, with
    /// `other_lights`. Empty if there is but one.
    pub(super) conditions: Vec<String>,
    /// Dataset whose cameras are rendered and whose images measure the result, if not those that
    /// are trained on.
    pub(super) measure: Option<PathBuf>,
    /// A trained scene to take instead of training one.
    pub(crate) scene: Option<PathBuf>,
    /// Options of `eagpt synth`.
    pub(crate) synth: Option<Section>,
    /// Options of `eagpt ingest`.
    pub(crate) ingest: Option<Section>,
    /// Options of `eagpt colmap run`.
    pub(crate) colmap: Option<Section>,
    /// Options of `eagpt colmap import`, and `model`: poses that are there already, a COLMAP model
    /// of the previews.
    pub(crate) poses: Option<Section>,
    /// Options of `eagpt masks`; without them, masks are those of the dataset.
    pub(crate) masks: Option<Section>,
    /// Options of `eagpt normals`; without them, normals are those of the dataset.
    pub(crate) normals: Option<Section>,
    /// Options of `eagpt train`.
    pub(crate) train: Option<Section>,
    /// Options of `eagpt render` for all `modes`, and a table of options for a single mode.
    pub(crate) render: Option<Section>,
    /// Options of `eagpt bake`; without them, nothing is baked.
    pub(crate) bake: Option<Section>,
    /// Options of `eagpt eval`.
    pub(crate) eval: Option<Section>,
    /// Changes of the light, to be rendered and, where there are references, measured.
    pub(crate) relight: Vec<Relight>,
}

/// A change of the light.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Relight {
    /// Name of the condition.
    pub(crate) name: String,
    /// Edit script.
    pub(super) script: PathBuf,
    /// Dataset of the same views under this light.
    pub(crate) reference: Option<PathBuf>,
    /// Lighting of the capture that shows it.
    pub(super) condition: Option<String>,
    /// Views of the reference to measure; else the test views.
    pub(super) split: Option<Subset>,
}

/// Key of `[render]` for the modes to render.
pub(super) const MODES: &str = "modes";

impl ProjectFile {
    /// Sections with their names.
    pub(crate) fn sections_mut(&mut self) -> [(&'static str, &mut Option<Section>); 10] {
        [
            ("synth", &mut self.synth),
            ("ingest", &mut self.ingest),
            ("colmap", &mut self.colmap),
            ("poses", &mut self.poses),
            ("masks", &mut self.masks),
            ("normals", &mut self.normals),
            ("train", &mut self.train),
            ("render", &mut self.render),
            ("bake", &mut self.bake),
            ("eval", &mut self.eval),
        ]
    }

    /// Makes paths relative to `folder` absolute, or relative to where that is relative to.
    fn resolve(&mut self, folder: &Path) {
        let own = [
            &mut self.out,
            &mut self.dataset,
            &mut self.capture,
            &mut self.measure,
            &mut self.scene,
        ];
        for path in own.into_iter().flatten() {
            *path = folder.join(&*path);
        }
        if self.dataset.is_some() {
            for light in &mut self.other_lights {
                *light = folder.join(&*light);
            }
        }
        if let Some(scene) = self.simulate.as_mut().filter(|name| is_file(name)) {
            *scene = folder.join(&*scene).display().to_string();
        }
        for relight in &mut self.relight {
            relight.script = folder.join(&relight.script);
            if let Some(reference) = &mut relight.reference {
                *reference = folder.join(&*reference);
            }
        }
        for (name, section) in self.sections_mut() {
            if let Some(section) = section {
                section::resolve(name, section, folder);
            }
        }
    }
}

/// Whether a virtual room is a file; others come with the program by name.
pub(super) fn is_file(scene: &str) -> bool {
    scene.contains(['/', '.'])
}

/// A project: its file, checked as far as that goes without looking at what it names.
#[derive(Debug)]
pub(crate) struct Project {
    pub(super) script: ScriptFile,
    pub(super) file: ProjectFile,
    /// Folder for all results.
    pub(crate) out: PathBuf,
}

impl Project {
    /// Reads a project file; `out` goes before the folder in it. Paths in it are relative to its
    /// folder.
    ///
    /// # Errors
    /// If it cannot be read or is no project, naming line, key and value.
    pub(crate) fn read(path: &Path, out: Option<&Path>) -> Result<Self> {
        Self::parse(path, files::read(path)?, out)
    }

    /// As [`Self::read`], of a file's content.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn parse(path: &Path, bytes: Vec<u8>, out: Option<&Path>) -> Result<Self> {
        let script = ScriptFile::new(path, bytes)?;
        let mut file: ProjectFile = script.parse()?;
        file.resolve(path.parent().unwrap_or(Path::new("")));
        let out = out.map(Path::to_owned).or_else(|| file.out.clone());
        let out = out.unwrap_or_else(|| path.with_extension(""));
        let project = Self { script, file, out };
        project.check()?;
        Ok(project)
    }

    /// A project that is written to `path`, below a line of comment.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn derived(path: &Path, file: &ProjectFile, comment: &str) -> Result<Self> {
        let text = format!("# {comment}\n\n{}", toml::to_string(file)?);
        Self::parse(path, text.into_bytes(), None)
    }

    /// Content of a project file with all of its paths absolute, so that it may be moved.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub(crate) fn absolute(path: &Path) -> Result<ProjectFile> {
        let full = std::path::absolute(path).with_context(|| path.display().to_string())?;
        let script = ScriptFile::new(path, files::read(path)?)?;
        let mut file: ProjectFile = script.parse()?;
        file.resolve(full.parent().unwrap_or(Path::new("/")));
        Ok(file)
    }

    /// Contents of the file.
    pub(crate) fn given(&self) -> &ProjectFile {
        &self.file
    }

    /// Path of the file.
    pub(crate) fn path(&self) -> &Path {
        self.script.path()
    }

    /// Content of the file.
    pub(crate) fn text(&self) -> &str {
        self.script.text()
    }

    /// An error about the value of a key, as `["render", "spp"]`.
    pub(super) fn error(&self, keys: &[&str], problem: impl Into<String>) -> SceneError {
        section::error(&self.script, keys, problem)
    }

    fn check(&self) -> Result<()> {
        let file = &self.file;
        let sources = [
            ("dataset", file.dataset.is_some()),
            ("capture", file.capture.is_some()),
            ("simulate", file.simulate.is_some()),
        ];
        let given: Vec<&str> = sources.iter().filter(|s| s.1).map(|s| s.0).collect();
        if given.len() != 1 {
            let problem = "needs exactly one of dataset, capture, simulate";
            return Err(self.error(&given[given.len().min(1)..], problem).into());
        }
        for (name, section) in file.clone().sections_mut() {
            let problem = match section::part(name) {
                section::Part::Capture if file.dataset.is_some() => {
                    "is for a capture, not for a dataset"
                }
                section::Part::Training if file.scene.is_some() => {
                    "is for a scene to be trained, but `scene` names one that is"
                }
                _ => continue,
            };
            if section.is_some() {
                return Err(self.error(&[name], problem).into());
            }
        }
        if file.dataset.is_some() && !file.conditions.is_empty() {
            let problem = "is for a capture, not for a dataset";
            return Err(self.error(&["conditions"], problem).into());
        }
        for (index, light) in file.other_lights.iter().enumerate() {
            let name = light.to_str().unwrap_or_default();
            let others = file.conditions.iter().skip(1);
            if file.dataset.is_none() && !others.clone().any(|other| other == name) {
                let others: Vec<&str> = others.map(String::as_str).collect();
                let problem = format!(
                    "`{name}` is none of the conditions after the first: {}",
                    others.join(", ")
                );
                let keys = ["other_lights", &index.to_string()];
                return Err(self.error(&keys, problem).into());
            }
        }
        for (index, Relight { name, .. }) in file.relight.iter().enumerate() {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            let problem = if name.is_empty() || name == ORIGINAL || !name.chars().all(plain) {
                format!("`{name}` is no name of letters, digits, - and _ other than `{ORIGINAL}`")
            } else if file.relight[..index]
                .iter()
                .any(|other| other.name == *name)
            {
                format!("two conditions are called `{name}`")
            } else {
                continue;
            };
            let keys = ["relight", &index.to_string(), "name"];
            return Err(self.error(&keys, problem).into());
        }
        Ok(())
    }

    /// Modes to render, in the order of the file.
    pub(super) fn modes(&self) -> Result<Vec<Mode>> {
        let listed = self.file.render.as_ref().and_then(|of| of.get(MODES));
        let Some(listed) = listed else {
            return Ok(Mode::value_variants().to_vec());
        };
        let error = |problem: String| self.error(&["render", MODES], problem).into();
        let names = listed.as_array();
        let names = names.ok_or_else(|| error(format!("{listed} is no list")))?;
        let mode = |name: &toml::Value| {
            let found = name
                .as_str()
                .and_then(|name| Mode::from_str(name, false).ok());
            found.ok_or_else(|| {
                let known: Vec<String> = Mode::value_variants().iter().map(mode_name).collect();
                let name = name.as_str().map_or(name.to_string(), str::to_owned);
                error(format!(
                    "`{name}` is no mode; there are {}",
                    known.join(", ")
                ))
            })
        };
        names.iter().map(mode).collect()
    }
}

/// Name of a mode.
pub(super) fn mode_name(mode: &Mode) -> String {
    let value = mode.to_possible_value();
    value.map_or_else(String::new, |value| value.get_name().to_owned())
}
