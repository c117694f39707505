//! `eagpt train`: from a dataset to a scene.

mod held_out;
mod recorded;
mod told;
mod viewing;

use crate::args::GlobalArgs;
use crate::device::DeviceArgs;
use crate::interrupt;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::RecordBuilder;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_train::job::{BadViews, Existing};
use eagpt_train::options::{OptionArgs, StageChoice};
use eagpt_train::{OwnLight, TrainOptions, TrainProgress, TrainRequest, TrainSummary};
use held_out::HeldOut;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use told::tell;
use viewing::Viewing;

/// Train a scene of 2D Gaussians on a dataset
///
/// Stage 0 (radiance) fits geometry, radiance and emission to the training views; stage 1 (albedo)
/// then fits the diffuse albedo through one bounce of light.
///
/// The dataset is a folder with transforms.json (EAG-PT or nerfstudio keys), linear EXR images,
/// optional masks, normals and opacities, and points3d.ply to start from. Without that, training
/// starts from points where the views agree, or whose depth they tell.
///
/// Several datasets are one place in several lights, in one world: with the same poses or others,
/// and as many views as each has. All of them train one geometry and one albedo; radiance and lamps
/// are each light's own. One exposure scale holds for all. They are named like their folders.
///
/// Options come in layers, later ones winning: the preset, the file of --config, the flags, each
/// --set. --dump-config prints the outcome.
///
/// Ctrl-C ends a run after the current iteration with a checkpoint (exit code 130); a second one
/// ends it at once.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLES)]
pub(crate) struct TrainArgs {
    /// Folder with a transforms.json, or that file
    #[arg(value_name = "DATASET", required_unless_present = "dump_config")]
    pub(crate) dataset: Option<PathBuf>,
    /// Datasets of the same place in other lights: one geometry and one albedo explain all of them
    #[arg(value_name = "OTHER_LIGHT")]
    pub(crate) other_lights: Vec<PathBuf>,
    /// Train without one of these lights, by the name of its folder, and report how the trained
    /// scene shows it with its lamps switched: in RUN/relit/NAME.ply, against the test views
    #[arg(long, value_name = "NAME", requires = "other_lights")]
    test_condition: Option<String>,
    /// Factors of lamps in the light of --test-condition, as `[lights]` and `NAME = { "ceiling-*" =
    /// 1.0, shade-1 = [1, 0.8, 0.6] }`; others are off [default: fitted to the three of its views
    /// that tell most of the lamps]
    #[arg(long, value_name = "LIGHTS.toml", requires = "test_condition")]
    lights: Option<PathBuf>,
    /// Folder for results; created
    #[arg(long, value_name = "RUN", required_unless_present = "dump_config")]
    pub(crate) out: Option<PathBuf>,
    /// Scene to start from instead of the points of the dataset: of an earlier run, or of `eagpt
    /// import`; with --stage albedo its radiance and geometry stay as they are
    #[arg(long, value_name = "SCENE.ply")]
    pub(crate) start: Option<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    options: OptionArgs,
    /// Resume the run in RUN from its newest checkpoint, bit-identical to a run without the break
    ///
    /// Bit-identical on the same device; on another the result differs by rounding.
    ///
    /// Its options are taken from RUN/train.toml unless --preset or --config is given.
    #[arg(long, conflicts_with = "force")]
    pub(crate) resume: bool,
    /// Start over where RUN holds an earlier run, whose files are removed
    #[arg(long)]
    pub(crate) force: bool,
    /// Train without views that cannot be read, and say so, instead of stopping
    #[arg(long)]
    skip_bad: bool,
    /// Memory that images may take, MiB [default: half of what is free]
    #[arg(long, value_name = "MIB", value_parser = clap::value_parser!(u64).range(1..))]
    memory: Option<u64>,
    /// Folder whose Emissive-exr/ holds the emission masks, as `eagpt masks --out` writes it; of
    /// several lights, folder that holds such a one of each light's name [default: those of the
    /// datasets]
    #[arg(long, value_name = "DIR")]
    pub(crate) masks: Option<PathBuf>,
    /// Folder whose Normal-exr/ holds the normals, as `eagpt normals --out` writes it; of several
    /// lights as with --masks [default: those of the datasets]
    #[arg(long, value_name = "DIR")]
    pub(crate) normals: Option<PathBuf>,
    #[command(flatten)]
    #[serde(flatten)]
    device: DeviceArgs,
    /// Show the scene on a page in a browser of this machine while it trains, with the curve of the
    /// loss; the address is printed. Nothing can be changed there
    #[arg(long)]
    #[serde(skip)]
    view: bool,
    /// Port of that page, 0 to 65535; 0 is any that is free
    #[arg(long, value_name = "PORT", default_value_t = 0, requires = "view")]
    #[serde(skip)]
    view_port: u16,
    /// Print the effective options as TOML and stop
    #[arg(long)]
    dump_config: bool,
}

/// Name of the options file that a run leaves in its folder.
const RUN_OPTIONS: &str = "train.toml";

const OUTPUTS_AND_EXAMPLES: &str = "Files in RUN:
  scene.ply      the scene: 17 activated float32 properties a Gaussian, 24 more with
                 harmonics, 4 more with gloss
  lights/NAME/   the scene and its lamps in each light but the first, whose are beside this
  relit/         the scene as it is in the light of --test-condition, with its lamps
  all-lamps/     of several lights, the scene with the lamps of all of them on, to be baked
  train.toml     the effective options
  log.jsonl      loss curves, one JSON object a line
  previews/      photographs and renderings of a few views, side by side
  checkpoints/   the full state; a run continues from the newest
  record.json    version, options, seed, inputs, times, memory; how the scene in its own light,
                 all bounces of it, compares with the photographs

Examples:
  eagpt train kitchen --out runs/kitchen
  eagpt train kitchen --out runs/quick --preset draft --gaussians 20000 --seed 3
  eagpt train kitchen --out runs/rates --config base.toml --set radiance.rates.position=5e-5
  eagpt train kitchen --out runs/kitchen --resume
  eagpt train room/day room/evening --out runs/room
  eagpt train room/day room/evening room/lamps --test-condition evening --out runs/two
  eagpt train kitchen --start imported.ply --out runs/kitchen
  eagpt train kitchen --out runs/kitchen --device gpu:4090
  eagpt train --preset paper --dump-config > paper.toml";

impl TrainArgs {
    /// The effective options.
    pub(crate) fn options(&self) -> Result<TrainOptions> {
        let run = self.out.as_ref().filter(|_| self.resume);
        let earlier = run.map(|run| run.join(RUN_OPTIONS));
        let earlier = earlier.filter(|path| path.is_file());
        Ok(self.options.resolve(earlier.as_deref())?)
    }
}

pub(crate) fn run(args: &TrainArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = args.options()?;
    if args.dump_config {
        terminal::print(&toml::to_string(&options)?)?;
        return Ok(ExitCode::SUCCESS);
    }
    // clap asks for both unless --dump-config is given.
    let mut datasets: Vec<PathBuf> = args
        .dataset
        .iter()
        .chain(&args.other_lights)
        .cloned()
        .collect();
    let held_out = HeldOut::take(args, &mut datasets)?;
    let mut datasets = datasets.into_iter();
    let dataset = datasets.next().unwrap_or_default();
    let out = args.out.clone().unwrap_or_default();
    let mut reporter = Reporter::new(global);
    let device = args.device.open(&mut reporter)?;
    let request = TrainRequest {
        dataset,
        other_lights: datasets.collect(),
        masks: args.masks.clone(),
        normals: args.normals.clone(),
        start: args.start.clone(),
        out,
        options,
        existing: match (args.resume, args.force) {
            (true, _) => Existing::Resume,
            (_, true) => Existing::Overwrite,
            _ => Existing::Refuse,
        },
        bad_views: if args.skip_bad {
            BadViews::Skip
        } else {
            BadViews::Refuse
        },
        image_budget: args
            .memory
            .map(|mib| usize::try_from(mib.saturating_mul(1 << 20)).unwrap_or(usize::MAX)),
        device,
        is_watched: args.view,
        stop: interrupt::stop_flag()?,
    };
    check_target(&request)?;
    let mut builder = RecordBuilder::begin("train", &request.options, global)?;
    let summary = trained(&request, args, &mut reporter)?;
    recorded::fill(&mut builder, &request, &summary)?;
    if let (Some(held_out), Some(_)) = (held_out, &summary.scene)
        && let Some(relit) = held_out.relit(&request, &mut reporter)?
    {
        builder.measured("test_condition", &relit)?;
    }
    let record = builder.write(&request.out)?;
    let path = summary.scene.as_ref().unwrap_or(&record);
    reporter.message(&serde_json::json!({
        "message": "done",
        "complete": summary.scene.is_some(),
        "path": path,
        "num_gaussians": summary.num_gaussians,
    }))?;
    if summary.scene.is_none() {
        reporter.note(&format!(
            "stopped: --resume continues the run in {}",
            request.out.display()
        ));
        return Ok(interrupt::exit_code());
    }
    reporter.note(&format!(
        "{}: {} Gaussians",
        path.display(),
        summary.num_gaussians
    ));
    if request.options.stage != StageChoice::Radiance {
        reporter.note(&own_light(&request, &summary));
    }
    Ok(ExitCode::SUCCESS)
}

/// Trains, and shows how far it is.
fn trained(
    request: &TrainRequest,
    args: &TrainArgs,
    reporter: &mut Reporter,
) -> Result<TrainSummary> {
    let viewing = args.view.then(|| Viewing::new(request, args.view_port));
    let mut viewing = viewing.transpose()?;
    let watched = |reporter: &mut Reporter, message: &TrainProgress| {
        if let Some(viewing) = &mut viewing {
            viewing.take(reporter, message)?;
        }
        tell(reporter, message)
    };
    let outcome = reporter.follow(watched, |progress| eagpt_train::train(request, progress));
    if let Some(viewing) = viewing {
        let how = match &outcome {
            Ok(summary) if summary.scene.is_some() => "The training has ended.".to_owned(),
            Ok(_) => "The training was stopped; --resume continues it.".to_owned(),
            Err(error) => format!("The training has failed: {error:#}"),
        };
        viewing.end(&how, reporter);
    }
    outcome
}

/// One line on the light of the scene against the photographs.
fn own_light(request: &TrainRequest, summary: &TrainSummary) -> String {
    let Some(found) = &summary.own_light else {
        return match request.stop.load(Ordering::Relaxed) {
            true => "own light: stopped; --resume compares it".to_owned(),
            false => "own light: not compared, nothing emits".to_owned(),
        };
    };
    format!("own light: {} training views", compared(found))
}

/// How renderings compare with photographs, and over how many of them.
fn compared(found: &OwnLight) -> String {
    let factor = found.exposure_scale;
    let factor = factor.map_or(String::new(), |factor| format!(", factor {factor:.2}"));
    format!(
        "{:.1} dB{factor} over {}",
        found.psnr_srgb_db, found.num_views
    )
}

/// Refuses a folder with results of other commands, or with a scene that no run left there. Earlier
/// runs are the job's to judge.
fn check_target(request: &TrainRequest) -> Result<()> {
    let continues = request.options.stage == StageChoice::Albedo && request.start.is_none();
    let goes_on = request.existing != Existing::Refuse || continues;
    let is_run = ["log.jsonl", "checkpoints"]
        .iter()
        .any(|name| request.out.join(name).exists());
    let inputs = request.start.as_slice();
    let target = Target::new(&request.out, "train", inputs, goes_on || is_run);
    target.check(&["scene.ply".into()])
}
