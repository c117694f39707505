//! The scene that is edited, and what scripts make of it.

use super::Step;
use crate::error::Result;
use eagpt_edit::{Script, replay};
use eagpt_scene::script::ScriptFile;
use eagpt_scene::{Gaussians, Lamps, LightBasis};
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// A scene before all steps.
#[derive(Debug, Default)]
pub struct Original {
    /// Its Gaussians.
    pub gaussians: Arc<Gaussians>,
    /// Its lamps, by which selectors name what emits.
    pub lamps: Lamps,
    /// Its light by lamps, which fits it, if it was baked so.
    pub basis: Option<LightBasis>,
}

/// The script of `steps`. Those that set lights come first: they ask for the geometry that the
/// light was baked with, and what other steps do to Gaussians does not depend on their light.
pub(super) fn text(steps: &[Step]) -> String {
    let (lights, others): (Vec<&Step>, Vec<&Step>) =
        steps.iter().partition(|step| step.set_light.is_some());
    let steps = lights.into_iter().chain(others).map(Step::toml);
    let head = "# Edited in the viewer: `eagpt edit` replays it.\n".to_owned();
    head + &steps.collect::<String>()
}

impl Original {
    /// Names of the lights, none without a basis.
    pub fn lights(&self) -> Vec<String> {
        let lights = self.basis.iter().flat_map(LightBasis::lights);
        lights.map(|light| light.name.clone()).collect()
    }

    /// The scene after `steps`, to the bit what `eagpt edit` makes of their script.
    ///
    /// # Errors
    /// [`crate::ViewerError::Scene`] with line and key if the reader of scripts refuses a step, or
    /// it finds nothing.
    pub(super) fn edited(&self, path: &Path, steps: &[Step]) -> Result<Gaussians> {
        let gaussians = Gaussians::clone(&self.gaussians);
        if steps.is_empty() {
            return Ok(gaussians);
        }
        Ok(replay(&self.script(path, text(steps))?, gaussians)?.gaussians)
    }

    /// `gaussians`, a scene after some steps, after one more that sets no light. No step of the
    /// viewer has a name that a later one refers to: it needs nothing but the scene before it.
    ///
    /// # Errors
    /// As [`Self::edited`].
    pub(super) fn edited_once(
        &self,
        path: &Path,
        gaussians: Gaussians,
        step: &Step,
    ) -> Result<Gaussians> {
        let script = self.script(path, step.toml())?;
        Ok(replay(&script, gaussians)?.gaussians)
    }

    /// Whether each of `gaussians`, the scene after some steps, is what `selector` selects.
    ///
    /// # Errors
    /// As [`Self::edited`].
    pub(crate) fn selected(&self, gaussians: &Gaussians, selector: &Value) -> Result<Vec<bool>> {
        let step = Step {
            select: Some(selector.clone()),
            // A script does something with what it selects; nobody replays this one.
            then: vec![Value::from("keep_only")],
            ..Step::default()
        };
        let script = self.script(Path::new("selection"), step.toml())?;
        Ok(eagpt_edit::selection(&script, gaussians)?)
    }

    fn script(&self, path: &Path, text: String) -> Result<Script> {
        let mut script = Script::of_file(ScriptFile::new(path, text.into_bytes())?)?;
        if script.needs_lamps() {
            script.set_lamps(self.lamps.clone())?;
        }
        if script.needs_basis()
            && let Some(basis) = &self.basis
        {
            script.set_basis(basis.clone())?;
        }
        Ok(script)
    }
}
