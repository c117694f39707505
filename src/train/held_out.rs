//! A light that a training leaves out, and how the scene shows it with its lamps switched.

use super::{TrainArgs, compared};
use crate::bake;
use crate::progress::Reporter;
use anyhow::{Context, Result, bail};
use eagpt_scene::lamps::{ALL_LAMPS_DIR, lamps_file_beside};
use eagpt_scene::script::ScriptFile;
use eagpt_scene::{SceneError, files};
use eagpt_train::TrainRequest;
use eagpt_train::job::light_name;
use eagpt_train::relit::{RELIT_DIR, Relit, RelitRequest, relight};
use glam::Vec3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The light that `--test-condition` names.
pub(super) struct HeldOut {
    name: String,
    dataset: PathBuf,
    factors: Option<Vec<(String, Vec3)>>,
}

/// Powers of lamps in lights, as `--lights` has them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LightsFile {
    lights: BTreeMap<String, BTreeMap<String, Factor>>,
}

/// A factor of all channels, or of each.
#[derive(Deserialize)]
#[serde(untagged)]
enum Factor {
    All(f32),
    Each([f32; 3]),
}

impl HeldOut {
    /// Takes the dataset of the light that is held out from those of the arguments, at least one of
    /// which is left.
    pub(super) fn take(args: &TrainArgs, datasets: &mut Vec<PathBuf>) -> Result<Option<Self>> {
        let Some(name) = &args.test_condition else {
            return Ok(None);
        };
        let Some(place) = datasets.iter().position(|path| light_name(path) == *name) else {
            let folders = datasets.iter().map(|path| path.display().to_string());
            let folders: Vec<String> = folders.collect();
            bail!(
                "--test-condition {name}: no folder of {} is called so",
                folders.join(", ")
            );
        };
        if datasets.len() == 1 {
            bail!("--test-condition {name}: no other light is left to train on");
        }
        let factors = match &args.lights {
            Some(file) => Some(factors(file, name)?),
            None => None,
        };
        Ok(Some(Self {
            name: name.clone(),
            dataset: datasets.remove(place),
            factors,
        }))
    }

    /// Relights the trained scene and tells how it compares; `None` if it was stopped.
    pub(super) fn relit(
        self,
        request: &TrainRequest,
        reporter: &mut Reporter,
    ) -> Result<Option<Relit>> {
        let scene = match request.other_lights.is_empty() {
            true => request.out.join("scene.ply"),
            false => request.out.join(ALL_LAMPS_DIR).join("scene.ply"),
        };
        let dir = request.out.join(RELIT_DIR);
        files::create_dir(&dir)?;
        let relit = RelitRequest {
            reference: self.dataset,
            factors: self.factors,
            lamps: lamps_file_beside(&scene),
            scene,
            cameras: request.dataset.clone(),
            out: dir.join(format!("{}.ply", self.name)),
            split: request.options.split,
            seed: request.options.seed,
            device: request.device.clone(),
            stop: Arc::clone(&request.stop),
        };
        let found = reporter.follow(bake::tell, |progress| relight(&relit, progress));
        let found = found.with_context(|| format!("--test-condition {}", self.name))?;
        match &found {
            Some(found) => {
                reporter.note(&line(&self.name, found));
                reporter.message(&serde_json::json!({
                    "message": "test_condition",
                    "name": self.name,
                    "relit": found,
                }))?;
            }
            None => reporter.note(&format!(
                "{}, held out: stopped; --resume compares it",
                self.name
            )),
        }
        Ok(found)
    }
}

/// Factors of lamps in the light `name` of a file.
fn factors(path: &Path, name: &str) -> Result<Vec<(String, Vec3)>> {
    let file = ScriptFile::read(path)?;
    let mut all: LightsFile = file.parse()?;
    let Some(lamps) = all.lights.remove(name) else {
        let problem = format!("`{name}` is missing");
        return Err(SceneError::invalid(path, "lights", problem).into());
    };
    let checked = |(lamp, factor): (String, Factor)| {
        let factor = match factor {
            Factor::All(factor) => Vec3::splat(factor),
            Factor::Each(factors) => Vec3::from(factors),
        };
        if factor.is_finite() && factor.min_element() >= 0.0 {
            return Ok((lamp, factor));
        }
        let problem = format!("{factor} is negative or not finite");
        Err(SceneError::invalid(path, format!("lights.{name}.{lamp}"), problem).into())
    };
    lamps.into_iter().map(checked).collect()
}

/// One line on a held-out light.
fn line(name: &str, relit: &Relit) -> String {
    let lamps = relit.factors.iter().map(|(name, [r, g, b])| {
        let factor = match r == g && g == b {
            true => format!("{r:.3}"),
            false => format!("{r:.3} {g:.3} {b:.3}"),
        };
        format!("{name} {factor}")
    });
    let lamps = lamps.collect::<Vec<_>>().join(", ");
    let fitted = match relit.fitted.is_empty() {
        true => String::new(),
        false => format!(", fitted to {}", relit.fitted.join(" ")),
    };
    let compared = relit.compared.map_or_else(
        || "no test view".to_owned(),
        |found| format!("{} test views", compared(&found)),
    );
    format!("{name}, held out: {compared} ({lamps}{fitted})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_of_a_light_are_read_or_name_what_is_wrong() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lights.toml");
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            factors(&path, "evening")
        };
        let found = read("[lights]\nday = {}\nevening = { shade = 1.0, ceiling-1 = [0, 1, 2] }");
        let wanted = [
            ("ceiling-1".to_owned(), Vec3::new(0.0, 1.0, 2.0)),
            ("shade".to_owned(), Vec3::ONE),
        ];
        assert_eq!(found.unwrap(), wanted);
        for (text, problem) in [
            ("[lights]\nday = {}", "`evening` is missing"),
            (
                "[lights]\nevening = { shade = -1.0 }",
                "lights.evening.shade",
            ),
            ("[lights]\nevening = { shade = \"on\" }", "evening.shade"),
            ("[light]\nevening = {}", "light"),
        ] {
            let error = format!("{:#}", read(text).unwrap_err());
            assert!(error.contains(problem), "{text}: {error}");
        }
    }
}
