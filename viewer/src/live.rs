//! An edit under way: acts that pages ask for, each a step of a script, with undo and redo.
//!
//! The script is on disk after every act, as `eagpt edit` replays it. While its steps only set
//! lights of the scene's light basis ([`eagpt_scene::light_basis`]), pages sum the light
//! themselves. Any other step makes another scene, which is replayed here.

mod original;
mod step;

pub use original::Original;
pub use step::Step;

use crate::error::{Result, ViewerError};
use eagpt_scene::script::ScriptFile;
use eagpt_scene::{Gaussians, files};
use serde::{Deserialize, Serialize};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Brightest factor of a light: far more than anybody wants, far less than overflows.
const MAX_FACTOR: f32 = 1e6;
/// Most steps of a script.
const MAX_STEPS: usize = 10_000;

/// A light and its factor by channel: parts of the light it had when the basis was baked.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetLight {
    /// Name of the light.
    pub name: String,
    /// Not negative, at most a million.
    pub factor: [f32; 3],
}

/// A request of a page.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Act {
    /// A light is set.
    SetLight(SetLight),
    /// Another step that sets no light.
    Step(Box<Step>),
    /// The last step goes.
    Undo,
    /// The step that went last comes back.
    Redo,
}

/// A script as [`Edit`] writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScriptKeys {
    #[serde(default)]
    step: Vec<Step>,
}

/// An edit of a scene.
#[derive(Debug)]
pub struct Edit {
    path: PathBuf,
    original: Arc<Original>,
    lights: Vec<String>,
    /// In the order in which they were done.
    steps: Vec<Step>,
    undone: Vec<Step>,
    /// The scene after all steps, if any of them does more than to set lights.
    changed: Option<Arc<Gaussians>>,
    revision: u64,
}

/// The state of an edit that pages show.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub(crate) struct EditState {
    /// Grows with every act.
    pub revision: u64,
    /// Factors of all lights, by name.
    pub factors: BTreeMap<String, [f32; 3]>,
    /// The script.
    pub script: String,
    /// File of the script.
    pub file: String,
    /// Whether there is a step to undo.
    pub can_undo: bool,
    /// Whether there is one to redo.
    pub can_redo: bool,
}

impl Edit {
    /// An edit of a scene, whose script is the file `path`: goes on from there if it is one that an
    /// earlier edit has written.
    ///
    /// # Errors
    /// [`ViewerError`] naming the file if it is another script, or of another scene.
    pub fn open(path: &Path, original: Original) -> Result<Self> {
        let mut edit = Self {
            path: path.to_owned(),
            lights: original.lights(),
            original: Arc::new(original),
            steps: Vec::new(),
            undone: Vec::new(),
            changed: None,
            revision: 0,
        };
        if !path.exists() {
            return Ok(edit);
        }
        let keys: ScriptKeys = ScriptFile::read(path)?.parse()?;
        for (index, step) in keys.step.iter().enumerate() {
            edit.check(step).map_err(|problem| {
                ViewerError::Script(format!("{}: step[{index}]: {problem}", path.display()))
            })?;
        }
        edit.changed = edit.replayed(&keys.step)?;
        edit.steps = keys.step;
        Ok(edit)
    }

    /// Checks what a step says of lights.
    fn check(&self, step: &Step) -> Result<(), String> {
        let Some(set) = &step.set_light else {
            return Ok(());
        };
        let (Some((name, factor)), 1) = (set.iter().next(), set.len()) else {
            return Err("sets not one light: an edit of somebody else".to_owned());
        };
        if !self.lights.contains(name) {
            let name = name.escape_debug();
            let there = match self.lights.is_empty() {
                true => "the scene has none".to_owned(),
                false => format!("there are {}", self.lights.join(", ")),
            };
            return Err(format!("`{name}` is no light: {there}"));
        }
        let is_good = |v: &f32| (0.0..=MAX_FACTOR).contains(v);
        if !factor.iter().all(is_good) {
            return Err(format!("{factor:?} is not of 0 to {MAX_FACTOR:e}"));
        }
        let plain = Step::set_light(name, *factor);
        match *step == plain {
            true => Ok(()),
            false => Err("does more than to set a light: an edit of somebody else".to_owned()),
        }
    }

    /// The scene after `steps`; `None` if they set lights and nothing else.
    fn replayed(&self, steps: &[Step]) -> Result<Option<Arc<Gaussians>>> {
        if steps.iter().all(|step| step.set_light.is_some()) {
            return Ok(None);
        }
        let edited = self.original.edited(&self.path, steps)?;
        Ok(Some(Arc::new(edited)))
    }

    /// The scene after `steps`, the last of which is new.
    fn replayed_on(&self, steps: &[Step]) -> Result<Option<Arc<Gaussians>>> {
        match (&self.changed, steps.last()) {
            (Some(before), Some(step)) if step.set_light.is_none() => {
                let before = Gaussians::clone(before);
                let edited = self.original.edited_once(&self.path, before, step)?;
                Ok(Some(Arc::new(edited)))
            }
            _ => self.replayed(steps),
        }
    }

    /// Does what a page asks for, and writes the script. An act that cannot be done changes
    /// nothing.
    ///
    /// # Errors
    /// [`ViewerError::Script`] if there is no such light, its factor cannot be, or there is nothing
    /// to undo or redo; [`ViewerError::Scene`] as [`eagpt_edit::replay()`] for a step that cannot
    /// be done, and as [`files::write_bytes_atomic`] if the script cannot be written.
    pub(crate) fn act(&mut self, act: Act) -> Result<()> {
        let (mut steps, mut undone) = (self.steps.clone(), self.undone.clone());
        let changed = match act {
            Act::SetLight(SetLight { name, factor }) => {
                self.add(Step::set_light(&name, factor), &mut steps, &mut undone)?
            }
            Act::Step(step) if step.set_light.is_some() => {
                let problem = "a step that sets lights is an act of its own";
                return Err(ViewerError::Script(problem.to_owned()));
            }
            Act::Step(step) => self.add(*step, &mut steps, &mut undone)?,
            Act::Undo => {
                let last = steps.pop();
                undone.push(last.ok_or_else(|| nothing_to("undo"))?);
                self.replayed(&steps)?
            }
            Act::Redo => {
                let last = undone.pop();
                steps.push(last.ok_or_else(|| nothing_to("redo"))?);
                self.replayed_on(&steps)?
            }
        };
        files::write_bytes_atomic(&self.path, original::text(&steps).as_bytes())?;
        (self.steps, self.undone, self.changed) = (steps, undone, changed);
        self.revision += 1;
        Ok(())
    }

    fn add(
        &self,
        step: Step,
        steps: &mut Vec<Step>,
        undone: &mut Vec<Step>,
    ) -> Result<Option<Arc<Gaussians>>> {
        self.check(&step).map_err(ViewerError::Script)?;
        if steps.len() >= MAX_STEPS {
            let problem = format!("a script of {MAX_STEPS} steps is full");
            return Err(ViewerError::Script(problem));
        }
        steps.push(step);
        undone.clear();
        self.replayed_on(steps)
    }

    /// The scene before all steps.
    pub fn original(&self) -> &Arc<Original> {
        &self.original
    }

    /// The scene after all steps, if any of them does more than to set lights. Its Gaussians carry
    /// the light from before those.
    pub fn changed(&self) -> Option<&Arc<Gaussians>> {
        self.changed.as_ref()
    }

    /// The scene after all steps, to the bit what `eagpt edit` makes of the script.
    ///
    /// # Errors
    /// As [`eagpt_edit::replay()`].
    pub fn edited(&self) -> Result<Gaussians> {
        match &self.changed {
            Some(changed) => Ok(Gaussians::clone(changed)),
            None => self.original.edited(&self.path, &self.steps),
        }
    }

    /// Number of the present state: grows with every act.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The script as text.
    pub fn script(&self) -> String {
        original::text(&self.steps)
    }

    /// The state that pages show.
    pub(crate) fn state(&self) -> EditState {
        let mut factors: BTreeMap<String, [f32; 3]> = self
            .lights
            .iter()
            .map(|name| (name.clone(), [1.0; 3]))
            .collect();
        let set = self.steps.iter().filter_map(|step| step.set_light.clone());
        factors.extend(set.flatten());
        EditState {
            revision: self.revision,
            factors,
            script: self.script(),
            file: self.path.display().to_string(),
            can_undo: !self.steps.is_empty(),
            can_redo: !self.undone.is_empty(),
        }
    }
}

fn nothing_to(what: &str) -> ViewerError {
    ViewerError::Script(format!("there is nothing to {what}"))
}

#[cfg(test)]
mod tests;
