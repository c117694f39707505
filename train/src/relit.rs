//! A light that was not trained on: the trained scene with its lamps switched, against photographs.
//!
//! The scene with all its lamps on is baked with the light of each lamp apart. Factors of the lamps
//! are given, or fitted to a few of the photographs; the others tell how good the relit scene is.

use crate::backend::TrainingView;
use crate::bake::gaussians::GaussianBake;
use crate::bake::{self, BakeMethod, BakeOptions, BakeProgress, BakeRequest};
use crate::error::Result;
use crate::light_fit::{FitViews, LightFitRequest, fit_lights};
use crate::own_light::{self, OwnLight};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::light_basis::{LightBasis, lights_file_beside};
use eagpt_scene::{Dataset, SceneError, ply};
use eagpt_trace::Device;
use eagpt_trace::transport::MAX_BOUNCES;
use glam::Vec3;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Folder of relit scenes in that of a run.
pub const RELIT_DIR: &str = "relit";
/// Views of the held-out light to which factors are fitted.
const NUM_FITTED: usize = 3;

/// A held-out light and the scene that is to show it.
#[derive(Debug, Clone)]
pub struct RelitRequest {
    /// Photographs in the light.
    pub reference: PathBuf,
    /// Factors of lamps, by name or pattern; lamps without any are off. `None` fits them to views.
    pub factors: Option<Vec<(String, Vec3)>>,
    /// The scene with all its lamps on; their list is beside it.
    pub scene: PathBuf,
    /// File of that list.
    pub lamps: PathBuf,
    /// Dataset whose cameras say where surfaces are.
    pub cameras: PathBuf,
    /// Scene to write: baked, in the held-out light, with its lights beside it.
    pub out: PathBuf,
    /// Division of the views.
    pub split: SplitRule,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Compute device.
    pub device: Device,
    /// Set from outside to stop soon.
    pub stop: Arc<AtomicBool>,
}

/// A held-out light as the scene shows it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Relit {
    /// Names of the lights of the scene, with their factors, each of R, G, B.
    pub factors: Vec<(String, [f32; 3])>,
    /// Names of the views that these were fitted to; none where they were given.
    pub fitted: Vec<String>,
    /// Test views of the light, but for those, in comparison.
    pub compared: Option<OwnLight>,
}

/// Relights a scene; `None` if it was stopped from outside.
///
/// # Errors
/// Bad input, naming file and value: a pattern that fits no lamp, or a scene in which none shines.
pub fn relight(
    request: &RelitRequest,
    progress: &mut dyn FnMut(BakeProgress),
) -> Result<Option<Relit>> {
    let baked = bake::bake(&bake_request(request), progress)?;
    if baked.scene.is_none() {
        return Ok(None);
    }
    let file = lights_file_beside(&request.out);
    let mut basis = LightBasis::read(&file)?;
    let fitted = match &request.factors {
        Some(factors) => {
            set(&mut basis, factors, &request.reference)?;
            Vec::new()
        }
        None => fit(request, &mut basis, &file)?,
    };
    let mut scene = ply::read_gaussians(&request.out)?;
    basis.light(&mut scene);
    basis.write(&file)?;
    ply::write_gaussians(&request.out, &scene)?;
    let reference = Dataset::open(&request.reference)?;
    let tests = reference.split(request.split)?.indices(Subset::Test);
    let is_new = |index: &usize| !fitted.contains(&reference.frames()[*index].name);
    let views = tests.into_iter().filter(is_new).map(|index| {
        Ok(TrainingView {
            index,
            light: 0,
            view: Arc::new(reference.load_view(index)?),
            points: None,
        })
    });
    let compared = own_light::compare(&request.device, &scene, views)?;
    let lights = basis.lights().iter();
    let factors = lights.map(|light| (light.name.clone(), light.factor.to_array()));
    Ok(Some(Relit {
        factors: factors.collect(),
        fitted,
        compared,
    }))
}

fn bake_request(request: &RelitRequest) -> BakeRequest {
    BakeRequest {
        scene: request.scene.clone(),
        cameras: request.cameras.clone(),
        out: request.out.clone(),
        work: request.out.with_extension("work"),
        transport: None,
        per_light: Some(request.lamps.clone()),
        options: BakeOptions {
            method: BakeMethod::Gaussians(GaussianBake { num_samples: None }),
            max_bounces: MAX_BOUNCES,
            seed: request.seed,
            split: request.split,
            subset: Subset::Train,
        },
        device: request.device.clone(),
        start_over: true,
        stop: Arc::clone(&request.stop),
    }
}

/// Sets the lights of `basis` to `factors`, in order, and all others to 0.
fn set(basis: &mut LightBasis, factors: &[(String, Vec3)], reference: &Path) -> Result<()> {
    for index in 0..basis.lights().len() {
        basis.set_factor(index, Vec3::ZERO);
    }
    for (pattern, factor) in factors {
        let fitting = basis.matching(pattern);
        if fitting.is_empty() {
            let names: Vec<&str> = basis.lights().iter().map(|l| l.name.as_str()).collect();
            let problem = format!("`{pattern}` is no light: there are {}", names.join(", "));
            return Err(SceneError::invalid(reference, "lights", problem).into());
        }
        for index in fitting {
            basis.set_factor(index, *factor);
        }
    }
    Ok(())
}

/// Sets the lights of `basis` to what explains views of the reference; returns their names.
fn fit(request: &RelitRequest, basis: &mut LightBasis, file: &Path) -> Result<Vec<String>> {
    let num = Dataset::open(&request.reference)?.frames().len();
    let fit = LightFitRequest {
        scene: request.out.clone(),
        lights: file.to_owned(),
        reference: request.reference.clone(),
        before: None,
        views: FitViews::Best(NUM_FITTED.min(num)),
        device: request.device.clone(),
    };
    let found = fit_lights(&fit, &mut |_| ())?;
    for (index, light) in found.lights.iter().enumerate() {
        basis.set_factor(index, Vec3::from(light.factor.map(|factor| factor as f32)));
    }
    Ok(found.views)
}
