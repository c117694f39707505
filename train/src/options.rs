//! Options of a training run.
//!
//! One struct serves the command line, TOML files and the record beside the result. A run starts
//! from a [`Preset`]; [`TrainOptions::from_layers`] puts a file and single settings on top.

mod arguments;
mod layers;
mod presets;
mod schedule;

pub use arguments::OptionArgs;
pub use schedule::{DensifyOptions, LampOptions};

use crate::error::Result;
use crate::init::agreement;
use eagpt_scene::Dataset;
use eagpt_scene::dataset::SplitRule;
use serde::{Deserialize, Serialize};

/// Named sets of defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Preset {
    /// A first look, in minutes on a CPU
    Draft,
    /// Good results on a CPU within 20 minutes for a small dataset
    Fast,
    /// Iterations, rates and samples of the paper
    Paper,
}

impl Preset {
    /// The name used in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Draft => "draft",
            Self::Fast => "fast",
            Self::Paper => "paper",
        }
    }
}

/// A stage of training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Stage 0: geometry, radiance and emission.
    Radiance,
    /// Stage 1: diffuse albedo.
    Albedo,
}

impl Stage {
    /// The name used in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Radiance => "radiance",
            Self::Albedo => "albedo",
        }
    }
}

/// Which stages to run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum StageChoice {
    /// Stage 0, then stage 1
    All,
    /// Stage 0: geometry, radiance, emission
    Radiance,
    /// Stage 1: albedo
    ///
    /// Starts from the scene that an earlier run left in the output folder.
    Albedo,
}

/// Everything a run can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainOptions {
    /// The preset the other values started from.
    pub preset: Preset,
    /// Stages to run.
    pub stage: StageChoice,
    /// Seed of all random numbers.
    pub seed: u64,
    /// How views are divided into training and test views.
    pub split: SplitRule,
    /// Number of Gaussians in the end; without it, `init.per_point` for each point of the cloud.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub num_gaussians: Option<usize>,
    /// Starting values.
    pub init: InitOptions,
    /// Stage 0.
    pub radiance: RadianceOptions,
    /// Stage 1.
    pub albedo: AlbedoOptions,
    /// Checkpoints, previews and the log.
    pub output: OutputOptions,
}

/// Starting values of the Gaussians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InitOptions {
    /// Gaussians for each point of the cloud where `num_gaussians` is not given; those beyond the
    /// first start between a point and one of its neighbours.
    pub per_point: f32,
    /// Scale as a multiple of the root mean square distance to the three nearest points.
    pub scale_factor: f32,
    /// Opacity, between 0 and 1.
    pub opacity: f32,
    /// Emission where no mask says otherwise, between 0 and 1.
    pub emission: f32,
    /// Albedo before stage 1, between 0 and 1.
    pub albedo: f32,
}

/// Adam's step sizes for the raw parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningRates {
    /// Position, as a share of the scene's extent (half the diagonal of the box around the middle
    /// 98 % of the points).
    pub position: f32,
    /// Logarithm of the scales.
    pub scale: f32,
    /// Quaternion.
    pub rotation: f32,
    /// Logit of the opacity.
    pub opacity: f32,
    /// Logarithm of the radiance.
    pub radiance: f32,
    /// Logit of the emission.
    pub emission: f32,
    /// All rates fall exponentially to this share of their start at the end of the stage; 1 keeps
    /// them constant.
    pub final_share: f32,
}

impl LearningRates {
    /// Share of the rates that is left when `progress` (0 to 1) of the stage is done.
    pub fn share_at(&self, progress: f32) -> f32 {
        self.final_share.powf(progress)
    }
}

/// Radiance by [`eagpt_scene::harmonics`], for light that glossy surfaces reflect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HarmonicsOptions {
    /// Highest degree, 0 to 2; with 0 radiance is the same in all directions, as in the paper.
    pub degree: u32,
    /// Share of the iterations after which they start, 0 to 1. Light that may differ with the
    /// direction explains surfaces that are in the wrong place: geometry comes first.
    pub from: f32,
    /// Step size of the coefficients; falls as the others do.
    pub rate: f32,
    /// Share of itself, times its step size, a coefficient loses in each iteration: what few
    /// views say stays small. Not negative.
    pub decay: f32,
}

impl HarmonicsOptions {
    /// The iteration of `total`, counted from 1, from which on coefficients move; `None` if they
    /// never do.
    pub fn start(&self, total: u32) -> Option<u32> {
        let first = (f64::from(self.from) * f64::from(total)).ceil() as u32 + 1;
        (self.degree > 0 && first <= total).then_some(first)
    }
}

/// Weights of the loss, λ of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossWeights {
    /// Colour, λ_c.
    pub color: f64,
    /// Share of 1 − SSIM in the colour term; the rest is L1.
    pub ssim_share: f64,
    /// Blended normals against the view's normal map, λ_n.
    pub normal: f64,
    /// Normals of the depth's surface against the normal map (or against the blended normals), λ_d.
    pub depth_normal: f64,
    /// Emission against the view's mask, λ_e.
    pub emission: f64,
    /// Opacity, λ_a.
    pub alpha: f64,
    /// Distances against the points of the cloud, where views see them, as a share of the distance.
    pub depth: f64,
}

/// Stage 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadianceOptions {
    /// Iterations, one view each.
    pub iterations: u32,
    /// Share of the iterations after which the normal terms start, 0 to 1.
    pub normals_from: f32,
    /// Share of the iterations after which a pixel that differs from one beside it in the
    /// photograph is the mean of 2×2 rays instead of one, 0 to 1: cameras average over their
    /// pixels. A step then takes up to twice as long; 1 is never, as in the paper.
    pub antialias_from: f32,
    /// Step sizes.
    pub rates: LearningRates,
    /// Radiance that differs with the direction it is seen from.
    pub harmonics: HarmonicsOptions,
    /// Loss weights.
    pub weights: LossWeights,
    /// How the number of Gaussians grows.
    pub densify: DensifyOptions,
    /// Treatment of emitters.
    pub lamps: LampOptions,
    /// Whether mirrors are looked for when lamps become clean, and become surfaces that reflect the
    /// room (crate `eagpt-mirrors`), in place of another room behind a wall.
    pub mirrors: bool,
}

/// Where stage 1 gathers incident light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gather {
    /// At every Gaussian, once: light does not change in this stage. Albedos start at the closed
    /// form `ρ = π r / E`.
    Gaussians,
    /// At every pixel, anew in each iteration, as in the paper.
    Pixels,
}

/// Stage 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlbedoOptions {
    /// Iterations, one view each, for each light.
    pub iterations: u32,
    /// Where and when incident light is gathered.
    pub gather: Gather,
    /// Directions sampled at each Gaussian or pixel.
    pub num_samples: u32,
    /// Whether glossy surfaces are looked for before the stage; in the paper all are diffuse.
    pub gloss: bool,
    /// Whether light is looked for that no view shows: from where none looks, and of bulbs in
    /// shades and fixtures, whose lamps are stronger than views see them. Lamps have to be listed
    /// (`radiance.lamps.clean`), light gathered at Gaussians, and the photographs be of one light.
    pub unseen_light: bool,
    /// Step size of the albedo's logit.
    pub rate: f32,
    /// The rate falls exponentially to this share at the end.
    pub final_share: f32,
    /// τ_E: pixels of higher emission show their radiance.
    pub emission_threshold: f32,
}

/// Checkpoints, previews and the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputOptions {
    /// Iterations between checkpoints.
    pub checkpoint_every: u32,
    /// Checkpoints kept.
    pub keep_checkpoints: usize,
    /// Iterations between previews; 0 for none.
    pub preview_every: u32,
    /// Views shown in previews.
    pub num_previews: usize,
    /// Iterations between lines of the log.
    pub log_every: u32,
}

impl TrainOptions {
    /// Number of points that training on `dataset` starts from: those of its cloud, or those that
    /// are looked for where it has none.
    ///
    /// # Errors
    /// If the cloud or the split cannot be read.
    pub(crate) fn num_points(&self, dataset: &Dataset) -> Result<usize> {
        if let Some(cloud) = dataset.points()? {
            return Ok(cloud.len());
        }
        let frames = dataset.frames();
        let training = dataset.split(self.split)?.train;
        let num_pixels = training.iter().map(|&i| frames[i].camera.num_pixels());
        Ok(agreement::num_points(num_pixels.sum()))
    }

    /// Number of Gaussians to train for a cloud of `num_points` points.
    pub fn gaussians_for(&self, num_points: usize) -> usize {
        self.num_gaussians
            .unwrap_or((num_points as f64 * f64::from(self.init.per_point)).round() as usize)
    }
}
