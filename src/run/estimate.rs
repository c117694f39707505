//! What steps will take that have never run: the size of their work times what a unit of it took on
//! one core of an AMD EPYC (Zen 4).
//!
//! Good for telling minutes from hours, within a factor of two or three: scenes differ, and so do
//! machines.

use super::step::{Step, parse};
use crate::bake::{BakeArgs, MethodArg};
use crate::command::JobCommand;
use crate::render::{Mode, RenderArgs};
use crate::train::{TrainArgs, layers};
use eagpt_scene::Dataset;
use eagpt_scene::dataset::{SplitRule, Subset};
use std::path::Path;

/// Seconds of a core for a pixel of an iteration of stage 0, forwards and backwards.
const TRAIN_PIXEL_S: f64 = 3.7e-6;
/// Of stage 1, whose light has been gathered.
const ALBEDO_PIXEL_S: f64 = 1.2e-6;
/// For a pixel of an image by 0-bounce, with its files.
const FRAME_PIXEL_S: f64 = 6.5e-6;
/// For a sample of a pixel by 1-bounce.
const BOUNCE_S: f64 = 4e-6;
/// For each bounce that a path may have; and where most paths end at random before.
const PATH_BOUNCE_S: f64 = 9.5e-6;
const ROULETTE_BOUNCE_S: f64 = 3.5e-6;
/// For a direction that a Gaussian gathers light from.
const GATHER_S: f64 = 3.4e-6;
/// For a pixel that masks are made for, on the way through two passes.
const MASK_PIXEL_S: f64 = 3.5e-7;
/// For a pixel that is compared with its reference, FLIP above all.
const COMPARED_PIXEL_S: f64 = 4.6e-6;

/// For what is done in an instant.
const BRIEF_S: f64 = 0.2;

/// What a step will take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Estimate {
    /// Wall time.
    pub(super) seconds: f64,
    /// Memory, where it is planned.
    pub(super) bytes: Option<u64>,
}

/// What is known of the steps so far.
#[derive(Debug)]
pub(super) struct Outlook {
    num_threads: f64,
    /// Gaussians of the scene that is to be trained.
    num_gaussians: Option<usize>,
}

impl Outlook {
    pub(super) fn new() -> Self {
        Self {
            num_threads: rayon::current_num_threads() as f64,
            num_gaussians: None,
        }
    }

    /// What a step will take; `None` where that depends on what is not there yet. Steps are asked
    /// for in their order.
    pub(super) fn of(&mut self, step: &Step) -> Option<Estimate> {
        let mut bytes = None;
        let core_seconds = match parse(&step.arguments).ok()? {
            JobCommand::Train(args) => {
                let (seconds, memory) = self.train(&args)?;
                bytes = Some(memory);
                seconds
            }
            JobCommand::Masks(args) => {
                MASK_PIXEL_S * num_pixels(&args.dataset, SplitRule::All, Subset::All)?
            }
            JobCommand::Render(args) => render(&args)?,
            JobCommand::Bake(args) => self.bake(&args)?,
            JobCommand::Eval(args) => match args.reference.first() {
                Some(reference) => {
                    COMPARED_PIXEL_S * num_pixels(reference, SplitRule::Every8th, Subset::Test)?
                }
                // A table of numbers that are there.
                None => BRIEF_S,
            },
            JobCommand::Edit(_) | JobCommand::Report(_) => BRIEF_S,
            _ => return None,
        };
        Some(Estimate {
            seconds: core_seconds / self.num_threads,
            bytes,
        })
    }

    fn train(&mut self, args: &TrainArgs) -> Option<(f64, u64)> {
        let options = layers::options(args).ok()?;
        let dataset = Dataset::open_cameras(args.dataset.as_deref()?).ok()?;
        let split = dataset.split(options.split).ok()?;
        let points = dataset.points().ok()?.map_or(0, |cloud| cloud.len());
        self.num_gaussians = Some(options.gaussians_for(points));
        let pixels = split.train.iter();
        let pixels = pixels.map(|i| dataset.frames()[*i].camera.num_pixels() as f64);
        let mean = pixels.sum::<f64>() / split.train.len().max(1) as f64;
        let radiance = f64::from(options.radiance.iterations) * TRAIN_PIXEL_S;
        let albedo = f64::from(options.albedo.iterations) * ALBEDO_PIXEL_S;
        let memory = eagpt_train::memory(&dataset, &options, &split).ok()?;
        Some((mean * (radiance + albedo), memory.least + memory.images))
    }

    fn bake(&self, args: &BakeArgs) -> Option<f64> {
        if args.method != MethodArg::Gaussians {
            return None;
        }
        let directions = f64::from(args.samples);
        Some(self.num_gaussians? as f64 * directions * GATHER_S)
    }
}

fn render(args: &RenderArgs) -> Option<f64> {
    let pixels = num_pixels(&args.cameras, args.split_rule, args.split)?;
    let samples = f64::from(args.spp);
    Some(match args.mode {
        Mode::ZeroBounce => pixels * FRAME_PIXEL_S,
        Mode::OneBounce => pixels * (FRAME_PIXEL_S + samples * BOUNCE_S),
        Mode::Path => {
            let bounce = match args.russian_roulette {
                Some(_) => ROULETTE_BOUNCE_S,
                None => PATH_BOUNCE_S,
            };
            pixels * (FRAME_PIXEL_S + samples * f64::from(args.bounces) * bounce)
        }
    })
}

/// Pixels of the views of a dataset; `None` if it is not there.
fn num_pixels(dataset: &Path, rule: SplitRule, subset: Subset) -> Option<f64> {
    let dataset = Dataset::open_cameras(dataset).ok()?;
    let split = dataset.split(rule).ok()?;
    let views = split.indices(subset).into_iter();
    let pixels = views.map(|i| dataset.frames()[i].camera.num_pixels() as f64);
    Some(pixels.sum())
}
