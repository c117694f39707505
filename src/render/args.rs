//! Arguments of `eagpt render`.

use super::aov::Aov;
use super::denoise::Choice;
use super::display::DisplayArgs;
use super::light::SetLight;
use super::shots::PathArgs;
use crate::args;
use crate::command_line;
use crate::device::DeviceArgs;
use clap::{Args, ValueEnum};
use eagpt_scene::Shard;
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_trace::transport::{EMISSION_THRESHOLD, Hits, MAX_BOUNCES, ROULETTE_FROM, Sampling};
use eagpt_trace::{CameraRays, Integrator, LightOptions};
use serde::Serialize;
use std::path::PathBuf;

/// Render a scene from the cameras of a dataset, or along a path between them
///
/// Writes into DIR, for every view: VIEW.exr, linear Rec.709 radiance, and VIEW.png, the same as
/// sRGB; with --aov also AOV/VIEW.exr, and AOV/VIEW.png where there is something to look at; at the
/// end record.json. View names may contain "/".
///
/// With --camera-path the views are frame_0000, frame_0001, …: PNGs alone, EXRs too with --exr, and
/// a transforms.json with their cameras, which --cameras takes as well. Frame i has the seed S + i:
/// noise does not stick to the screen.
///
/// The same command resumes where it was stopped: finished views are known by their content.
///
/// Only the cameras of the dataset are used; of its images, the sizes, and those not if it states w
/// and h.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it
    #[arg(value_name = "SCENE.ply")]
    pub(crate) scene: PathBuf,
    /// Dataset whose cameras to render: a folder with a transforms.json, or that file
    #[arg(long, value_name = "DATASET")]
    pub(crate) cameras: PathBuf,
    /// Views to render
    #[arg(long, value_name = "SUBSET", default_value = "test", value_enum)]
    pub(crate) split: Subset,
    /// Rule that divides the views into training and test views; that of the training, if the
    /// result is to be measured
    #[arg(long, value_name = "RULE", default_value = "every-8th", value_enum)]
    pub(crate) split_rule: SplitRule,
    /// Names of the views to render, separated by commas, instead of a subset
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', conflicts_with_all = ["split", "split_rule"])]
    pub(super) views: Vec<String>,
    /// Light transport
    #[arg(long, value_enum)]
    pub(crate) mode: Mode,
    /// Samples per pixel of 1-bounce, gather and path, at least 1; rounded up to a multiple of the
    /// rays of a pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: u32,
    /// Rays along each axis of a pixel, at least 1: a pixel is the mean over its area. Samples are
    /// divided among them
    #[arg(long, value_name = "N", default_value_t = CameraRays::RAYS_PER_AXIS, value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(super) antialias: u32,
    /// Maximum path depth: bounces, at least 1
    #[arg(long, value_name = "N", default_value_t = MAX_BOUNCES, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) bounces: u32,
    /// End paths at random from this bounce on, at least 1 and on a GPU at least 3; 0 for never.
    /// The mean stays, the noise grows a little
    #[arg(long, value_name = "FROM_BOUNCE", default_value_t = ROULETTE_FROM)]
    pub(crate) russian_roulette: u32,
    /// Emission from which on a surface counts as an emitter, 0 to 1
    #[arg(long, value_name = "E", default_value_t = EMISSION_THRESHOLD, value_parser = args::within(0.0_f32..=1.0))]
    pub(super) emission_threshold: f32,
    /// Light sampling; the mean image is the same, the noise is not
    #[arg(long, value_enum, default_value = "next-event")]
    sampling: Sampling,
    /// Surface of a path's ray that meets several Gaussians
    #[arg(long, value_enum, default_value = "sampled")]
    hits: Hits,
    /// Seed of the random numbers, 0 to 2^63 − 1
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = args::seed())]
    pub(super) seed: u64,
    /// Also write these quantities of the camera rays, separated by commas
    #[arg(long, value_enum, value_name = "AOV,…", value_delimiter = ',')]
    pub(super) aov: Vec<Aov>,
    /// Take the noise of sampled light out of the images, guided by albedo, normals and positions;
    /// emitters keep their values. 0-bounce has no noise and stays as it is
    #[arg(long, value_enum, default_value = "none")]
    pub(super) denoise: Choice,
    /// Library of Open Image Denoise, or its folder [default: EAGPT_OIDN, then where the system
    /// keeps libraries]
    #[arg(long, value_name = "PATH")]
    pub(super) oidn: Option<PathBuf>,
    /// Factor of a light, 1 as it was baked, as `ceiling-2=0.5`, `window=1,0.8,0.6` or `wall-*=0`;
    /// may be given several times, in this order. Of a scene that was baked with --per-light; in
    /// all modes
    #[arg(long, value_name = "NAME=F|NAME=R,G,B")]
    #[serde(serialize_with = "command_line::texts")]
    pub(super) set_light: Vec<SetLight>,
    /// --set-light: what each Gaussian reflects of each lamp [default: SCENE.lights beside
    /// SCENE.ply]
    #[arg(long, value_name = "SCENE.lights", requires = "set_light")]
    pub(super) lights: Option<PathBuf>,
    /// Folder for results; created
    #[arg(long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// Render only part I of N of the views, 1 to N. Parts share DIR and may run at once, on
    /// machines that share it; when all are there, the same command without --shard combines them,
    /// bit-identical to an undivided run
    #[arg(long, value_name = "I/N", conflicts_with = "force")]
    #[serde(serialize_with = "command_line::optional_text")]
    pub(crate) shard: Option<Shard>,
    /// Replace an earlier result in DIR, or unfinished work on another
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) device: DeviceArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) path: PathArgs,
    #[command(flatten)]
    #[serde(flatten)]
    pub(super) display: DisplayArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode 0-bounce --aov normal,depth,albedo --out renders/0
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 256 --views 0000,0016 --out renders/path
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 16 --denoise auto --out renders/quick
  eagpt render bakes/lamps.ply --cameras kitchen --mode 0-bounce --set-light window=0 --out renders/night
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --out renders/path --shard 1/4   (and 2/4 … elsewhere,
      then without --shard)
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode 0-bounce --camera-path fly:0000,0016,0032 --out fly
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --camera-path turntable --exposure auto \\
      --tone-map agx --out turn";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Mode {
    /// The radiance that the Gaussians carry
    #[value(name = "0-bounce")]
    #[serde(rename = "0-bounce")]
    ZeroBounce,
    /// One bounce into the radiance that the Gaussians carry; emitters show their own
    #[value(name = "1-bounce")]
    #[serde(rename = "1-bounce")]
    OneBounce,
    /// The radiance that the Gaussians carry, with glossy surfaces that mirror it; for baked scenes
    ///
    /// Only the specular part of glossy surfaces is sampled. Without gloss it is 0-bounce.
    Gather,
    /// Path tracing from the emitters alone
    Path,
}

impl RenderArgs {
    /// Light transport; samples are those of a ray.
    pub(super) fn integrator(&self) -> Integrator {
        let num_samples = self.spp.div_ceil(self.antialias.pow(2));
        match self.mode {
            Mode::ZeroBounce => Integrator::ZeroBounce,
            Mode::OneBounce => Integrator::OneBounce { num_samples },
            Mode::Gather => Integrator::Gather { num_samples },
            Mode::Path => Integrator::Path {
                num_samples,
                max_bounces: self.bounces,
                roulette_from: (self.russian_roulette > 0).then_some(self.russian_roulette),
            },
        }
    }

    pub(super) fn light(&self) -> LightOptions {
        LightOptions {
            seed: self.seed,
            emission_threshold: self.emission_threshold,
            sampling: self.sampling,
            hits: self.hits,
        }
    }
}
