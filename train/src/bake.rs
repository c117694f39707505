//! Light baking: after an edit, radiance that fits the light as it is now (EAG-PT, section 3.5).
//!
//! Emitters, the Gaussians whose emission exceeds τ_E, keep their radiance; every other one gets
//! what it reflects. Geometry, emission and albedo stay as they are, bit for bit. Two methods:
//! - [`gaussians`]: the light is solved in Gaussian space; no image is made.
//! - [`views`]: the paper's; the views of a dataset are path-traced and radiance is fitted to them.

pub mod gaussians;
mod transport;
pub mod views;

use crate::error::{Result, TrainError};
use eagpt_scene::dataset::{Split, SplitRule, Subset};
use eagpt_scene::{Dataset, Gaussians, Harmonics, SceneError, Shard, files, ply};
use eagpt_trace::Device;
use eagpt_trace::transport::EMISSION_THRESHOLD;
use gaussians::GaussianBake;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use views::ViewBake;

/// How light is baked.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "method")]
pub enum BakeMethod {
    /// Solved in Gaussian space.
    Gaussians(GaussianBake),
    /// Fitted to path-traced views.
    Views(ViewBake),
}

/// What decides the result, beside scene and cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BakeOptions {
    /// How.
    #[serde(flatten)]
    pub method: BakeMethod,
    /// Most bounces of light, at least 1.
    pub max_bounces: u32,
    /// Seed of the random numbers.
    pub seed: u64,
    /// How the dataset's views are divided.
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
    /// Folder for the state of the work: a bake that was stopped goes on from there.
    pub work: PathBuf,
    /// File for the traced transport matrix of [`BakeMethod::Gaussians`], in place of the work
    /// folder: kept for later bakes, which reuse it if the geometry is the same.
    pub transport: Option<PathBuf>,
    /// Options.
    pub options: BakeOptions,
    /// What traces rays and, with [`BakeMethod::Views`], fits.
    pub device: Device,
    /// Whether the work of another bake may go from the work folder.
    pub start_over: bool,
    /// Set from outside to stop soon, with the work so far on disk.
    pub stop: Arc<AtomicBool>,
}

impl BakeRequest {
    /// Whether the work folder is used.
    fn has_work(&self) -> bool {
        self.transport.is_none() || matches!(self.options.method, BakeMethod::Views(_))
    }
}

/// What a bake tells while it goes on.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "message")]
pub enum BakeProgress {
    /// Cameras look for the surface of each Gaussian.
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

/// What a finished (or stopped) bake was.
#[derive(Debug, Clone, PartialEq)]
pub struct BakeSummary {
    /// The scene file; `None` if the bake was stopped, or was one shard of several.
    pub scene: Option<PathBuf>,
    /// Rays traced in this process; those of cameras are not counted.
    pub num_rays: u64,
    /// How the views were divided.
    pub split: Split,
    /// What computed.
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
    if request.has_work() {
        claim(request)?;
    }
    let radiances = match &request.options.method {
        BakeMethod::Gaussians(method) => bake.solve(method)?,
        BakeMethod::Views(method) => bake.fit_views(method)?,
    };
    let num_rays = bake.num_rays;
    let scene = match radiances {
        Some(radiances) => {
            let baked = Gaussians {
                radiances,
                ..bake.scene
            };
            ply::write_gaussians(&request.out, &baked)?;
            if matches!(request.options.method, BakeMethod::Gaussians(_)) && request.has_work() {
                // Path-traced views are worth keeping, the rows of a matrix are not.
                clear(&request.work)?;
            }
            Some(request.out.clone())
        }
        None => None,
    };
    Ok(BakeSummary {
        scene,
        num_rays,
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

    /// Indices of the Gaussians that reflect.
    fn reflecting(&self) -> impl Iterator<Item = u32> {
        (0..)
            .zip(&self.scene.emissions)
            .filter(|(_, e)| !emits(**e))
            .map(|(i, _)| i)
    }
}

/// Whether a Gaussian keeps its radiance.
fn emits(emission: f32) -> bool {
    emission > EMISSION_THRESHOLD
}

/// What reflects sends its light in all directions alike; what emits keeps its own. A bake knows no
/// more.
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

/// File in the work folder that says which bake it belongs to.
const CLAIM: &str = "bake.json";

/// What the work folder belongs to.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Claim {
    /// Digest of the scene's file.
    scene: String,
    /// Digest of the cameras' file.
    cameras: String,
    /// Digest of the options; those of a shard are those of the whole.
    options: String,
}

impl Claim {
    /// In what `other` differs, in words.
    fn differences(&self, other: &Self) -> String {
        let differs = [
            (self.scene != other.scene).then_some("another scene"),
            (self.cameras != other.cameras).then_some("other cameras"),
            (self.options != other.options).then_some("other options"),
        ];
        let differs: Vec<&str> = differs.into_iter().flatten().collect();
        differs.join(" and ")
    }
}

fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Makes the work folder this bake's own.
fn claim(request: &BakeRequest) -> Result<()> {
    let mut options = request.options;
    if let BakeMethod::Views(views) = &mut options.method {
        views.shard = Shard::WHOLE;
    }
    let path = request.work.join(CLAIM);
    let json = |e: serde_json::Error| SceneError::invalid(&path, "JSON", e.to_string());
    let dataset = Dataset::open(&request.cameras)?;
    let claim = Claim {
        scene: digest(&files::read(&request.scene)?),
        cameras: digest(&files::read(dataset.transforms())?),
        options: digest(&serde_json::to_vec(&options).map_err(json)?),
    };
    if path.exists() {
        let found: Claim = serde_json::from_slice(&files::read(&path)?).map_err(json)?;
        if found == claim {
            return Ok(());
        }
        if !request.start_over {
            let problem = format!(
                "the folder holds the work of a bake with {}: --force starts over, --work names another folder",
                found.differences(&claim)
            );
            return Err(TrainError::Output { path, problem });
        }
        clear(&request.work)?;
    }
    files::create_dir(&request.work)?;
    let text = serde_json::to_vec_pretty(&claim).map_err(json)?;
    files::write_bytes_atomic(&path, &text)?;
    Ok(())
}

/// Removes what bakes leave in a work folder, and nothing else.
fn clear(work: &Path) -> Result<()> {
    for path in [
        work.join(gaussians::STATE),
        work.join(eagpt_scene::dataset::TRANSFORMS_FILE),
        work.join(eagpt_scene::dataset::RADIANCE_DIR),
        work.join(CLAIM),
    ] {
        files::remove_if_there(&path)?;
    }
    // Fails where the folder holds something else, which is to stay.
    std::fs::remove_dir(work).ok();
    Ok(())
}
