//! `eagpt masks`: which pixels of a dataset's photographs show a light.

use crate::args::GlobalArgs;
use crate::command_line;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use anyhow::{Result, bail};
use clap::Args;
use eagpt_masks::{
    Border, CheckOptions, Inconsistent, MaskOptions, MaskProgress, MaskRequest, MaskSource,
    MaskSummary, Rule, ViewVerdict, make_masks, planned_files,
};
use eagpt_scene::Dataset;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Find out which pixels of photographs show a light
///
/// A mask is every pixel at or above a threshold of linear radiance, found in all views together or
/// given, and what label images mark, less what other label images mark as reflections. Where the
/// dataset has depths, or a trained scene gives them, masks are compared between views: a
/// reflection moves over its surface, a lamp does not.
///
/// Writes Emissive-exr/<view>.exr (1 where there is a light, 0 elsewhere) and into masks/ overlays
/// to look at, table.md, views.csv and report.json. A view of which nothing is known, without
/// threshold or label, gets no mask: that is not an empty one.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct MasksArgs {
    /// Dataset: a folder with a transforms.json, or that file
    #[arg(value_name = "DATASET")]
    pub(crate) dataset: PathBuf,
    /// Folder to write to [default: that of the dataset, where training looks for masks]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Threshold of linear radiance above 0; `auto` finds the gap between lit surfaces and lights
    /// in all views together, `none` takes labels alone
    #[arg(long, value_name = "RADIANCE|auto|none", default_value = "auto", value_parser = threshold)]
    #[serde(serialize_with = "command_line::text")]
    threshold: MaskSource,
    /// Value of a pixel that is compared with the threshold
    #[arg(long, value_enum, default_value = "any")]
    rule: Rule,
    /// Pixels at the border of a light, which show it in part, belong to it
    #[arg(long, value_enum, default_value = "half")]
    border: Border,
    /// Dataset of the same place in a light in which lamps of this one are off; may be repeated.
    /// The threshold applies to the light that is here and not in the darkest of those, pixel by
    /// pixel: views need the camera of one of theirs, others get no mask. A lamp that shines as
    /// much in all of them is not found
    #[arg(long, value_name = "DATASET", conflicts_with = "from_scene")]
    off: Vec<PathBuf>,
    /// Folder of label images of lights, <view>.png of any size; what is neither black nor
    /// transparent is marked. Views may be missing
    #[arg(long, value_name = "DIR")]
    labels: Option<PathBuf>,
    /// Folder of label images of what is no light, as bright reflections; subtracted last
    #[arg(long, value_name = "DIR")]
    subtract: Option<PathBuf>,
    /// Close gaps up to twice as wide, pixels, 0 to 255
    #[arg(long, value_name = "PIXELS", default_value_t = 0)]
    close: u8,
    /// Drop connected regions of fewer pixels, before growing, unless one is ten times the
    /// threshold: 0 and 1 drop none
    #[arg(long, value_name = "N", default_value_t = 4)]
    min_pixels: u32,
    /// Grow regions, pixels, 0 to 255
    #[arg(long, value_name = "PIXELS", default_value_t = 0)]
    grow: u8,
    /// Treatment of regions that other views do not confirm
    #[arg(long, value_enum, default_value = "keep")]
    inconsistent: Inconsistent,
    /// Least share, 0 to 1, of the places where other views see a region's surface that they have
    /// to mask as well
    #[arg(long, value_name = "SHARE", default_value_t = 0.5)]
    min_support: f32,
    /// Trained scene that gives depths for the comparison, where the dataset has none
    #[arg(long, value_name = "SCENE.ply", conflicts_with = "from_scene")]
    scene: Option<PathBuf>,
    /// Trained scene to take masks from, in place of a threshold: pixels whose blended emission is
    /// at least --emission
    #[arg(long, value_name = "SCENE.ply", conflicts_with = "threshold")]
    from_scene: Option<PathBuf>,
    /// Least emission of a pixel with --from-scene, above 0 and at most 1
    #[arg(long, value_name = "E", default_value_t = 0.5, requires = "from_scene")]
    emission: f32,
    /// Replace an earlier result of this command, and masks that are there
    #[arg(long)]
    pub(crate) force: bool,
}

const EXAMPLES: &str = "Examples:
  eagpt masks kitchen
  eagpt masks kitchen --threshold 1.5 --rule any --border full      (the rule of EAG-PT)
  eagpt masks kitchen --labels sam/lamps --subtract sam/mirrors --scene runs/kitchen/scene.ply --inconsistent drop
  eagpt masks room/evening --off room/day      (lamps that are on in the evening alone)
  eagpt masks kitchen --threshold none --labels by-hand --out masks-by-hand";

fn threshold(text: &str) -> Result<MaskSource, String> {
    match text {
        "auto" => Ok(MaskSource::Auto),
        "none" => Ok(MaskSource::None),
        number => match number.parse::<f32>() {
            Ok(level) if level > 0.0 && level.is_finite() => Ok(MaskSource::Level(level)),
            _ => Err("neither a radiance above 0 nor `auto` nor `none`".to_owned()),
        },
    }
}

/// Options that decide the result, for the record.
#[derive(Serialize)]
struct Recorded<'a> {
    dataset: &'a Path,
    #[serde(skip_serializing_if = "<[PathBuf]>::is_empty")]
    off: &'a [PathBuf],
    labels: Option<&'a Path>,
    subtract: Option<&'a Path>,
    scene: Option<&'a Path>,
    #[serde(flatten)]
    options: &'a MaskOptions,
    /// The threshold that was used or found.
    level: Option<f32>,
}

pub(crate) fn run(args: &MasksArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = options(args);
    options.validate()?;
    if options.source == MaskSource::None && args.labels.is_none() {
        bail!("--threshold none: without --labels there is nothing to make masks of");
    }
    let mut builder = RecordBuilder::begin("masks", &options, global)?;
    let dataset = Dataset::open(&args.dataset)?;
    let out = args.out.clone();
    let out = out.unwrap_or_else(|| dataset.root().to_owned());
    let scene = args.from_scene.as_ref().or(args.scene.as_ref());
    let inputs = inputs(&dataset, scene);
    let target = Target {
        record: RECORD,
        ..Target::new(&out, "masks", &inputs, args.force)
    };
    target.check(&planned_files(&dataset))?;
    target.prepare()?;
    let off = args.off.iter().map(|path| Dataset::open(path));
    let request = MaskRequest {
        dataset: &dataset,
        off: off.collect::<Result<_, _>>()?,
        out,
        options,
        labels: args.labels.clone(),
        reflections: args.subtract.clone(),
        scene: scene.cloned(),
    };
    let mut reporter = Reporter::new(global);
    let summary = reporter.follow(tell, |progress| make_masks(&request, progress))?;
    builder.set_options(&Recorded {
        dataset: &args.dataset,
        off: &args.off,
        labels: args.labels.as_deref(),
        subtract: args.subtract.as_deref(),
        scene: scene.map(PathBuf::as_path),
        options: &request.options,
        level: summary.report.threshold,
    })?;
    let record = &mut builder.record;
    for dataset in std::iter::once(&dataset).chain(&request.off) {
        record.inputs.push(Input::of_cameras(dataset)?);
    }
    if let Some(scene) = scene {
        record.inputs.push(Input::of(scene)?);
    }
    record.warnings.clone_from(&summary.warnings);
    builder.wrote(&summary.outputs);
    builder.write_to(&request.out.join(RECORD))?;
    close(&reporter, &request, &summary)?;
    Ok(ExitCode::SUCCESS)
}

/// The record in the dataset's own folder, which other commands may have records in.
const RECORD: &str = "masks.record.json";

fn options(args: &MasksArgs) -> MaskOptions {
    MaskOptions {
        source: match &args.from_scene {
            Some(_) => MaskSource::Emission(args.emission),
            None => args.threshold,
        },
        rule: args.rule,
        border: args.border,
        closing_radius: args.close,
        min_pixels: args.min_pixels,
        grow_radius: args.grow,
        check: CheckOptions {
            inconsistent: args.inconsistent,
            min_support: args.min_support,
        },
    }
}

/// Files that masks must not replace: those of the dataset but its masks, and the scene.
fn inputs(dataset: &Dataset, scene: Option<&PathBuf>) -> Vec<PathBuf> {
    let masks: Vec<&PathBuf> = dataset
        .frames()
        .iter()
        .filter_map(|frame| frame.files.emission.as_ref())
        .collect();
    let mut files = dataset.files();
    files.retain(|file| !masks.contains(&file));
    files.extend(scene.cloned());
    files
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &MaskProgress) -> Result<()> {
    let (name, done, total) = match message {
        MaskProgress::Measuring { done, total } => ("measuring", *done, *total),
        MaskProgress::Masking { done, total } => ("masking", *done, *total),
        MaskProgress::Drawing { done, total } => ("drawing", *done, *total),
        MaskProgress::Level(level) => {
            reporter.note(&format!(
                "threshold {:.3} linear radiance, between surfaces up to {:.3} and lights from {:.3}; {:.2} % of all pixels",
                level.level,
                level.valley_from,
                level.valley_to,
                100.0 * level.share
            ));
            return reporter.message(message);
        }
        MaskProgress::Warning { text } => {
            reporter.warning(text);
            return reporter.message(message);
        }
    };
    reporter.count((name, "views"), (done, total), message)
}

/// Reports the outcome.
fn close(reporter: &Reporter, request: &MaskRequest<'_>, summary: &MaskSummary) -> Result<()> {
    let report = &summary.report;
    let with = |verdict: ViewVerdict| report.num_with(verdict);
    let dropped = report.regions.iter().filter(|region| region.dropped);
    reporter.note(&format!(
        "{}: {} views: {} good, {} without light, {} without mask, {} inconsistent, {} incomplete; {} regions dropped",
        request.out.display(),
        report.views.len(),
        with(ViewVerdict::Good),
        with(ViewVerdict::Empty),
        with(ViewVerdict::Unknown),
        with(ViewVerdict::Inconsistent),
        with(ViewVerdict::Incomplete),
        dropped.count(),
    ));
    reporter.message(&serde_json::json!({
        "message": "done",
        "path": request.out,
        "threshold": report.threshold,
        "mean_coverage": report.mean_coverage(),
        "num_views": report.views.len(),
        "num_inconsistent": with(ViewVerdict::Inconsistent),
        "num_incomplete": with(ViewVerdict::Incomplete),
    }))
}
