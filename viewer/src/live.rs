//! An edit under way: acts that pages ask for, each a step of a script, with undo and redo.
//!
//! The script is on disk after every act, as `eagpt edit` replays it. Its steps set lights of the
//! scene's light basis ([`eagpt_scene::light_basis`]) and nothing else.

use crate::error::{Result, ViewerError};
use eagpt_scene::files;
use eagpt_scene::script::ScriptFile;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

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
pub enum Act {
    /// Another step.
    SetLight(SetLight),
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
    step: Vec<StepKeys>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StepKeys {
    set_light: BTreeMap<String, [f32; 3]>,
}

/// An edit of a scene.
#[derive(Debug)]
pub struct Edit {
    path: PathBuf,
    lights: Vec<String>,
    steps: Vec<SetLight>,
    undone: Vec<SetLight>,
    revision: u64,
}

/// The state of an edit that pages show.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct EditState {
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
    /// An edit of a scene with these `lights`, whose script is the file `path`: goes on from there
    /// if it is one that an earlier edit has written.
    ///
    /// # Errors
    /// [`ViewerError`] naming the file if it is another script, or of a scene with other lights.
    pub fn open(path: &Path, lights: Vec<String>) -> Result<Self> {
        let mut edit = Self {
            path: path.to_owned(),
            lights,
            steps: Vec::new(),
            undone: Vec::new(),
            revision: 0,
        };
        if !path.exists() {
            return Ok(edit);
        }
        let keys: ScriptKeys = ScriptFile::read(path)?.parse()?;
        for (index, step) in keys.step.into_iter().enumerate() {
            let place = |problem: String| {
                ViewerError::Script(format!("{}: step[{index}]: {problem}", path.display()))
            };
            let mut set = step.set_light.into_iter();
            let (Some((name, factor)), None) = (set.next(), set.next()) else {
                return Err(place(
                    "sets not one light: an edit of somebody else".to_owned(),
                ));
            };
            let light = SetLight { name, factor };
            edit.check(&light).map_err(place)?;
            edit.steps.push(light);
        }
        Ok(edit)
    }

    fn check(&self, light: &SetLight) -> Result<(), String> {
        let SetLight { name, factor } = light;
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
        Ok(())
    }

    /// Does what a page asks for, and writes the script. An act that cannot be done changes
    /// nothing.
    ///
    /// # Errors
    /// [`ViewerError::Script`] if there is no such light, its factor cannot be, or there is nothing
    /// to undo or redo; as [`files::write_bytes_atomic`] if the script cannot be written.
    pub fn act(&mut self, act: Act) -> Result<()> {
        let before = (self.steps.clone(), self.undone.clone());
        match act {
            Act::SetLight(light) => {
                self.check(&light).map_err(ViewerError::Script)?;
                if self.steps.len() >= MAX_STEPS {
                    let problem = format!("a script of {MAX_STEPS} steps is full");
                    return Err(ViewerError::Script(problem));
                }
                self.steps.push(light);
                self.undone.clear();
            }
            Act::Undo => {
                let last = self.steps.pop();
                self.undone.push(last.ok_or_else(|| nothing_to("undo"))?);
            }
            Act::Redo => {
                let last = self.undone.pop();
                self.steps.push(last.ok_or_else(|| nothing_to("redo"))?);
            }
        }
        if let Err(error) = files::write_bytes_atomic(&self.path, self.script().as_bytes()) {
            (self.steps, self.undone) = before;
            return Err(error.into());
        }
        self.revision += 1;
        Ok(())
    }

    /// Number of the present state: grows with every act.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// The script as text.
    pub fn script(&self) -> String {
        let mut text = "# Edited in the viewer: `eagpt edit` replays it.\n".to_owned();
        for SetLight { name, factor } in &self.steps {
            let [r, g, b] = factor;
            // A string of JSON is one of TOML, too; names have no control characters.
            let name = Value::from(name.as_str());
            // Shortest numbers that are read back to the same bits.
            text += &format!("\n[[step]]\nset_light = {{ {name} = [{r:?}, {g:?}, {b:?}] }}\n");
        }
        text
    }

    /// The state that pages show.
    pub fn state(&self) -> EditState {
        let mut factors: BTreeMap<String, [f32; 3]> = self
            .lights
            .iter()
            .map(|name| (name.clone(), [1.0; 3]))
            .collect();
        let set = self.steps.iter();
        factors.extend(set.map(|step| (step.name.clone(), step.factor)));
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

/// The answer to an act that was refused.
pub(crate) fn refusal(error: &ViewerError) -> Value {
    json!({ "error": error.to_string() })
}

#[cfg(test)]
mod tests;
