//! `eagpt render`: images of a scene from the cameras of a dataset.

mod aov;
mod denoise;
mod display;
mod shots;

use crate::cli::{self, GlobalArgs};
use crate::device::DeviceArgs;
use crate::interrupt;
use crate::output::{self, Replace, Target};
use crate::parts::{self, Parts};
use crate::progress::Reporter;
use crate::record::{FILE_NAME, Input, Record, RecordBuilder};
use anyhow::Result;
use aov::Aov;
use clap::{Args, ValueEnum};
use denoise::{Choice, Denoising};
use display::DisplayArgs;
use eagpt_denoise::Denoiser;
use eagpt_scene::dataset::{SplitRule, Subset, TRANSFORMS_FILE};
use eagpt_scene::exr::{self, Precision};
use eagpt_scene::tonemap::Display;
use eagpt_scene::{Dataset, Image, Shard, ply, png};
use eagpt_trace::transport::{EMISSION_THRESHOLD, Hits, Sampling};
use eagpt_trace::{Integrator, LightOptions, RenderedView, Tracer};
use serde::Serialize;
use shots::{PathArgs, PathRecord, Shot, Shots};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Render a scene from the cameras of a dataset, or along a path between them
///
/// Writes into DIR, for every view: VIEW.exr, linear Rec.709 radiance, and VIEW.png, the same as sRGB; with --aov also
/// AOV/VIEW.exr, and AOV/VIEW.png where there is something to look at; at the end record.json. View names may contain "/".
///
/// With --camera-path the views are frame_0000, frame_0001, …: PNGs alone, EXRs too with --exr, and a transforms.json
/// with their cameras, which --cameras takes as well. Frame i has the seed S + i: noise does not stick to the screen.
///
/// The same command goes on where it was stopped: what is done is known by its content.
///
/// Only the cameras of the dataset are used; of its images, the sizes, and those not if it states w and h.
#[derive(Debug, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// Scene of 2D Gaussians, as `eagpt train` writes it
    #[arg(value_name = "SCENE.ply")]
    scene: PathBuf,
    /// Dataset whose cameras to render: a folder with a transforms.json, or that file
    #[arg(long, value_name = "DATASET")]
    pub(crate) cameras: PathBuf,
    /// Views to render
    #[arg(long, value_name = "SUBSET", default_value = "test", value_parser = cli::subset())]
    pub(crate) split: Subset,
    /// Rule that divides the views into training and test views; that of the training, if the result is to be measured
    #[arg(long, value_name = "RULE", default_value = "every-8th", value_parser = cli::split_rule())]
    pub(crate) split_rule: SplitRule,
    /// Names of the views to render, separated by commas, instead of a subset
    #[arg(long, value_name = "A,B,…", value_delimiter = ',', conflicts_with_all = ["split", "split_rule"])]
    views: Vec<String>,
    /// How light is computed
    #[arg(long, value_enum)]
    pub(crate) mode: Mode,
    /// Samples per pixel of 1-bounce and path, at least 1; rounded up to a multiple of the rays of a pixel
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) spp: u32,
    /// Rays along each axis of a pixel, at least 1: a pixel is the mean over its area. Samples are divided among them
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    antialias: u32,
    /// Most bounces of a path, at least 1
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) bounces: u32,
    /// End paths at random from this bounce on, at least 1; the mean stays, the noise grows [default: never]
    #[arg(long, value_name = "FROM_BOUNCE", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) russian_roulette: Option<u32>,
    /// Emission from which on a surface counts as an emitter, 0 to 1
    #[arg(long, value_name = "E", default_value_t = EMISSION_THRESHOLD, value_parser = share)]
    emission_threshold: f32,
    /// How light is looked for; the mean image is the same, the noise is not
    #[arg(long, value_enum, default_value = "next-event")]
    sampling: SamplingArg,
    /// What a path's rays make of the Gaussians they meet
    #[arg(long, value_enum, default_value = "blended")]
    hits: HitsArg,
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
    /// Render only part I of N of the views, 1 to N. Parts share DIR and may run at once, on machines that share it; when all are
    /// there, the same command without --shard puts them together, to the bits of an undivided run
    #[arg(long, value_name = "I/N", conflicts_with = "force")]
    shard: Option<Shard>,
    /// Replace an earlier result in DIR, or unfinished work on another
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    device: DeviceArgs,
    #[command(flatten)]
    path: PathArgs,
    #[command(flatten)]
    display: DisplayArgs,
}

const EXAMPLES: &str = "Examples:
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode 0-bounce --aov normal,depth,albedo --out renders/0
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 256 --views 0000,0016 --out renders/path
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --spp 16 --denoise auto --out renders/quick
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --out renders/path --shard 1/4   (and 2/4 … elsewhere,
      then without --shard)
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode 0-bounce --camera-path fly:0000,0016,0032 --out fly
  eagpt render runs/kitchen/scene.ply --cameras kitchen --mode path --camera-path turntable --exposure auto \\
      --tone-map agx --out turn";

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// The radiance that the Gaussians carry
    #[value(name = "0-bounce")]
    ZeroBounce,
    /// One bounce into the radiance that the Gaussians carry; emitters show their own. Of a baked scene it is a final gather, and
    /// may be called that
    #[value(name = "1-bounce", alias = "gather")]
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum HitsArg {
    /// The blend of all is one surface, as in the paper
    Blended,
    /// One of them, chosen by its weight, stands for all: about twice as fast, for light that comes to about one percent less in a room.
    /// 1-bounce does so always, to the same mean
    Sampled,
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
    /// What only PNGs show.
    display: Display,
    camera_path: Option<PathRecord<'a>>,
    /// Another rounds in another way.
    device: String,
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
    let mut builder = RecordBuilder::begin("render", &())?;
    if args.denoise != Choice::None && !noisy {
        let warning = "--denoise: 0-bounce samples no light, there is nothing to denoise";
        builder.record.warnings.push(warning.to_owned());
    }
    let dataset = Dataset::open_cameras(&args.cameras)?;
    let shots = Shots::choose(args, &dataset, &mut builder.record.warnings)?;
    let outputs = planned(args, &shots);
    let mut inputs = cli::dataset_files(&dataset);
    let path_file = shots.path.as_ref().and_then(|path| path.file.clone());
    inputs.push(args.scene.clone());
    inputs.extend(path_file.clone());
    let target = |replace| Target {
        dir: &args.out,
        record: FILE_NAME,
        command: "render",
        inputs: &inputs,
        replace,
    };
    let shard = args.shard.unwrap_or(Shard::WHOLE);
    check(args, shard, &shots, &outputs, target)?;
    let gaussians = ply::read_gaussians(&args.scene)?;
    builder.record.inputs = vec![Input::of(&args.scene)?, Input::of_cameras(&dataset)?];
    if let Some(file) = &path_file {
        builder.record.inputs.push(Input::of(file)?);
    }
    let mut reporter = Reporter::new(global);
    let engine = args.device.device.open(&mut reporter)?;
    let scene = engine.tracer(&gaussians)?;
    let display = args
        .display
        .resolve(scene.as_ref(), &shots.list, &integrator, &light)?;
    builder.set_options(&Options {
        scene: &args.scene,
        cameras: &args.cameras,
        views: &args.views,
        integrator,
        rays_per_axis: args.antialias,
        light,
        aov: &args.aov,
        display,
        denoise: Denoising {
            asked: args.denoise,
            ran: denoiser.as_ref().map(Denoiser::identity),
        },
        camera_path: shots.path_record(),
        device: scene.device(),
    })?;
    target(Replace::from_flag(args.force)).prepare()?;
    if args.force {
        parts::clear(&args.out, "render")?;
    }
    let key = key(&builder.record, &outputs)?;
    let mut parts = Parts::open(&args.out, "render", &key, shard)?;
    parts.clear_temporaries(&shard_files(args, shard, &shots))?;

    for warning in &builder.record.warnings {
        reporter.warning(warning);
    }
    let job = Job {
        args,
        scene: scene.as_ref(),
        integrator,
        light,
        denoiser: denoiser.as_ref(),
        display,
    };
    if !job.render(&shots, shard, &mut parts, (&mut builder, &mut reporter))? {
        reporter.finish();
        reporter.note("stopped: the same command goes on from here");
        return Ok(interrupt::exit_code());
    }
    reporter.finish();
    if shard != Shard::WHOLE {
        parts.complete()?;
        reporter.note(&format!("{}: part {shard}", args.out.display()));
        reporter.message(&serde_json::json!({
            "message": "done",
            "complete": false,
            "path": args.out.join(parts::file_name(shard)),
        }))?;
        return Ok(ExitCode::SUCCESS);
    }
    shots.write_cameras(&args.out, &dataset)?;
    let record = &mut builder.record;
    record.seed = Some(light.seed);
    record.device = Some(scene.device());
    record.split = shots.split.clone();
    record.outputs = outputs
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    builder.write(&args.out)?;
    parts.close()?;
    let total = shots.list.len();
    reporter.note(&format!("{}: {total} views", args.out.display()));
    if let Some(command) = shots.video_command(&args.out) {
        reporter.note(&format!("as a video: {command}"));
    }
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": args.out.join(FILE_NAME),
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// Finds out whether the files of the shard may be written. Those that unfinished work on this result has left may, but it has to be of
/// this result: that is found out when it is opened.
fn check<'a>(
    args: &RenderArgs,
    shard: Shard,
    shots: &Shots,
    outputs: &[PathBuf],
    target: impl Fn(Replace) -> Target<'a>,
) -> Result<()> {
    if args.force {
        return target(Replace::Allow).check(outputs);
    }
    target(Replace::Continue).check(outputs)?;
    let left = parts::shards(&args.out)?;
    // What is of another division is refused by its own name.
    if left
        .iter()
        .any(|part| *part == shard || part.of != shard.of)
    {
        return Ok(());
    }
    target(Replace::Refuse).check(&shard_files(args, shard, shots))
}

/// The files of all views of a shard, relative to the folder of the result.
fn shard_files(args: &RenderArgs, shard: Shard, shots: &Shots) -> Vec<PathBuf> {
    let shots = shots.of_shard(shard);
    shots.flat_map(|(_, shot)| files(args, shot)).collect()
}

/// Digest of everything that decides the result: not where the inputs are, but what is in them.
fn key(record: &Record, outputs: &[PathBuf]) -> Result<String> {
    let mut options = record.options.clone();
    if let Some(options) = options.as_object_mut() {
        options.retain(|name, _| name != "scene" && name != "cameras");
    }
    let inputs: Vec<&str> = record.inputs.iter().map(|i| i.blake3.as_str()).collect();
    let decides = serde_json::to_vec(&(&record.version, options, inputs, outputs))?;
    Ok(blake3::hash(&decides).to_hex().to_string())
}

/// What all views have in common.
struct Job<'a> {
    args: &'a RenderArgs,
    scene: &'a dyn Tracer,
    integrator: Integrator,
    light: LightOptions,
    denoiser: Option<&'a Denoiser>,
    display: Display,
}

impl Job<'_> {
    /// Renders the views of the shard that are not done; `false` if it was stopped.
    fn render(
        &self,
        shots: &Shots,
        shard: Shard,
        parts: &mut Parts,
        (builder, reporter): (&mut RecordBuilder, &mut Reporter),
    ) -> Result<bool> {
        let stop = interrupt::stop_flag()?;
        let total = shots.of_shard(shard).count() as u64;
        let mut denoising = 0.0;
        reporter.begin("rendering", "views", 0, total);
        for (done, (index, shot)) in (1..).zip(shots.of_shard(shard)) {
            if let Some(item) = parts.done(&shot.name) {
                builder.took(&format!("views/{}", shot.name), item.seconds);
                reporter.advance(done, || shot.name.clone());
                continue;
            }
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let started = Instant::now();
            let camera = shot.camera.magnified(self.args.antialias);
            let light = shots.light(&self.light, index);
            let rays = self.scene.render(&camera, &self.integrator, &light)?;
            let mut rendered = rays.averaged(self.args.antialias);
            if let Some(denoiser) = self.denoiser {
                let started = Instant::now();
                rendered.radiance =
                    denoise::denoised(self.args, denoiser, &camera, &rays, &rendered)?;
                denoising += started.elapsed().as_secs_f64();
            }
            write_view(self.args, &self.display, shot, &rendered)?;
            let seconds = started.elapsed().as_secs_f64();
            parts.add(&shot.name, seconds, &files(self.args, shot))?;
            builder.took(&format!("views/{}", shot.name), seconds);
            reporter.advance(done, || shot.name.clone());
            reporter.message(&serde_json::json!({
                "message": "view",
                "view": shot.name,
                "done": done,
                "total": total,
                "seconds": seconds,
            }))?;
        }
        if self.denoiser.is_some() {
            builder.took("denoising", denoising);
        }
        Ok(true)
    }
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
        hits: match args.hits {
            HitsArg::Blended => Hits::Blended,
            HitsArg::Sampled => Hits::Sampled,
        },
    }
}

/// Everything that will be written, relative to the output folder.
fn planned(args: &RenderArgs, shots: &Shots) -> Vec<PathBuf> {
    let shown = shots.list.iter().flat_map(|shot| files(args, shot));
    let cameras = shots.path.as_ref().map(|_| TRANSFORMS_FILE.into());
    shown.chain(cameras).collect()
}

/// The files of one picture.
fn files(args: &RenderArgs, shot: &Shot) -> Vec<PathBuf> {
    let mut files = Vec::new();
    if writes_exr(args) {
        files.push(exr_name(&shot.name));
    }
    files.push(png_name(&shot.name));
    for aov in &args.aov {
        let dir = Path::new(aov.name());
        files.push(dir.join(exr_name(&shot.name)));
        if aov.has_picture() {
            files.push(dir.join(png_name(&shot.name)));
        }
    }
    files
}

/// Views of a dataset are data, to be measured; frames of a path are pictures, unless more is asked for.
fn writes_exr(args: &RenderArgs) -> bool {
    args.path.exr || args.path.camera_path.is_none()
}

// Not `Path::with_extension`: that would take the ".5" off a view called "a.5".
fn exr_name(view: &str) -> PathBuf {
    format!("{view}.exr").into()
}

fn png_name(view: &str) -> PathBuf {
    format!("{view}.png").into()
}

fn write_view(
    args: &RenderArgs,
    display: &Display,
    shot: &Shot,
    rendered: &RenderedView,
) -> Result<()> {
    let name = &shot.name;
    let picture = &rendered.radiance;
    if writes_exr(args) {
        let path = output::place(&args.out, &exr_name(name))?;
        exr::write_rgb(&path, picture, precision(picture))?;
    }
    let path = output::place(&args.out, &png_name(name))?;
    png::write_srgb8(&path, &display.shown(picture))?;
    for aov in &args.aov {
        let dir = args.out.join(aov.name());
        let exr_path = output::place(&dir, &exr_name(name))?;
        let png_path = output::place(&dir, &png_name(name))?;
        aov.write(&shot.camera, &rendered.sums, &exr_path, &png_path)?;
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
