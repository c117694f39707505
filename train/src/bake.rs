//! Light baking: after an edit, radiance that fits the light as it is now (EAG-PT, section 3.5).
//!
//! Emitters, the Gaussians whose emission exceeds τ_E, keep their radiance; every other one gets
//! what it reflects. Geometry, emission and albedo stay as they are, bit for bit. Two methods:
//! - [`gaussians`]: the light is solved in Gaussian space; no image is made.
//! - [`views`]: the paper's; the views of a dataset are path-traced and radiance is fitted to them.

pub mod gaussians;
mod highlights;
mod lamps;
mod receivers;
mod series;
pub(crate) mod solution;
mod transport;
pub mod views;

use crate::error::Result;
use eagpt_scene::dataset::{RADIANCE_DIR, Split, SplitRule, Subset, TRANSFORMS_FILE};
use eagpt_scene::files::{self, Key, Ledger, ledger};
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_scene::{Dataset, Gaussians, Harmonics, SceneError, Shard, ply};
use eagpt_trace::Device;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use gaussians::{GaussianBake, Solved};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use views::ViewBake;

/// Method of baking.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "method")]
pub enum BakeMethod {
    /// Solved in Gaussian space.
    Gaussians(GaussianBake),
    /// Fitted to path-traced views.
    Views(ViewBake),
}

/// Options that decide the result, beside scene and cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BakeOptions {
    /// Method.
    #[serde(flatten)]
    pub method: BakeMethod,
    /// Maximum path depth, at least 1.
    pub max_bounces: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Division of the dataset's views.
    pub split: SplitRule,
    /// The views to bake for.
    pub subset: Subset,
}

/// A bake to be done.
#[derive(Debug, Clone)]
pub struct BakeRequest {
    /// The edited scene.
    pub scene: PathBuf,
    /// Dataset whose cameras count; of its images, only the sizes.
    pub cameras: PathBuf,
    /// The scene to write.
    pub out: PathBuf,
    /// Folder for the state of the work: a bake that was stopped resumes from there.
    pub work: PathBuf,
    /// File for the traced transport matrix of [`BakeMethod::Gaussians`], in place of the work
    /// folder: kept for later bakes, which reuse it if the geometry is the same.
    pub transport: Option<PathBuf>,
    /// File of the lamps of the scene, for [`BakeMethod::Gaussians`]: beside the scene, the light
    /// of each lamp is written ([`eagpt_scene::light_basis::lights_file_beside`]).
    pub per_light: Option<PathBuf>,
    /// Options.
    pub options: BakeOptions,
    /// Device that traces rays and, with [`BakeMethod::Views`], fits.
    pub device: Device,
    /// Replaces the work of another bake in the work folder.
    pub start_over: bool,
    /// Set from outside to stop soon, with the work so far on disk.
    pub stop: Arc<AtomicBool>,
}

/// Progress of a bake.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum BakeProgress {
    /// Cameras are traced to find the surface of each Gaussian.
    Looking {
        /// Cameras done.
        done: usize,
        /// Cameras in all.
        total: usize,
    },
    /// Rays are traced at Gaussians.
    Gathering {
        /// Gaussians done.
        done: usize,
        /// Gaussians in all.
        total: usize,
    },
    /// One more bounce is solved.
    Bounced {
        /// The bounce, counted from 1.
        bounce: u32,
        /// Its light, as a share of all so far.
        share: f64,
    },
    /// Views are path-traced.
    Rendering {
        /// Views done, those of earlier processes included.
        done: usize,
        /// Views in all (of this shard).
        total: usize,
    },
    /// Radiance is fitted.
    Fitting {
        /// Iteration, counted from 1.
        iteration: u32,
        /// Iterations in all.
        total: u32,
        /// Loss of this iteration.
        loss: f64,
    },
    /// Something the user should know.
    Warning {
        /// One line.
        text: String,
    },
}

/// Result of a bake, finished or stopped.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSummary {
    /// The scene file; `None` if the bake was stopped, or was one shard of several.
    pub scene: Option<PathBuf>,
    /// Lights whose light was written apart; `None` if that was not asked for.
    pub num_lights: Option<usize>,
    /// Rays traced in this process; those of cameras and of highlights are not counted.
    pub num_rays: u64,
    /// Options, with the numbers that followed from the scene.
    pub options: BakeOptions,
    /// Division of the views.
    pub split: Split,
    /// Compute device, as recorded beside results.
    pub device: String,
}

/// Bakes the light of a scene.
///
/// # Errors
/// Bad input, a work folder that holds another bake, or a file that cannot be written; each names
/// what it is about.
pub fn bake(request: &BakeRequest, progress: &mut dyn FnMut(BakeProgress)) -> Result<BakeSummary> {
    let dataset = Dataset::open(&request.cameras)?;
    let split = dataset.split(request.options.split)?;
    for warning in &split.warnings {
        let text = warning.clone();
        progress(BakeProgress::Warning { text });
    }
    let mut scene = ply::read_gaussians(&request.scene)?;
    forget_directions(&mut scene);
    if !scene.emissions.iter().any(|&e| e > EMISSION_THRESHOLD) {
        let problem =
            format!("nothing emits (emission > {EMISSION_THRESHOLD}): all would be black");
        return Err(SceneError::invalid(&request.scene, "emission", problem).into());
    }
    let mut bake = Bake {
        request,
        progress,
        frames: split.indices(request.options.subset),
        dataset,
        scene,
        num_rays: 0,
    };
    let solved = match &request.options.method {
        BakeMethod::Views(method) => {
            let fitted = bake.fit_views(method, open_work(request)?)?;
            fitted.map(|radiances| Solved {
                radiances,
                basis: None,
                harmonics: bake.scene.harmonics.clone(),
            })
        }
        BakeMethod::Gaussians(method) => {
            if request.transport.is_none() {
                open_work(request)?;
            }
            bake.solve(*method)?
        }
    };
    let num_rays = bake.num_rays;
    let mut options = request.options;
    if let BakeMethod::Gaussians(method) = &mut options.method {
        method.num_samples = Some(method.number(bake.scene.len(), request.per_light.is_some()));
    }
    let mut num_lights = None;
    let scene = match solved {
        Some(Solved {
            radiances,
            basis,
            harmonics,
        }) => {
            let baked = Gaussians {
                radiances,
                harmonics,
                ..bake.scene
            };
            let lights = lights_file_beside(&request.out);
            match &basis {
                Some(basis) => basis.write(&lights)?,
                // That of an earlier bake.
                None => files::remove_if_there(&lights)?,
            }
            num_lights = basis.map(|basis| basis.lights().len());
            ply::write_gaussians(&request.out, &baked)?;
            let is_solved = matches!(request.options.method, BakeMethod::Gaussians(_));
            if is_solved && request.transport.is_none() {
                // Path-traced views are worth keeping, the rows of a matrix are not.
                clear(&request.work)?;
            }
            Some(request.out.clone())
        }
        None => None,
    };
    Ok(BakeSummary {
        scene,
        num_lights,
        num_rays,
        options,
        split,
        device: request.device.name(),
    })
}

/// A bake under way.
struct Bake<'a> {
    request: &'a BakeRequest,
    progress: &'a mut dyn FnMut(BakeProgress),
    dataset: Dataset,
    /// Indices of the views to bake for.
    frames: Vec<usize>,
    scene: Gaussians,
    num_rays: u64,
}

impl Bake<'_> {
    fn stopped(&self) -> bool {
        self.request.stop.load(Ordering::Relaxed)
    }
}

/// True for an emitter, which keeps its radiance.
pub(crate) fn emits(emission: f32) -> bool {
    emission > EMISSION_THRESHOLD
}

/// Makes the radiance of what reflects the same in all directions; emitters keep their harmonics.
fn forget_directions(scene: &mut Gaussians) {
    for (harmonics, &emission) in scene.harmonics.iter_mut().zip(&scene.emissions) {
        if !emits(emission) {
            *harmonics = Harmonics::NONE;
        }
    }
    if scene.harmonics.iter().all(|h| *h == Harmonics::NONE) {
        scene.harmonics.clear();
    }
}

/// `radiances` of what reflects, and the scene's own of what emits. `[n]`
fn with_emitters(scene: &Gaussians, radiances: &[Vec3]) -> Vec<Vec3> {
    (scene.radiances.iter())
        .zip(&scene.emissions)
        .zip(radiances)
        .map(|((own, &e), reflected)| if emits(e) { *own } else { *reflected })
        .collect()
}

/// The command in ledgers.
const COMMAND: &str = "bake";
/// Advice to who finds the work folder taken.
const ADVICE: &str = "--force starts over, --work names another folder";

/// Opens the work folder of this bake.
fn open_work(request: &BakeRequest) -> Result<Ledger> {
    let mut options = request.options;
    let mut shard = Shard::WHOLE;
    if let BakeMethod::Views(views) = &mut options.method {
        shard = std::mem::replace(&mut views.shard, Shard::WHOLE);
    }
    let dataset = Dataset::open(&request.cameras)?;
    let key = Key::new()
        .with_file("scene", &request.scene)?
        .with_file("cameras", dataset.transforms())?
        .with_value("options", &options)?;
    match Ledger::open(&request.work, COMMAND, &key, shard, ADVICE) {
        Err(SceneError::Work { .. }) if request.start_over => {
            clear(&request.work)?;
            Ok(Ledger::open(&request.work, COMMAND, &key, shard, ADVICE)?)
        }
        opened => Ok(opened?),
    }
}

/// Removes what bakes leave in a work folder, and nothing else.
fn clear(work: &Path) -> Result<()> {
    ledger::clear(work, COMMAND)?;
    for name in [gaussians::STATE, TRANSFORMS_FILE, RADIANCE_DIR] {
        files::remove_if_there(&work.join(name))?;
    }
    // Fails where the folder holds something else, which is to stay.
    std::fs::remove_dir(work).ok();
    Ok(())
}
