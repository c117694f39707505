//! `eagpt dataset check`: what a dataset has, what it lacks, what is wrong with it.

use crate::args::GlobalArgs;
use crate::progress::Reporter;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use eagpt_convert::check::{CheckProgress, check};
use std::path::PathBuf;
use std::process::ExitCode;

/// Say what a dataset has, what it lacks and what is wrong with it
///
/// Reads every image. Prints kinds of images with value ranges and coverage, cameras, intrinsics,
/// points, the split by every rule, and all findings by view. With --json, one object with
/// everything. Exit code 1 if something is broken (a frame without image, an unreadable file, NaN
/// or negative light, a wrong size), 0 with warnings alone.
#[derive(Debug, Clone, Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct CheckArgs {
    /// Dataset: a folder with a transforms.json, or that file
    #[arg(value_name = "DATASET")]
    dataset: PathBuf,
}

const EXAMPLES: &str = "Examples:
  eagpt dataset check kitchen
  eagpt dataset check kitchen --json | tail -1 > check.json";

pub(super) fn run(args: &CheckArgs, global: &GlobalArgs) -> Result<ExitCode> {
    let mut reporter = Reporter::new(global);
    let report = reporter.follow(tell, |progress| check(&args.dataset, progress))?;
    if global.json {
        reporter.message(&serde_json::json!({ "message": "report", "report": report }))?;
    } else if !global.quiet {
        terminal::print(&report.text())?;
    }
    Ok(if report.is_sound() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

/// Shows a message of the job.
fn tell(reporter: &mut Reporter, message: &CheckProgress) -> Result<()> {
    let CheckProgress::Checking { done, total } = message;
    reporter.count(("checking", "views"), (*done, *total), message)
}
