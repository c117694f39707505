//! The full state of a run on disk.
//!
//! A sealed file with the raw values, first and second moments, `[n, 17]` each, and where radiance
//! differs with the direction those of the coefficients, `[n, 24]` each. Of a scene in several
//! lights the same follows for each light, with `[n, 4]` in place of `[n, 17]`. In stage 1 the gloss
//! of a scene where something is glossy comes last, `[n, 9]`. Written atomically; a damaged one is
//! recognised by its digest.

use crate::error::Result;
use crate::options::Stage;
use crate::params::{
    Learned, LightParameters, Lights, NUM_OF_LIGHT, NUM_PARAMETERS, ParameterState,
};
use eagpt_scene::Lamps;
use eagpt_scene::SceneError;
use eagpt_scene::files::{self, Key, SealedFormat};
use eagpt_scene::harmonics::NUM_COEFFICIENTS;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Numbers of a Gaussian's gloss.
pub(crate) const NUM_OF_GLOSS: usize = 9;

const FORMAT: SealedFormat = SealedFormat {
    magic: b"EAGPTCKP",
    version: 1,
    noun: "checkpoint",
};

/// Watches the loss; part of the state so that a resumed run stops where an uninterrupted one
/// would.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LossMonitor {
    /// Smoothed total loss.
    pub smoothed: f64,
    /// Smoothed PQ error.
    pub smoothed_l1: f64,
    /// Least smoothed PQ error so far.
    pub best_l1: f64,
}

/// A run's state after `iteration` iterations of `stage`.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The stage.
    pub stage: Stage,
    /// Iterations done in the stage.
    pub iteration: u32,
    /// Everything that decides the run: parts "dataset", "radiance" and "albedo".
    pub fingerprint: Key,
    /// Extent of the point cloud, scene units.
    pub extent: f32,
    /// The loss so far.
    pub monitor: LossMonitor,
    /// Lamps of the first light, once they are listed.
    pub lamps: Option<Lamps>,
    /// Gloss of each Gaussian, its rotation and whether it is of bare metal, `[n]`, in stage 1;
    /// empty where nothing is glossy.
    pub gloss: Vec<[f32; NUM_OF_GLOSS]>,
    /// Parameters and moments.
    pub state: ParameterState,
}

#[derive(Serialize, Deserialize)]
struct Header {
    stage: Stage,
    iteration: u32,
    fingerprint: Key,
    extent: f32,
    monitor: LossMonitor,
    num_gaussians: usize,
    num_steps: u32,
    /// Steps of the harmonics.
    #[serde(default)]
    harmonics_steps: u32,
    /// See [`ParameterState::num_fixed`].
    #[serde(default)]
    num_fixed: usize,
    /// Several lights; see [`Lights`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lights: Option<LightsHeader>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lamps: Option<Lamps>,
    /// See [`Checkpoint::gloss`].
    #[serde(default)]
    has_gloss: bool,
}

#[derive(Serialize, Deserialize)]
struct LightsHeader {
    current: usize,
    /// Steps of the harmonics of each.
    harmonics_steps: Vec<u32>,
}

impl Checkpoint {
    /// File name of a checkpoint.
    pub fn file_name(stage: Stage, iteration: u32) -> String {
        format!("{}-{iteration:06}.ckpt", stage.name())
    }

    /// Writes the checkpoint into `dir` and returns the file's path.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, dir: &Path) -> Result<PathBuf> {
        files::create_dir(dir)?;
        let path = dir.join(Self::file_name(self.stage, self.iteration));
        let lights = &self.state.lights;
        let header = Header {
            stage: self.stage,
            iteration: self.iteration,
            fingerprint: self.fingerprint.clone(),
            extent: self.extent,
            monitor: self.monitor,
            num_gaussians: self.state.len(),
            num_steps: self.state.raw.num_steps,
            harmonics_steps: self.state.harmonics.num_steps,
            num_fixed: self.state.num_fixed,
            lights: (!lights.stored.is_empty()).then(|| LightsHeader {
                current: lights.current,
                harmonics_steps: (lights.stored.iter())
                    .map(|light| light.harmonics.num_steps)
                    .collect(),
            }),
            lamps: self.lamps.clone(),
            has_gloss: !self.gloss.is_empty(),
        };
        let state = &self.state;
        let raw = state.raw.arrays().map(<[_]>::as_flattened);
        let harmonics = state.harmonics.arrays().map(<[_]>::as_flattened);
        let of_lights = lights.stored.iter().flat_map(|stored| {
            let light = stored.light.arrays().map(<[_]>::as_flattened);
            let harmonics = stored.harmonics.arrays().map(<[_]>::as_flattened);
            [light, harmonics].concat()
        });
        let arrays: Vec<&[f32]> = ([raw, harmonics].concat().into_iter())
            .chain(of_lights)
            .chain([self.gloss.as_flattened()])
            .collect();
        FORMAT.write(&path, &header, &arrays)?;
        Ok(path)
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or is of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let (header, values): (Header, _) = FORMAT.read(path)?;
        let num_gloss = match header.has_gloss {
            true => NUM_OF_GLOSS * header.num_gaussians,
            false => 0,
        };
        let (values, gloss) = values.split_at(values.len().saturating_sub(num_gloss));
        let num_raw = 3 * NUM_PARAMETERS * header.num_gaussians;
        let num_harmonics = 3 * NUM_COEFFICIENTS * header.num_gaussians;
        let num_light = 3 * NUM_OF_LIGHT * header.num_gaussians;
        let steps = (header.lights.as_ref()).map_or(&[][..], |lights| &lights.harmonics_steps);
        let num_lights = steps.len();
        let plain = num_raw + num_lights * num_light;
        let num_harmonics = match values.len() {
            len if len == plain => 0,
            _ => num_harmonics,
        };
        let has_all = values.len() == plain + (1 + num_lights) * num_harmonics;
        let current = header.lights.as_ref().map_or(0, |lights| lights.current);
        if !has_all || header.num_fixed > header.num_gaussians || current >= num_lights.max(1) {
            return Err(SceneError::invalid(path, "arrays", "the checkpoint is damaged").into());
        }
        let (raw, rest) = values.split_at(num_raw);
        let (harmonics, rest) = rest.split_at(num_harmonics);
        let stored =
            (rest.chunks((num_light + num_harmonics).max(1)).zip(steps)).map(|(values, &steps)| {
                let (light, harmonics) = values.split_at(num_light);
                LightParameters {
                    // They are stepped with the raw values.
                    light: learned(light, 0),
                    harmonics: learned(harmonics, steps),
                }
            });
        Ok(Self {
            stage: header.stage,
            iteration: header.iteration,
            fingerprint: header.fingerprint,
            extent: header.extent,
            monitor: header.monitor,
            lamps: header.lamps,
            gloss: gloss.as_chunks().0.to_vec(),
            state: ParameterState {
                raw: learned(raw, header.num_steps),
                harmonics: learned(harmonics, header.harmonics_steps),
                num_fixed: header.num_fixed,
                lights: Lights {
                    current,
                    stored: stored.collect(),
                },
            },
        })
    }
}

/// Values, first and second moments, one after the other.
fn learned<const K: usize>(values: &[f32], num_steps: u32) -> Learned<K> {
    let (rows, _) = values.as_chunks();
    let (values, moments) = rows.split_at(rows.len() / 3);
    let (first, second) = moments.split_at(moments.len() / 2);
    Learned {
        values: values.to_vec(),
        first: first.to_vec(),
        second: second.to_vec(),
        num_steps,
    }
}

/// The checkpoints in `dir`, oldest first: stage 0 before stage 1, then by iteration.
///
/// # Errors
/// If the folder cannot be read; a missing folder holds none.
pub fn list(dir: &Path) -> Result<Vec<PathBuf>> {
    if !dir.exists() {
        return Ok(Vec::new());
    }
    let mut found = Vec::new();
    for entry in std::fs::read_dir(dir).map_err(|e| SceneError::io(dir, "read folder", e))? {
        let path = entry
            .map_err(|e| SceneError::io(dir, "read folder", e))?
            .path();
        if let Some(order) = order_of(&path) {
            found.push((order, path));
        }
    }
    found.sort();
    Ok(found.into_iter().map(|(_, path)| path).collect())
}

fn order_of(path: &Path) -> Option<(usize, u32)> {
    let name = path.file_name()?.to_str()?.strip_suffix(".ckpt")?;
    let (stage, iteration) = name.split_once('-')?;
    let stage = [Stage::Radiance, Stage::Albedo]
        .iter()
        .position(|s| s.name() == stage)?;
    Some((stage, iteration.parse().ok()?))
}

/// Removes all but the newest `keep` checkpoints of `stage`.
///
/// # Errors
/// If a file cannot be removed.
pub fn prune(dir: &Path, stage: Stage, keep: usize) -> Result<()> {
    let of_stage: Vec<PathBuf> = list(dir)?
        .into_iter()
        .filter(|p| {
            p.file_name()
                .and_then(|n| n.to_str())
                .is_some_and(|n| n.starts_with(stage.name()))
        })
        .collect();
    for path in of_stage.iter().rev().skip(keep) {
        std::fs::remove_file(path).map_err(|e| SceneError::io(path, "remove", e))?;
    }
    Ok(())
}

/// The newest checkpoint of `dir` that is whole, with a warning for each newer one that is not.
///
/// # Errors
/// If there is none.
pub fn newest(dir: &Path) -> Result<(Checkpoint, Vec<String>)> {
    let mut warnings = Vec::new();
    for path in list(dir)?.iter().rev() {
        match Checkpoint::read(path) {
            Ok(checkpoint) => return Ok((checkpoint, warnings)),
            Err(error) => warnings.push(error.to_string()),
        }
    }
    Err(SceneError::Work {
        path: dir.to_owned(),
        problem: "no checkpoint to resume from".to_owned(),
    }
    .into())
}

#[cfg(test)]
mod tests;
