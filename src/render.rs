//! `eagpt render`: images of a scene from the cameras of a dataset.

mod aov;
mod denoise;

use crate::cli::{self, GlobalArgs};
use crate::output::{self, Replace, Target};
use crate::progress::Reporter;
use crate::record::{FILE_NAME, Input, RecordBuilder, SplitRecord};
use anyhow::{Result, bail};
use aov::Aov;
use clap::{Args, ValueEnum};
use denoise::{Choice, Denoising};
use eagpt_denoise::Denoiser;
use eagpt_scene::dataset::{Frame, SplitRule, Subset};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::{Dataset, Image, ply, png};
use eagpt_trace::cpu::CpuScene;
use eagpt_trace::transport::{EMISSION_THRESHOLD, Sampling};
use eagpt_trace::{Integrator, LightOptions, RenderedView, Tracer};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Render a scene from the cameras of a dataset
///
/// Writes into DIR, for every view: VIEW.exr, linear Rec.709 radiance, and VIEW.png, the same as sRGB; with --aov also
/// AOV/VIEW.exr, and AOV/VIEW.png where there is something to look at; at the end record.json. View names may contain "/".
///
/// Only the cameras of the dataset are used; of its images, the sizes.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it
    #[arg(value_name = "SCENE.ply")]
    scene: PathBuf,
    /// Dataset whose cameras to render: a folder with a transforms.json, or that file
    #[arg(long, value_name = "DATASET")]
    cameras: PathBuf,
    /// Views to render
    #[arg(long, value_name = "SUBSET", default_value = "test", value_parser = cli::subset())]
    split: Subset,
    /// Rule that divides the views into training and test views; that of the training, if the result is to be measured
    #[arg(long, value_name = "RULE", default_value = "every-8th", value_parser = cli::split_rule())]
    split_rule: SplitRule,
    /// Names of the views to render, separated by commas, instead of a subset
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', conflicts_with_all = ["split", "split_rule"])]
    views: Vec<String>,
    /// How light is computed
    #[arg(long, value_enum)]
    mode: Mode,
    /// Samples per pixel of 1-bounce and path, at least 1; rounded up to a multiple of the rays of a pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// Rays along each axis of a pixel, at least 1: a pixel is the mean over its area. Samples are divided among them
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    antialias: u32,
    /// Most bounces of a path, at least 1
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    bounces: u32,
    /// End paths at random from this bounce on, at least 1; the mean stays, the noise grows [default: never]
    #[arg(long, value_name = "FROM_BOUNCE", value_parser = clap::value_parser!(u32).range(1..))]
    russian_roulette: Option<u32>,
    /// Emission from which on a surface counts as an emitter, 0 to 1
    #[arg(long, value_name = "E", default_value_t = EMISSION_THRESHOLD, value_parser = share)]
    emission_threshold: f32,
    /// How light is looked for; the mean image is the same, the noise is not
    #[arg(long, value_enum, default_value = "next-event")]
    sampling: SamplingArg,
    /// Seed of the random numbers, 0 to 2^63 − 1
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = cli::seed())]
    seed: u64,
    /// Also write these quantities of the camera rays, separated by commas
    #[arg(long, value_enum, value_name = "AOV,…", value_delimiter = ',')]
    aov: Vec<Aov>,
    /// Take the noise of sampled light out of the images, guided by albedo, normals and positions; emitters keep their values.
    /// 0-bounce has no noise and stays as it is
    #[arg(long, value_enum, default_value = "none")]
    denoise: Choice,
    /// Library of Open Image Denoise, or its folder [default: EAGPT_OIDN, then where the system keeps libraries]
    #[arg(long, value_name = "PATH")]
    oidn: Option<PathBuf>,
    /// Folder for results; created
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace an earlier result in DIR
    #[arg(long)]
    force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode 0-bounce --aov normal,depth,albedo --out renders/0
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 256 --views 0000,0016 --out renders/path
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 16 --denoise auto --out renders/quick";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// The radiance that the Gaussians carry
    #[value(name = "0-bounce")]
    ZeroBounce,
    /// One bounce into the radiance that the Gaussians carry; emitters show their own
    #[value(name = "1-bounce")]
    OneBounce,
    /// Path tracing from the emitters alone
    Path,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SamplingArg {
    /// In directions about the normal only, as in the paper
    Cosine,
    /// Towards emitters as well, with multiple importance sampling
    NextEvent,
}

/// What decides the result, for the record.
#[derive(Serialize)]
struct Options<'a> {
    scene: &'a Path,
    cameras: &'a Path,
    views: &'a [String],
    /// Samples are counted for each camera ray.
    integrator: Integrator,
    rays_per_axis: u32,
    light: LightOptions,
    aov: &'a [Aov],
    denoise: Denoising,
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        Ok(value) => Err(format!("{value} is outside 0 to 1")),
        Err(error) => Err(error.to_string()),
    }
}

pub(crate) fn run(args: &RenderArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let (integrator, light) = (integrator(args), light(args));
    let noisy = integrator != Integrator::ZeroBounce;
    let denoiser = denoise::denoiser(args)?.filter(|_| noisy);
    let mut builder = RecordBuilder::begin(
        "render",
        &Options {
            scene: &args.scene,
            cameras: &args.cameras,
            views: &args.views,
            integrator,
            rays_per_axis: args.antialias,
            light,
            aov: &args.aov,
            denoise: Denoising {
                asked: args.denoise,
                ran: denoiser.as_ref().map(Denoiser::identity),
            },
        },
    )?;
    if args.denoise != Choice::None && !noisy {
        let warning = "--denoise: 0-bounce samples no light, there is nothing to denoise";
        builder.record.warnings.push(warning.to_owned());
    }
    let dataset = Dataset::open(&args.cameras)?;
    let (frames, split) = select(args, &dataset, &mut builder.record.warnings)?;
    let outputs = planned(&frames, &args.aov);
    let mut inputs = cli::dataset_files(&dataset);
    inputs.push(args.scene.clone());
    let target = Target {
        dir: &args.out,
        command: "render",
        inputs: &inputs,
        replace: Replace::from_flag(args.force),
    };
    target.check(&outputs)?;
    let gaussians = ply::read_gaussians(&args.scene)?;
    builder.record.inputs = vec![Input::of(&args.scene)?, Input::of_cameras(&dataset)?];
    let scene: Box<dyn Tracer> = Box::new(CpuScene::new(&gaussians));
    target.prepare()?;

    let mut reporter = Reporter::new(global);
    for warning in &builder.record.warnings {
        reporter.warning(warning);
    }
    let total = frames.len() as u64;
    let mut denoising = 0.0;
    reporter.begin("rendering", "views", 0, total);
    for (done, frame) in (1..).zip(&frames) {
        let started = Instant::now();
        let camera = frame.camera.magnified(args.antialias);
        let rays = scene.render(&camera, &integrator, &light)?;
        let mut rendered = rays.averaged(args.antialias);
        if let Some(denoiser) = &denoiser {
            let started = Instant::now();
            rendered.radiance = denoise::denoised(args, denoiser, &camera, &rays, &rendered)?;
            denoising += started.elapsed().as_secs_f64();
        }
        write_view(args, frame, &rendered)?;
        let seconds = started.elapsed().as_secs_f64();
        builder.took(&format!("views/{}", frame.name), seconds);
        reporter.advance(done, || frame.name.clone());
        reporter.message(&serde_json::json!({
            "message": "view",
            "view": frame.name,
            "done": done,
            "total": total,
            "seconds": seconds,
        }))?;
    }
    reporter.finish();
    if denoiser.is_some() {
        builder.took("denoising", denoising);
    }
    let record = &mut builder.record;
    record.seed = Some(light.seed);
    record.device = Some(scene.device());
    record.split = Some(split);
    record.outputs = outputs
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    builder.write(&args.out)?;
    reporter.note(&format!("{}: {total} views", args.out.display()));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out.join(FILE_NAME),
    }))?;
    Ok(ExitCode::SUCCESS)
}

fn integrator(args: &RenderArgs) -> Integrator {
    let num_samples = args.spp.div_ceil(args.antialias.pow(2));
    match args.mode {
        Mode::ZeroBounce => Integrator::ZeroBounce,
        Mode::OneBounce => Integrator::OneBounce { num_samples },
        Mode::Path => Integrator::Path {
            num_samples,
            max_bounces: args.bounces,
            roulette_from: args.russian_roulette,
        },
    }
}

fn light(args: &RenderArgs) -> LightOptions {
    LightOptions {
        seed: args.seed,
        emission_threshold: args.emission_threshold,
        sampling: match args.sampling {
            SamplingArg::Cosine => Sampling::Cosine,
            SamplingArg::NextEvent => Sampling::NextEvent,
        },
    }
}

/// The views to render, and how they were chosen.
fn select<'a>(
    args: &RenderArgs,
    dataset: &'a Dataset,
    warnings: &mut Vec<String>,
) -> Result<(Vec<&'a Frame>, SplitRecord)> {
    let frames = dataset.frames();
    let everything = args.split == Subset::All
        && matches!(args.split_rule, SplitRule::Every8th | SplitRule::All);
    if args.views.is_empty() && everything {
        // No rule is needed, and none may fail, as every-8th does on a single camera.
        return Ok((
            frames.iter().collect(),
            unruled(Some(Subset::All), frames.len()),
        ));
    }
    if args.views.is_empty() {
        let split = dataset.split(args.split_rule)?;
        warnings.extend(split.warnings.iter().cloned());
        let chosen = split.indices(args.split).into_iter().map(|i| &frames[i]);
        return Ok((chosen.collect(), SplitRecord::new(&split, args.split)));
    }
    let mut chosen = Vec::with_capacity(args.views.len());
    for name in &args.views {
        let Some(frame) = frames.iter().find(|frame| frame.name == *name) else {
            bail!(
                "{}: --views: there is no view `{name}`; the {} views are called like `{}`",
                dataset.transforms().display(),
                frames.len(),
                frames[0].name
            );
        };
        chosen.push(frame);
    }
    let record = unruled(None, chosen.len());
    Ok((chosen, record))
}

fn unruled(subset: Option<Subset>, num_views: usize) -> SplitRecord {
    SplitRecord {
        rule: None,
        num_train: None,
        num_test: None,
        subset,
        num_views,
    }
}

/// Everything that will be written, relative to the output folder.
fn planned(frames: &[&Frame], aovs: &[Aov]) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for frame in frames {
        files.push(exr_name(&frame.name));
        files.push(png_name(&frame.name));
        for aov in aovs {
            let dir = Path::new(aov.name());
            files.push(dir.join(exr_name(&frame.name)));
            if aov.has_picture() {
                files.push(dir.join(png_name(&frame.name)));
            }
        }
    }
    files
}

// Not `Path::with_extension`: that would take the ".5" off a view called "a.5".
fn exr_name(view: &str) -> PathBuf {
    format!("{view}.exr").into()
}

fn png_name(view: &str) -> PathBuf {
    format!("{view}.png").into()
}

fn write_view(args: &RenderArgs, frame: &Frame, rendered: &RenderedView) -> Result<()> {
    let name = &frame.name;
    let picture = &rendered.radiance;
    exr::write_rgb(
        &output::place(&args.out, &exr_name(name))?,
        picture,
        precision(picture),
    )?;
    png::write_srgb8(&output::place(&args.out, &png_name(name))?, picture)?;
    for aov in &args.aov {
        let dir = args.out.join(aov.name());
        let exr_path = output::place(&dir, &exr_name(name))?;
        let png_path = output::place(&dir, &png_name(name))?;
        aov.write(&frame.camera, &rendered.sums, &exr_path, &png_path)?;
    }
    Ok(())
}

/// Half precision, unless a value is too bright for it.
fn precision(image: &Image<3>) -> Precision {
    // Half a step above the largest half: from here on values round to infinity.
    const OVERFLOW: f32 = 65_520.0;
    if image.values().iter().any(|value| value.abs() >= OVERFLOW) {
        Precision::Float
    } else {
        Precision::Half
    }
}
