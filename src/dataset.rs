//! `eagpt dataset`: datasets of other programs in and out, and what is in a dataset.

mod check;
mod export;
mod import;

use crate::args::GlobalArgs;
use crate::record::FILE_NAME;
use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Import, export and check datasets
#[derive(Debug, Clone, Args)]
#[command(subcommand_required = true)]
pub(crate) struct DatasetArgs {
    #[command(subcommand)]
    command: DatasetCommand,
}

#[derive(Debug, Clone, Subcommand)]
enum DatasetCommand {
    Import(Box<import::ImportArgs>),
    Export(export::ExportArgs),
    Check(check::CheckArgs),
}

pub(crate) fn run(args: &DatasetArgs, global: &GlobalArgs) -> Result<ExitCode> {
    match &args.command {
        DatasetCommand::Import(args) => import::run(args, global),
        DatasetCommand::Export(args) => export::run(args, global),
        DatasetCommand::Check(args) => check::run(args, global),
    }
}

/// Refuses to write into a dataset that is there without a record: it is somebody's only copy,
/// which no `--force` may cost.
fn refuse_foreign(out: &Path, planned: &[PathBuf]) -> Result<()> {
    if out.join(FILE_NAME).exists() {
        return Ok(());
    }
    match planned.iter().find(|file| out.join(file).exists()) {
        None => Ok(()),
        Some(file) => bail!(
            "{}: {}: is there already, and no record of this program beside: --force does not replace it, --out names another folder",
            out.display(),
            file.display()
        ),
    }
}
