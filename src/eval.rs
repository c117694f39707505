//! `eagpt eval`: how good renderings are.

mod pair;

use crate::cli::{self, GlobalArgs};
use crate::output::{Replace, Target};
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder, SplitRecord};
use crate::terminal;
use anyhow::{Result, bail};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use eagpt_eval::{EvalOptions, EvalProgress, Evaluation, FlipOptions, ToneMapper};
use eagpt_scene::Dataset;
use eagpt_scene::dataset::{SplitRule, Subset};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Measure renderings against the views of a dataset, or one image against another
///
/// Compares DIR/VIEW.exr with the radiance of each view and, where both are there, the albedo, normal, depth and emission in
/// DIR/albedo/VIEW.exr and so on with those of the dataset.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_long_help = OUTPUTS_AND_EXAMPLES
)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    pair: Option<EvalCommand>,
    /// Folder of renderings, as `eagpt render` writes it
    #[arg(value_name = "DIR", required = true)]
    renders: Option<PathBuf>,
    /// Dataset with the references: a folder with a transforms.json, or that file
    #[arg(long, value_name = "DATASET", required = true)]
    reference: Option<PathBuf>,
    /// Views to measure
    #[arg(long, value_name = "SUBSET", default_value = "test", value_parser = cli::subset())]
    split: Subset,
    /// Rule that divides the views into training and test views
    #[arg(long, value_name = "RULE", default_value = "every-8th", value_parser = cli::split_rule())]
    split_rule: SplitRule,
    /// Folder for results; created
    #[arg(long, value_name = "DIR2", required = true)]
    out: Option<PathBuf>,
    /// Replace an earlier evaluation in DIR2
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    flip: FlipArgs,
}

const OUTPUTS_AND_EXAMPLES: &str = "Files in DIR2:
  metrics.json        means, every view, definitions of the metrics
  metrics.csv         one line a view
  table.md, table.tex the same for people
  flip/VIEW.png       HDR-FLIP error, black 0 to white 1 (magma)
  record.json         version, options, inputs, times, memory

Examples:
  eagpt eval renders/0 --reference kitchen --split test --out eval/0
  eagpt eval pair photograph.exr rendering.exr --json";

#[derive(Debug, Subcommand)]
enum EvalCommand {
    Pair(pair::PairArgs),
}

/// Settings of FLIP.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "FLIP options")]
struct FlipArgs {
    /// Pixels per degree of vision, 1 to 10000
    #[arg(long, value_name = "PPD", default_value_t = FlipOptions::default().ppd)]
    ppd: f32,
    /// Tone curve of HDR-FLIP
    #[arg(long, value_name = "NAME", default_value = "aces", value_parser = tone_mapper())]
    tonemapper: ToneMapper,
    /// First exposure of HDR-FLIP, stops from −100 to 100 [default: from the reference]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    start_exposure: Option<f32>,
    /// Last exposure of HDR-FLIP, stops from −100 to 100 [default: from the reference]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    stop_exposure: Option<f32>,
    /// Number of exposures of HDR-FLIP, 1 to 1000 [default: from the reference]
    #[arg(long, value_name = "N")]
    num_exposures: Option<u32>,
}

impl FlipArgs {
    fn options(&self) -> Result<FlipOptions> {
        let options = FlipOptions {
            ppd: self.ppd,
            tonemapper: self.tonemapper,
            start_exposure: self.start_exposure,
            stop_exposure: self.stop_exposure,
            num_exposures: self.num_exposures,
        };
        options.validate()?;
        Ok(options)
    }
}

fn tone_mapper() -> impl TypedValueParser<Value = ToneMapper> {
    const ALL: [ToneMapper; 3] = [ToneMapper::Aces, ToneMapper::Hable, ToneMapper::Reinhard];
    PossibleValuesParser::new(ALL.map(ToneMapper::name)).try_map(|name| {
        let found = ALL.into_iter().find(|mapper| mapper.name() == name);
        found.ok_or_else(|| format!("`{name}` is no tone curve"))
    })
}

pub(crate) fn run(args: &EvalArgs, global: &GlobalArgs) -> Result<ExitCode> {
    if let Some(EvalCommand::Pair(pair)) = &args.pair {
        return pair::run(pair, global);
    }
    // clap asks for all three unless the subcommand is given.
    let given = |path: &Option<PathBuf>| path.clone().unwrap_or_default();
    let mut options = EvalOptions {
        renders: given(&args.renders),
        dataset: given(&args.reference),
        out: given(&args.out),
        split: args.split_rule,
        subset: args.split,
        flip: args.flip.options()?,
        force: args.force,
    };
    let mut builder = RecordBuilder::begin("eval", &options)?;
    let dataset = Dataset::open(&options.dataset)?;
    let split = dataset.split(options.split)?;
    builder.record.inputs.push(Input::of_cameras(&dataset)?);
    builder.record.split = Some(SplitRecord::new(&split, options.subset));
    let outputs = outputs(&dataset, &split.indices(options.subset));
    if same_folder(&options.out, &options.renders) {
        bail!(
            "{}: --out is the folder of the renderings",
            options.out.display()
        );
    }
    let target = Target {
        dir: &options.out.clone(),
        command: "eval",
        inputs: &inputs(&options.renders, &dataset),
        replace: Replace::from_flag(args.force),
    };
    target.check(&outputs)?;
    // Nothing is in the way now, or it may be replaced.
    options.force = true;

    let mut reporter = Reporter::new(global);
    let mut failed = None;
    let outcome = eagpt_eval::evaluate(&options, &mut |message| {
        let told = tell(&mut reporter, &message, &target);
        if let Err(error) = told {
            failed.get_or_insert(error);
        }
    });
    reporter.finish();
    let evaluation = outcome?;
    if let Some(error) = failed {
        return Err(error);
    }
    let record = &mut builder.record;
    record.device = Some("cpu".to_owned());
    record.warnings.clone_from(&evaluation.warnings);
    record.outputs = outputs
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    builder.write(&options.out)?;
    for warning in &evaluation.warnings {
        reporter.warning(warning);
    }
    finish(&reporter, &options, &evaluation, global)?;
    Ok(ExitCode::SUCCESS)
}

fn tell(reporter: &mut Reporter, message: &EvalProgress, target: &Target<'_>) -> Result<()> {
    match message {
        // The inputs have been checked: from here on an earlier result may go.
        EvalProgress::Started { total } => {
            target.prepare()?;
            reporter.begin("comparing", "views", 0, *total as u64);
        }
        EvalProgress::View { name, done, .. } => {
            reporter.advance(*done as u64, || name.clone());
        }
        // Shown at the end, where they are not lost above a table.
        EvalProgress::Warning { .. } => {}
    }
    reporter.message(message)
}

/// The means, as the last thing on the screen.
fn finish(
    reporter: &Reporter,
    options: &EvalOptions,
    evaluation: &Evaluation,
    global: &GlobalArgs,
) -> Result<()> {
    let path = options.out.join("metrics.json");
    let means: serde_json::Map<String, serde_json::Value> = evaluation
        .means
        .iter()
        .map(|mean| (mean.metric.key.to_owned(), mean.value.into()))
        .collect();
    reporter.message(&serde_json::json!({ "message": "done", "path": path, "mean": means }))?;
    if global.json || global.quiet {
        return Ok(());
    }
    let rows = evaluation
        .means
        .iter()
        .map(|mean| (mean.metric.key, mean.value));
    terminal::print(&table(rows))?;
    reporter.note(&format!(
        "{}: {} views",
        path.display(),
        evaluation.views.len()
    ));
    Ok(())
}

/// Lines of `key value`.
fn table<'a>(rows: impl Iterator<Item = (&'a str, f64)>) -> String {
    rows.map(|(key, value)| format!("{key:<22} {value:>9.4}\n"))
        .collect()
}

fn outputs(dataset: &Dataset, indices: &[usize]) -> Vec<PathBuf> {
    let files = ["metrics.json", "metrics.csv", "table.md", "table.tex"];
    let maps = indices.iter().map(|&index| {
        let name = &dataset.frames()[index].name;
        Path::new("flip").join(format!("{name}.png"))
    });
    files.into_iter().map(PathBuf::from).chain(maps).collect()
}

/// Files that an evaluation must never replace.
fn inputs(renders: &Path, dataset: &Dataset) -> Vec<PathBuf> {
    let images = dataset
        .frames()
        .iter()
        .map(|frame| renders.join(format!("{}.exr", frame.name)));
    cli::dataset_files(dataset)
        .into_iter()
        .chain(images)
        .collect()
}

fn same_folder(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}
