//! A bake to be done, under way, and its result.

use crate::progress::BakeProgress;
use eagpt_light::irradiance;
use eagpt_scene::dataset::{Split, SplitRule, Subset};
use eagpt_scene::{Dataset, Gaussians, Shard};
use eagpt_trace::Device;
use eagpt_trace::transport::Sampling;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Method of baking.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "method")]
pub enum BakeMethod {
    /// Solved in Gaussian space.
    Gaussians(GaussianBake),
    /// Fitted to path-traced views.
    Views(ViewBake),
}

/// Options of [`BakeMethod::Gaussians`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct GaussianBake {
    /// Directions traced at each Gaussian, at least 1: half of them are light samples, the others
    /// serve all bounces; to what is brightly lit a quarter as many more go. Without a number it
    /// follows from that of the Gaussians ([`irradiance::usual_samples`]), and is twice that where
    /// the light of each lamp is asked for.
    pub num_samples: Option<u32>,
}

impl GaussianBake {
    /// Number of directions at each of `num` Gaussians, for all light or for that of each lamp.
    pub(super) fn number(self, num: usize, is_per_light: bool) -> u32 {
        let usual = || irradiance::usual_samples(num) << u32::from(is_per_light);
        self.num_samples.unwrap_or_else(usual)
    }
}

/// Options of [`BakeMethod::Views`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ViewBake {
    /// Samples per pixel, at least 1; 1,024 in the paper.
    pub num_samples: u32,
    /// First bounce at which a path may be ended at random; `None`: never.
    pub roulette_from: Option<u32>,
    /// Light sampling.
    pub sampling: Sampling,
    /// Iterations of the fit, one view each; 3,000 in the paper.
    pub iterations: u32,
    /// Adam's step size of the radiance's logarithm; it falls exponentially to a tenth.
    pub rate: f32,
    /// The part of the views to trace.
    pub shard: Shard,
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

/// A bake under way.
pub(super) struct Bake<'a> {
    pub(super) request: &'a BakeRequest,
    pub(super) progress: &'a mut dyn FnMut(BakeProgress),
    pub(super) dataset: Dataset,
    /// Indices of the views to bake for.
    pub(super) frames: Vec<usize>,
    pub(super) scene: Gaussians,
    pub(super) num_rays: u64,
}

impl Bake<'_> {
    pub(super) fn stopped(&self) -> bool {
        self.request.stop.load(Ordering::Relaxed)
    }
}

/// Told of the progress, answers whether to go on.
pub(super) type Told<'a> = dyn FnMut(BakeProgress) -> ControlFlow<()> + 'a;

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
