//! `eagpt report`: the results of a run on one page.

use crate::args::GlobalArgs;
use crate::output::{self, Replace};
use crate::progress::Reporter;
use anyhow::Result;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Put the results of a run on one page
///
/// The page is one HTML file with all pictures, tables and curves in it. It needs no network;
/// sliders aside, it needs no JavaScript. It links to pages that `eagpt export --format html` has
/// written beside scenes of the run, as RUN/bake/evening.html. `eagpt run` writes the report as its
/// last step.
#[derive(Debug, Clone, Args, Serialize)]
#[command(after_long_help = "Example:\n  eagpt report runs/kitchen --out kitchen.html")]
pub(crate) struct ReportArgs {
    /// Folder of a run, as `eagpt run` leaves it
    #[arg(value_name = "RUN")]
    pub(crate) run: PathBuf,
    /// File to write
    #[arg(long, value_name = "FILE.html")]
    pub(crate) out: PathBuf,
    /// Replace the file if it is there
    #[arg(long)]
    pub(crate) force: bool,
}

pub(crate) fn run(args: &ReportArgs, global: &GlobalArgs) -> Result<ExitCode> {
    output::check_part(&args.out, &[], Replace::from_flag(args.force))?;
    output::create_parent(&args.out)?;
    eagpt_report::write(&args.run, &args.out)?;
    let reporter = Reporter::new(global);
    reporter.note(&format!("{}", args.out.display()));
    reporter.message(&serde_json::json!({ "message": "done", "path": args.out }))?;
    Ok(ExitCode::SUCCESS)
}
