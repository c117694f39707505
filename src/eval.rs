//! `eagpt eval`: how good renderings are.

mod conditions;
mod pair;
mod table;

use crate::args::GlobalArgs;
use anyhow::Result;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use eagpt_eval::{FlipOptions, ToneMapper};
use eagpt_scene::dataset::{SplitRule, Subset};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
pub(crate) use table::TableArgs;

/// Measure renderings against the views of a dataset, or one image against another
///
/// Compares DIR/VIEW.exr with the radiance of each view and, where both are there, the albedo,
/// normal, depth and emission in DIR/albedo/VIEW.exr and so on with those of the dataset. Measured
/// are the views that were rendered and that the dataset has; where that is fewer than were
/// rendered, a warning says so. --split asks for a subset: by the order of the dataset that was
/// rendered, as DIR/record.json names it, since a reference may hold the test views alone.
///
/// Several DIRs and as many --reference are several conditions, as a room under its own and under a
/// new light. An option that can be given for each condition is given once for all of them, or as
/// often as --reference and in its order.
#[derive(Debug, Clone, Args, Serialize)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_long_help = OUTPUTS_AND_EXAMPLES
)]
pub(crate) struct EvalArgs {
    #[command(subcommand)]
    pub(crate) command: Option<EvalCommand>,
    /// Folder of renderings, as `eagpt render` writes it; one for each condition
    #[arg(value_name = "DIR", required = true)]
    pub(crate) renders: Vec<PathBuf>,
    /// Dataset with the references: a folder with a transforms.json, or that file; one for each
    /// condition
    #[arg(long, value_name = "DATASET", required = true)]
    pub(crate) reference: Vec<PathBuf>,
    /// Dataset with the same views under an earlier light: splits the error into what the new light
    /// reaches and its shadows; for each condition
    #[arg(long, value_name = "DATASET")]
    pub(crate) before: Vec<PathBuf>,
    /// Name of the condition, one for each [default: that of the dataset's folder]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Vec<String>,
    /// Views to measure, all of which must have been rendered; for each condition [default: those
    /// that were rendered]
    #[arg(long, value_name = "SUBSET", value_enum)]
    pub(crate) split: Vec<Subset>,
    /// Rule that divides the views of the dataset that was rendered into training and test views,
    /// for --split and for warnings of views that were trained on; for each condition [default:
    /// that of `eagpt render`]
    #[arg(long, value_name = "RULE", value_enum)]
    split_rule: Vec<SplitRule>,
    /// Folder for results; created
    #[arg(long, value_name = "DIR2", required = true)]
    pub(crate) out: Option<PathBuf>,
    /// Replace an earlier evaluation in DIR2
    #[arg(long)]
    pub(crate) force: bool,
    #[command(flatten)]
    #[serde(flatten)]
    flip: FlipArgs,
}

const OUTPUTS_AND_EXAMPLES: &str = "Files in DIR2:
  metrics.json        means, every view, definitions of the metrics
  metrics.csv         one line a view
  table.md, table.tex the same for people
  flip/VIEW.png       HDR-FLIP error, black 0 to white 1 (magma)
  record.json         version, options, inputs, times, memory
Of several conditions, these are in DIR2/NAME, and the files in DIR2 hold all conditions and their mean.

Examples:
  eagpt eval renders/0 --reference kitchen --out eval/0
  eagpt eval renders/all --reference kitchen --split test --out eval/test
  eagpt eval renders/ball --reference kitchen-ball --before kitchen --out eval/ball
  eagpt eval renders/path renders/ball --reference kitchen --reference kitchen-ball --out eval/both
  eagpt eval table eval/0 eval/both --out table
  eagpt eval pair photograph.exr rendering.exr --json";

#[derive(Debug, Clone, Subcommand, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum EvalCommand {
    #[serde(skip)]
    Pair(pair::PairArgs),
    Table(TableArgs),
}

/// Settings of FLIP.
#[derive(Debug, Clone, Args, Serialize)]
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

impl EvalArgs {
    /// `eagpt eval table`.
    pub(crate) fn table(args: TableArgs) -> Self {
        let flip = FlipOptions::default();
        Self {
            command: Some(EvalCommand::Table(args)),
            renders: Vec::new(),
            reference: Vec::new(),
            before: Vec::new(),
            name: Vec::new(),
            split: Vec::new(),
            split_rule: Vec::new(),
            out: None,
            force: false,
            flip: FlipArgs {
                ppd: flip.ppd,
                tonemapper: flip.tonemapper,
                start_exposure: flip.start_exposure,
                stop_exposure: flip.stop_exposure,
                num_exposures: flip.num_exposures,
            },
        }
    }
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
    match &args.command {
        Some(EvalCommand::Pair(pair)) => pair::run(pair, global),
        Some(EvalCommand::Table(table)) => table::run(table, global),
        None => conditions::run(args, global),
    }
}

/// Characters of a column that has no longer heading.
const COLUMN_WIDTH: usize = 9;

/// Lines of `key value`, a value in each column of `width` characters.
fn table<'a>(rows: impl Iterator<Item = (&'a str, Vec<Option<f64>>)>, width: usize) -> String {
    rows.map(|(key, values)| {
        let value = |value: &Option<f64>| match value {
            Some(value) => format!(" {value:>width$.4}"),
            None => format!(" {:>width$}", "--"),
        };
        let values: String = values.iter().map(value).collect();
        format!("{key:<22}{values}\n")
    })
    .collect()
}
