//! `eagpt eval table`: evaluations of several modes of rendering in one table.

use crate::args::GlobalArgs;
use crate::command_line;
use crate::output::Target;
use crate::progress::Reporter;
use crate::record::{Input, RecordBuilder};
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_eval::tabulate::{DEFAULT_METRICS, FILES};
use eagpt_eval::{METRICS_FILE, TableFolder, TableOptions};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Put evaluations into the table of the paper: modes of rendering down, lightings across
///
/// Reads DIR/metrics.json of `eagpt eval`, of one condition or of several. A row is the mode of the
/// renderings, as their own record told `eagpt eval`, or ROW; a column is a metric of a condition;
/// the last one is the seconds that a frame took.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = OUTPUTS_AND_EXAMPLE)]
pub(crate) struct TableArgs {
    /// Evaluations; ROW= before one gives its row a name
    #[arg(value_name = "[ROW=]DIR", required = true, value_parser = folder)]
    #[serde(serialize_with = "command_line::texts")]
    pub(crate) folders: Vec<TableFolder>,
    /// Metrics of each condition, separated by commas: keys of `mean` in metrics.json
    #[arg(long, value_name = "KEY,…", value_delimiter = ',', default_values = DEFAULT_METRICS)]
    pub(crate) metrics: Vec<String>,
    /// Folder for results; created
    #[arg(long, value_name = "DIR2")]
    pub(crate) out: PathBuf,
    /// Replace an earlier table in DIR2
    #[arg(long)]
    pub(crate) force: bool,
}

const OUTPUTS_AND_EXAMPLE: &str = "Files in DIR2:
  table.md, table.tex  for people
  table.csv            one line for each row and condition
  table.json           the same, and how each number came about
  record.json          version, options, inputs

Example:
  eagpt eval table eval/0 eval/1 eval/path baked=eval/baked --metrics psnr_srgb_db,flip_hdr --out table";

fn folder(text: &str) -> Result<TableFolder, String> {
    let (row, folder) = match text.split_once('=') {
        // A folder may have the sign in its own name.
        Some((row, folder)) if !Path::new(text).exists() => (Some(row), folder),
        _ => (None, text),
    };
    if row == Some("") || folder.is_empty() {
        return Err("ROW and DIR must not be empty".to_owned());
    }
    Ok(TableFolder {
        folder: folder.into(),
        row: row.map(str::to_owned),
    })
}

pub(super) fn run(args: &TableArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let options = TableOptions {
        folders: args.folders.clone(),
        metrics: args.metrics.clone(),
    };
    let mut builder = RecordBuilder::begin("eval table", &options, global)?;
    let folders = options.folders.iter();
    let inputs: Vec<PathBuf> = folders.map(|f| f.folder.join(METRICS_FILE)).collect();
    for path in &inputs {
        builder.record.inputs.push(Input::of(path)?);
    }
    let target = Target::new(&args.out, "eval table", &inputs, args.force);
    target.check(&FILES.map(PathBuf::from))?;
    let table = eagpt_eval::tabulate(&options)?;
    target.prepare()?;
    table.write(&args.out)?;
    builder.wrote(FILES);
    builder.write(&args.out)?;

    let reporter = Reporter::new(global);
    let path = args.out.join("table.json");
    reporter.message(&serde_json::json!({ "message": "done", "path": path }))?;
    if !global.json && !global.quiet {
        terminal::print(&table.markdown())?;
    }
    reporter.note(&format!("{}: {} rows", path.display(), table.num_rows()));
    Ok(ExitCode::SUCCESS)
}
