//! Training that starts from a scene instead of points.

use super::request::TrainRequest;
use crate::checkpoint::{Checkpoint, LossMonitor};
use crate::error::{Result, TrainError};
use crate::init;
use crate::options::{Stage, StageChoice, TrainOptions};
use crate::params::ParameterState;
use eagpt_scene::files::Key;
use eagpt_scene::lamps::{LAMPS_FILE, lamps_file_beside, read_lamps, write_lamps};
use eagpt_scene::{Gaussians, ply};

/// The scene that the request names.
///
/// # Errors
/// If it cannot be read, or has no extent.
pub(super) fn read(request: &TrainRequest) -> Result<Option<Gaussians>> {
    let Some(path) = &request.start else {
        return Ok(None);
    };
    if let (Some(light), StageChoice::Albedo) =
        (request.other_lights.first(), request.options.stage)
    {
        let problem = format!(
            "has one light: stage 1 alone cannot know its radiance in that of {}",
            light.display()
        );
        return Err(TrainError::Dataset {
            path: path.clone(),
            problem,
        });
    }
    let gaussians = ply::read_gaussians(path)?;
    let extent = match gaussians.is_empty() {
        true => 0.0,
        false => init::extent(&gaussians.positions),
    };
    if extent <= 0.0 || !extent.is_finite() {
        return Err(TrainError::Dataset {
            path: path.clone(),
            problem: format!("the scene has an extent of {extent}"),
        });
    }
    Ok(Some(gaussians))
}

/// Takes the lamps of the scene that the request names, if they are listed beside it and stage 0
/// does not find them anew.
///
/// # Errors
/// If the list cannot be read or written.
pub(super) fn take_lamps(request: &TrainRequest) -> Result<()> {
    let Some(path) = &request.start else {
        return Ok(());
    };
    let beside = lamps_file_beside(path);
    if request.options.stage == StageChoice::Albedo && beside.exists() {
        write_lamps(&request.out.join(LAMPS_FILE), &read_lamps(&beside)?)?;
    }
    Ok(())
}

/// The state before the first iteration, with the radiance, emission and albedo of a scene, in each
/// of `num_lights` lights.
pub(super) fn checkpoint(
    gaussians: &Gaussians,
    num_lights: usize,
    options: &TrainOptions,
    fingerprint: Key,
) -> Checkpoint {
    let others = vec![gaussians.clone(); num_lights - 1];
    let mut state = ParameterState::new(gaussians).with_lights(&others);
    state.sort_in_space();
    let harmonics = options.radiance.harmonics.degree > 0;
    if !harmonics {
        state.harmonics = crate::params::Learned::new(Vec::new());
        for light in &mut state.lights.stored {
            light.harmonics = crate::params::Learned::new(Vec::new());
        }
    }
    Checkpoint {
        stage: Stage::Radiance,
        iteration: 0,
        fingerprint,
        extent: init::extent(&gaussians.positions),
        monitor: LossMonitor {
            smoothed: 0.0,
            smoothed_l1: 0.0,
            best_l1: f64::MAX,
        },
        lamps: None,
        gloss: Vec::new(),
        state,
    }
}
