//! `eagpt dataset`: datasets of other programs in and out, and what is in a dataset.

mod check;
mod export;
mod import;

use crate::cli::GlobalArgs;
use anyhow::Result;
use clap::{Args, Subcommand};
use std::process::ExitCode;

/// Import, export and check datasets
#[derive(Debug, Args)]
#[command(subcommand_required = true)]
pub(crate) struct DatasetArgs {
    #[command(subcommand)]
    command: DatasetCommand,
}

#[derive(Debug, Subcommand)]
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
