//! `eagpt bake`: radiance that fits the light after an edit.

use crate::args::{self, GlobalArgs};
use crate::command_line;
use crate::device::DeviceArgs;
use crate::interrupt;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder, SplitRecord};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use eagpt_scene::dataset::{SplitRule, Subset};
use eagpt_scene::lamps::lamps_file_beside;
use eagpt_scene::light_basis::lights_file_beside;
use eagpt_scene::{Dataset, Shard};
use eagpt_trace::transport::{MAX_BOUNCES, ROULETTE_FROM, Sampling};
use eagpt_train::bake::gaussians::GaussianBake;
use eagpt_train::bake::views::ViewBake;
use eagpt_train::bake::{BakeMethod, BakeOptions, BakeProgress, BakeRequest, BakeSummary, bake};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Bake the light of an edited scene into its Gaussians
///
/// Emitters keep their radiance; everything else gets the radiance that it reflects now. The
/// result shows at once with `eagpt render --mode 0-bounce`, or finer with a last bounce for each
/// pixel, --mode 1-bounce.
///
/// Method `gaussians` solves the light in Gaussian space, from rays that are traced once for all
/// bounces: no image is made. What glossy surfaces mirror towards the cameras is kept by harmonics:
/// wide highlights rather than sharp images. Method `views` is the paper's: it path-traces the
/// views of the dataset and fits radiance to them.
///
/// Work is kept in a folder beside the result; the same command resumes a bake that was stopped,
/// bit-identical on the same device; another device resumes it as well, and ends elsewhere by
/// rounding.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct BakeArgs {
    /// Scene whose light to bake, as `eagpt edit` writes it
    #[arg(value_name = "EDITED.ply")]
    pub(crate) scene: PathBuf,
    /// Dataset whose cameras count: a folder with a transforms.json, or that file
    #[arg(long, value_name = "DATASET")]
    pub(crate) cameras: PathBuf,
    /// Views to bake for
    #[arg(long, value_name = "SUBSET", default_value = "train", value_enum)]
    split: Subset,
    /// Rule that divides the views into training and test views
    #[arg(long, value_name = "RULE", default_value = "every-8th", value_enum)]
    split_rule: SplitRule,
    /// Scene to write
    #[arg(long, value_name = "BAKED.ply")]
    pub(crate) out: PathBuf,
    /// Method of baking
    #[arg(long, value_enum, default_value = "gaussians")]
    pub(crate) method: MethodArg,
    /// Maximum path depth: bounces of light, at least 1
    #[arg(long, value_name = "N", default_value_t = MAX_BOUNCES, value_parser = clap::value_parser!(u32).range(1..))]
    bounces: u32,
    /// gaussians: directions traced at each Gaussian, at least 1; half of them are light samples,
    /// the others serve all bounces, and where something is brightly lit a quarter as many more go
    /// there [default: 64; 32 in scenes of over 125,000 Gaussians, whose pictures are means over
    /// more of them, 16 in those of over 250,000; twice that with --per-light]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) samples: Option<u32>,
    /// views: samples per pixel, at least 1
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..))]
    spp: u32,
    /// views: end paths at random from this bounce on, at least 1 and on a GPU at least 3; 0 for
    /// never
    #[arg(long, value_name = "FROM_BOUNCE", default_value_t = ROULETTE_FROM)]
    russian_roulette: u32,
    /// views: iterations of the fit, one view each, at least 1
    #[arg(long, value_name = "N", default_value_t = 3000, value_parser = clap::value_parser!(u32).range(1..))]
    iterations: u32,
    /// views: trace only part I of N of the views, 1 to N, into --work; the same command without it
    /// then combines the parts. gaussians has no parts: its light-transport matrix is one
    #[arg(long, value_name = "I/N")]
    #[serde(serialize_with = "command_line::optional_text")]
    pub(crate) shard: Option<Shard>,
    /// Seed of the random numbers, 0 to 2^63 − 1
    #[arg(long, value_name = "S", default_value_t = 0, value_parser = args::seed())]
    seed: u64,
    #[command(flatten)]
    #[serde(flatten)]
    device: DeviceArgs,
    /// Folder for work under way; that of `gaussians` is removed at the end [default: BAKED.work
    /// beside BAKED.ply]
    #[arg(long, value_name = "DIR")]
    work: Option<PathBuf>,
    /// gaussians: sparse light-transport matrix kept between bakes. While the geometry, cameras,
    /// --samples and --seed are the same, other light of the same lamps and other albedos cost no
    /// ray but those of highlights and, --per-light, of what lamps reflect; else all rays are
    /// traced anew. Takes the place of --work
    #[arg(long, value_name = "FILE")]
    transport: Option<PathBuf>,
    /// gaussians: also write BAKED.lights, what each Gaussian reflects of each lamp. Any powers and
    /// colours of the lamps are then a sum: `set_light` of `eagpt edit`, --set-light of `eagpt
    /// render`. Light samples are shared out so that weak lamps beside strong ones get enough of
    /// them. Takes 60 bytes of memory for each Gaussian and lamp, 6 in the file; of a
    /// glossy one 48 more
    #[arg(long)]
    per_light: bool,
    /// --per-light: lamps of the scene; whatever else emits is one more light, `rest` [default:
    /// lamps.json in its folder]
    #[arg(long, value_name = "LAMPS.json", requires = "per_light")]
    lamps: Option<PathBuf>,
    /// Replace an earlier result of this command, and the work of another bake
    #[arg(long)]
    pub(crate) force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt bake edits/ball.ply --cameras kitchen --out bakes/ball.ply
  eagpt bake edits/ball.ply --cameras kitchen --out bakes/ball.ply --device gpu
  eagpt bake edits/ball.ply --cameras kitchen --out bakes/ball.ply --transport kitchen.transport   (again after each edit of light or albedo, faster)
  eagpt render bakes/ball.ply --cameras kitchen --mode 0-bounce --out renders/baked
  eagpt bake runs/kitchen/scene.ply --cameras kitchen --out bakes/lamps.ply --per-light
  eagpt bake edits/ball.ply --cameras kitchen --out bakes/views.ply --method views --shard 1/4   (and 2/4 … on other machines)
  eagpt bake edits/ball.ply --cameras kitchen --out bakes/views.ply --method views";

/// Adam's step size in the fit of `views`: twice that of stage 0, whose radiance also follows
/// moving Gaussians.
const FIT_RATE: f32 = 0.02;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum MethodArg {
    /// In Gaussian space, from rays traced once for all bounces
    Gaussians,
    /// By path-traced views and a fit, as in the paper
    Views,
}

/// Options that decide the result, for the record.
#[derive(Serialize)]
struct Recorded<'a> {
    scene: &'a Path,
    cameras: &'a Path,
    #[serde(flatten)]
    options: BakeOptions,
    /// Rays traced by this process, those of cameras and of highlights left out.
    num_rays: u64,
}

pub(crate) fn run(args: &BakeArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = options(args);
    if args.shard.is_some() && args.method == MethodArg::Gaussians {
        bail!("--shard: only --method views has parts");
    }
    if args.transport.is_some() && args.method == MethodArg::Views {
        bail!("--transport: only --method gaussians has a transport matrix");
    }
    if args.per_light && args.method == MethodArg::Views {
        bail!("--per-light: only --method gaussians solves the light of each lamp");
    }
    let dataset = Dataset::open(&args.cameras)?;
    let beside = || lamps_file_beside(&args.scene);
    let lamps = (args.per_light).then(|| args.lamps.clone().unwrap_or_else(beside));
    let mut inputs = dataset.files();
    inputs.push(args.scene.clone());
    inputs.extend(args.transport.clone());
    inputs.extend(lamps.clone());
    let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
    let replace = Replace::from_flag(args.force);
    let lights = lights_file_beside(&args.out);
    output::check_file(&args.out, "bake", &inputs, replace)?;
    output::check_part(&lights, &inputs, replace)?;
    output::create_parent(&args.out)?;
    let mut reporter = Reporter::new(global);
    let device = args.device.open(&mut reporter)?;
    let request = BakeRequest {
        scene: args.scene.clone(),
        cameras: args.cameras.clone(),
        out: args.out.clone(),
        work: args
            .work
            .clone()
            .unwrap_or_else(|| args.out.with_extension("work")),
        transport: args.transport.clone(),
        per_light: lamps.clone(),
        options,
        device,
        start_over: args.force,
        stop: interrupt::stop_flag()?,
    };
    let mut builder = RecordBuilder::begin("bake", &options, global)?;
    let transport = args.transport.as_ref().filter(|path| path.exists());
    let transport = transport.map(|path| Input::of(path)).transpose()?;
    let mut warnings = Vec::new();
    let listen = |reporter: &mut Reporter, message: &BakeProgress| {
        if let BakeProgress::Warning { text } = message {
            warnings.push(text.clone());
        }
        tell(reporter, message)
    };
    let summary = reporter.follow(listen, |progress| bake(&request, progress))?;
    let Some(scene) = &summary.scene else {
        return unfinished(args, &request, &summary, &reporter);
    };
    builder.set_options(&Recorded {
        scene: &args.scene,
        cameras: &args.cameras,
        options: summary.options,
        num_rays: summary.num_rays,
    })?;
    let record = &mut builder.record;
    record.inputs = vec![Input::of(&args.scene)?, Input::of_cameras(&dataset)?];
    record.inputs.extend(transport);
    if let Some(lamps) = &lamps {
        record.inputs.push(Input::of(lamps)?);
    }
    record.seed = Some(args.seed);
    record.device = Some(summary.device.clone());
    record.split = Some(SplitRecord::new(&summary.split, args.split));
    record.warnings = warnings;
    let lights = summary.num_lights.map(|num| (lights, num));
    let written = [Some(scene), lights.as_ref().map(|(path, _)| path)];
    let written = written.into_iter().flatten();
    builder.wrote(written.filter_map(|path| path.file_name()));
    let record_path = output::record_path(&args.out);
    builder.write_to(&record_path)?;
    reporter.note(&format!("{}: {} rays", scene.display(), summary.num_rays));
    if let Some((path, num)) = &lights {
        reporter.note(&format!("{}: {num} lights", path.display()));
    }
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": scene,
        "record": record_path,
        "num_rays": summary.num_rays,
    }))?;
    Ok(ExitCode::SUCCESS)
}

/// Default options of `eagpt bake`, with so many directions at each Gaussian, or the usual number.
pub(crate) fn usual_options(num_samples: Option<u32>) -> BakeOptions {
    BakeOptions {
        method: BakeMethod::Gaussians(GaussianBake { num_samples }),
        max_bounces: MAX_BOUNCES,
        seed: 0,
        split: SplitRule::default(),
        subset: Subset::Train,
    }
}

fn options(args: &BakeArgs) -> BakeOptions {
    let method = match args.method {
        MethodArg::Gaussians => BakeMethod::Gaussians(GaussianBake {
            num_samples: args.samples,
        }),
        MethodArg::Views => BakeMethod::Views(ViewBake {
            num_samples: args.spp,
            roulette_from: (args.russian_roulette > 0).then_some(args.russian_roulette),
            sampling: Sampling::NextEvent,
            iterations: args.iterations,
            rate: FIT_RATE,
            shard: args.shard.unwrap_or(Shard::WHOLE),
        }),
    };
    BakeOptions {
        method,
        max_bounces: args.bounces,
        seed: args.seed,
        split: args.split_rule,
        subset: args.split,
    }
}

/// Ends without a scene: a shard is done, or the bake was stopped.
fn unfinished(
    args: &BakeArgs,
    request: &BakeRequest,
    summary: &BakeSummary,
    reporter: &Reporter,
) -> Result<ExitCode> {
    let stopped = request.stop.load(std::sync::atomic::Ordering::Relaxed);
    reporter.message(&serde_json::json!({
        "message": "done",
        "complete": false,
        "path": args.transport.as_ref().unwrap_or(&request.work),
        "num_rays": summary.num_rays,
    }))?;
    let work = request.work.display();
    match args.shard {
        Some(Shard { index, of }) if !stopped => {
            reporter.note(&format!(
                "{work}: part {index} of {of}, {} rays",
                summary.num_rays
            ));
            Ok(ExitCode::SUCCESS)
        }
        _ => {
            let state = args.transport.as_ref().unwrap_or(&request.work).display();
            reporter.note(&format!("stopped: the same command continues from {state}"));
            Ok(interrupt::exit_code())
        }
    }
}

/// Shows a message of the job.
pub(crate) fn tell(reporter: &mut Reporter, message: &BakeProgress) -> Result<()> {
    let (steps, task) = match *message {
        BakeProgress::Looking { done, total } => ((done, total), ("looking for surfaces", "views")),
        BakeProgress::Gathering { done, total } => {
            ((done, total), ("gathering light", "Gaussians"))
        }
        BakeProgress::Rendering { done, total } => ((done, total), ("path tracing", "views")),
        BakeProgress::Fitting {
            iteration, total, ..
        } => (
            (iteration as usize, total as usize),
            ("fitting", "iterations"),
        ),
        BakeProgress::Bounced { bounce, share } => {
            reporter.note(&format!(
                "bounce {bounce}: {:.2} % of the reflected light",
                100.0 * share
            ));
            return reporter.message(message);
        }
        BakeProgress::Warning { ref text } => {
            reporter.warning(text);
            return reporter.message(message);
        }
    };
    let note = || match message {
        BakeProgress::Fitting { loss, .. } => format!("loss {loss:.4}"),
        _ => String::new(),
    };
    reporter.count_with(task, steps, note, message)
}
